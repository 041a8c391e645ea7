//! A five-axis machine with its own physics that stands in for hardware.
//!
//! `plant` is the machine itself: drives, heat, geometry, the touch probe and the sensors. Its
//! physics shares no formula with the models that compensate it.
//!
//! The rest is its control. `rs274` reads a program and checks it whole; `path` turns each motion
//! into a curve of all axes, and `lookahead` gives a chain of them speeds that no axis' limit
//! forbids. `servo` closes position and velocity loops around the plant, with `offset` adding the
//! compensation inside. `touching` latches the axes when the probe answers. `control` runs these once
//! per servo period by the controller's own `clock`, and `stage` speaks for all of them.

pub mod clock;
pub mod config;
pub mod control;
pub mod diagnostic;
pub mod error;
pub mod hardware;
pub mod lookahead;
pub mod offset;
pub mod outcome;
pub mod path;
pub mod plant;
pub mod rs274;
pub mod servo;
pub mod stage;
pub mod sweep;
pub mod touching;

pub use config::Config;
pub use diagnostic::{Diagnostic, Severity};
pub use error::{CncError, ProgramError};
pub use hardware::Hardware;
pub use outcome::{Outcome, ProgramState};
pub use plant::{Feedback, Plant, PlantError, PlantFile, ProbeEdge};
pub use stage::{Cnc, Input, Output};
