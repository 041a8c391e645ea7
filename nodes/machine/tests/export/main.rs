//! Each control is interpreted from its documentation and moves an axis with a known error.
//!
//! The interpreters read the exported text back and share nothing with the exporters: the sign is decided by
//! where the axis ends up. A table that is right leaves less than its rounding; with the sign turned round the error doubles.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "the figures seen are worth showing")]

mod cross;
mod csv;
mod fanuc;
mod heidenhain;
mod linuxcnc;
mod refusals;
mod selection;
mod sinumerik;
mod slide;
