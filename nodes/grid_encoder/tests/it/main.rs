//! The tests of this crate from outside, in one program.

mod coverage;
mod fourteen;
mod harmonics;
mod numpy;
mod preflight;
mod rank_table;
mod reference_lines;
mod stage;
