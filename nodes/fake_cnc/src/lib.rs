//! A five-axis machine with its own physics that stands in for hardware.
//!
//! `plant` is the machine itself: drives, heat, geometry, the touch probe and the sensors. Its
//! physics shares no formula with the models that compensate it.

pub mod plant;

pub use plant::{Feedback, Plant, PlantError, PlantFile, ProbeEdge};
