//! Runs measuring cycles and the steps of a plan on a controller.
//!
//! A *cycle* is a touching program that this crate takes from `machine::cycle`, sends to the
//! controller as a goal of `cnc/run_program` and brackets with test segments, so that the nodes
//! that evaluate touches know what each belongs to. A *plan* strings cycles, part programs and
//! switching of the compensation together: it is a scenario's script. While a part is being
//! produced, block cycles are put in between whenever the thermal model asks for one.
//!
//! A *measuring step* runs trajectories of `machine::trajectory` and keeps account of which plate or beam
//! is up and when its count was set to zero: every recording's segment says so.
//!
//! `extra_run` makes a plan of the run that a diagnosis asks for.
//!
//! The sequencer is the only publisher of `test/segment`, which keeps run numbers unique in a bag.

mod bounds;
pub mod config;
mod cycle;
pub mod error;
mod extra_run;
mod job;
pub mod load;
mod measuring;
pub mod plan;
pub mod recordings;
pub mod rotary;
pub mod stage;
mod task;
pub mod touch_along;
mod zeroed;

pub use config::Config;
pub use error::SequencerError;
pub use extra_run::extra_run;
pub use load::{Load, load};
pub use plan::{
    DiagonalStep, GridStep, GridTrajectory, Plan, PlanError, PositioningStep, Senses, Step,
};
pub use recordings::{PlannedRecording, recordings};
pub use stage::{CANCELED, CycleGoal, CycleOutcome, Input, Output, ProgramEnd, Sequencer};
