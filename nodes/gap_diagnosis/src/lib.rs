//! Where the simulator and the machine differ, which unmodelled effect causes it, and how far the gap
//! shrinks once that effect is added to the simulator.
//!
//! A session is what was commanded and read; `machine::twin` says what should have been read. What is
//! left is looked at against the noise that repeats show, and every question is answered with its doubt.
//! `report` is the answer, in the form that people's programs read.

pub mod report;

pub use report::GapReport;
