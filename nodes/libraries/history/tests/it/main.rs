//! The tests of this crate from outside, in one program.

#![expect(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "tests write and damage stores, and stop at the first surprise"
)]

mod bad_stores;
mod beside_others;
mod changes;
mod example;
mod limits;
mod many_rows;
mod storing;
mod trends;
mod two_writers;
