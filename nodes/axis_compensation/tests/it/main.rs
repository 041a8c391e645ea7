//! The tests of this crate from outside, in one program.

mod allocation;
mod geometry;
mod positioning;
mod props;
mod scenes;
