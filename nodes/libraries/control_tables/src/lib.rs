//! Tables and parameters that a real control loads, made from measured errors.
//!
//! # What all exports have in common
//!
//! An error is where the tool is minus where it was commanded to be. A control that adds `c` to the
//! command `p` of an axis with the error `e` leaves
//!
//! ```text
//!   r(p) = c(p) + e(p + c(p)),   c(p) = -e(p)   =>   |r| <= max|e| max|e'|        (1)
//! ```
//!
//! For an error of 30 µm that changes by 100 µm/m this rest is 3 nm. What a control wants to be told
//! is not `c` but something of its own: the actual position, the error with its sign, increments of
//! pulses. Sign, unit and rounding of each control are stated in its module and nowhere else.
//!
//! # Signs
//!
//! | table | sign known from |
//! |---|---|
//! | LinuxCNC `COMP_FILE` | tried on LinuxCNC 2.9 |
//! | SINUMERIK `$AA_ENC_COMP`, `$AN_CEC` | its manual, in words |
//! | SINUMERIK temperature, HEIDENHAIN `.COM`, FANUC pitch error | nobody: given by the user as [`Sign`] |
//! | CSV | none needed: error and compensation both stand in it |
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p | `position` | mm, rad |
//! | e | `up`, `down`, `error` | mm, rad |
//!
//! # The way through
//!
//! [`Grid`] chooses points inside the travel. [`AxisErrors`] holds the positioning errors of one axis
//! in both directions, [`CrossErrors`] the error in one direction as a function of another axis'
//! position; both come from published samples and are checked once. An exporter takes them and gives
//! an [`ExportFile`] or refuses with an [`ExportError`]; what it must say about the file is in
//! `notes`, and also in the file where the format has comments.
//!
//! # Holds when
//! Straight lines between the points are near enough: a control interpolates linearly. Angular errors
//! act through arms that a table per axis does not know; only HEIDENHAIN's takes them.
//!
//! # References
//! \[1\] ISO 230-1:2012, 3.4 to 3.6: components and their signs. \[2\] ISO/TR 16907: kinds of numerical
//! compensation (cited from memory).

mod axis_errors;
mod cross_errors;
pub mod csv;
mod error;
pub mod fanuc;
mod file;
mod grid;
pub mod heidenhain;
pub mod linuxcnc;
mod number;
mod plausible;
pub mod selection;
mod sign;
pub mod sinumerik;

pub use axis_errors::AxisErrors;
pub use cross_errors::{CrossErrors, Unestimable};
pub use error::ExportError;
pub use file::ExportFile;
pub use grid::Grid;
pub use plausible::Travels;
pub use sign::Sign;
