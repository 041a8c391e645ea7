//! The probe stage, driven by touches whose true contact is known.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod rig;
mod runs;
mod touches;
