//! The dual loop on an axis with physics of its own.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod accuracy;
mod rules;
mod screw_axis;
