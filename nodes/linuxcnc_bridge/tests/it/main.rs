//! The tests of this crate from outside, in one program.

mod frame;
mod linuxcnc;
mod parameters;
mod transcript;
