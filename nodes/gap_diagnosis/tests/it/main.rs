//! The tests of this crate from outside, in one program.

mod following;
mod heated_alike;
mod logs;
mod long;
mod schema;
mod session;
mod simulated;
mod standing;
mod targets;
mod trials;
