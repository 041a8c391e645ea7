//! Reads RS-274/NGC programs and checks them whole before anything moves.
//!
//! The subset: motions G0 G1 G2 G3 G38.2 to G38.5 G80, G4, G53; coordinates G10 L2, G52, G54 to G59.3, G92
//! to G92.3, G43 G43.1 G49; modes G17 to G19, G20 G21, G40, G61 G61.1 G64, G90 G91, G90.1 G91.1, G94;
//! M0 M1 M2 M3 M5 M60; the words of the machine's axes and F H I J K L N P Q R S; comments. A word
//! outside it is refused with its line and column: a control that skips what it does not know moves
//! somewhere unexpected. Every number has a bound (`bounds`).
//!
//! Rules are those of the RS274/NGC interpreter, version 3 \[1\], as LinuxCNC applies them; each rule
//! is pinned by `val_linuxcnc_accepts_and_refuses_the_same_blocks` against answers of LinuxCNC's own
//! stand-alone interpreter. Deliberately narrower than LinuxCNC: no expressions, parameters, block
//! delete, `%`, rotary words in a touch, or text after M2; a touch must not end where it starts.
//!
//! A block's parts take effect in this order: comments, F, S, spindle, dwell, plane, units, tool length,
//! work system, path mode, distance mode, mode of centres, G10 G52 G92, motion, stop or end. So F in the
//! same block as G20 is still read in the old unit, as LinuxCNC does.
//!
//! State that outlives a program is in [`Registers`]: reading starts from it and lists its changes as steps,
//! so that a program that ends early leaves the state of where it ended. Motions are in machine
//! coordinates once they are read.
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
pub mod bounds;
mod machine_frame;
mod modal;
mod motion;
pub mod program;
mod reach;
pub mod registers;
mod setting;
mod words;

pub use modal::{Envelope, read, read_in};
pub use program::Program;
pub use registers::Registers;
pub use words::{Comment, Line, Word, read_line};
