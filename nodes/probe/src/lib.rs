//! From the trigger of a touch probe to the place of a surface.
//!
//! A probe's signal arrives late: when the controller latches its axes the ball has already moved on
//! by feed times latency. `queue` remembers where the axes were and gives their position at the
//! instant of contact; `correction` takes the latency out of a trigger, adds the ball's effective
//! radius and states the uncertainty. `latency_in_use` knows which latency holds. `run` gathers the
//! points of one test segment; at its end `block` gives the three faces of each reference block and
//! `shape` fits planes, bores, bosses and spheres. `stage` is the node's whole computation.

pub mod block;
pub mod config;
pub mod correction;
pub mod diagnostic;
pub mod error;
pub mod latency_in_use;
pub mod queue;
mod run;
pub mod shape;
pub mod stage;

pub use config::ProbeConfig;
pub use diagnostic::Diagnostic;
pub use error::ProbeError;
pub use stage::{Input, Output, ProbeStage};
