//! Each control's table moves an axis with a known error as the control's manual says that it does.
//!
//! The exported text is read back, and a value moves the axis by a sentence of the manual that stands, with its page, beside the line that does
//! it; where no manual has such a sentence, by the sign that was given, in both senses. Numbers of worked examples are those that the
//! manuals print. LinuxCNC's files are tried on LinuxCNC itself elsewhere.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "the figures seen are worth showing")]

mod cross;
mod csv;
mod fanuc;
mod heidenhain;
mod linuxcnc;
mod plausible;
mod refusals;
mod selection;
mod sinumerik;
mod slide;
