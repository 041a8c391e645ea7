//! The tests of this crate from outside, in one program.

mod alone;
mod both;
mod each;
mod extra_run;
mod left_out;
