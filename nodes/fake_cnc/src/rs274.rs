//! Reads RS-274/NGC programs and checks them whole before anything moves.
//!
//! The subset is G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G38.2 to G38.5 G53 G90 G91, M2 M3 M5, the words
//! of the machine's axes and F I J K N P R S, and comments. A word outside it is refused with its
//! line and column: a control that skips what it does not know moves somewhere unexpected.
//!
//! Rules are those of the RS274/NGC interpreter, version 3 \[1\], as LinuxCNC applies them; each rule
//! is pinned by `val_linuxcnc_accepts_and_refuses_the_same_blocks` against answers of LinuxCNC's own
//! stand-alone interpreter. Deliberately narrower than LinuxCNC: no expressions, parameters, block
//! delete, `%`, rotary words in a touch, or text after M2; a touch must not end where it starts.
//!
//! A block's parts take effect in this order: comments, F, S, spindle, dwell, plane, units, distance
//! mode, motion, end. So F in the same block as G20 is still read in the old unit, as LinuxCNC does.
//!
//! Where a touch ends is known only when it has happened. Positions that depend on it are therefore
//! kept as intervals during the check and resolved when the motion starts ([`program::Aim`]).
//!
//! The crate `gcode` is not used to read: its values are `f32` (0.03 µm at 400 mm), its command
//! numbers overflow on `G999999999`, and its comments span lines; its words are compared with ours in
//! a test instead.
//!
//! # References
//! \[1\] T. Kramer, F. Proctor, E. Messina, The NIST RS274/NGC Interpreter, version 3, NISTIR 6556 (2000),
//! sections 3.3 (blocks), 3.4 (modal groups), 3.5 (G codes), 3.8 (order of execution).

mod arc;
mod block;
mod modal;
pub mod program;
mod words;

pub use modal::{Envelope, read};
pub use program::Program;
pub use words::{Comment, Line, Word, read_line};
