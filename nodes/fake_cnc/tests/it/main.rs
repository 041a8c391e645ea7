//! The tests of this crate from outside, in one program.

mod allocation;
mod control;
mod extremes;
mod offsets;
mod parameters;
mod planner;
mod plant;
mod rs274;
mod trajectories;
