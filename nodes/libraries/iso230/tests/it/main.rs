//! The tests of this crate from outside, in one program.

mod breakdown;
mod iso230;
