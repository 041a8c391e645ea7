//! The tests of this crate from outside, in one program.

mod accounts;
mod adapter;
mod agent;
mod numbers;
mod parameters;
mod possible;
mod reference;
mod times;
