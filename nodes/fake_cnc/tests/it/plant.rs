//! The plant from outside: touches, faults, files, repeatability, and the drift of the first run.

#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod drift;
mod file;
mod pose;
mod rig;
mod scatter;
mod touch;
