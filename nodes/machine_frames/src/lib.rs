//! Where each body of the machine is, for tf.
//!
//! `stage` takes the positions of the axes and tells the poses of `machine::frames`: the fixed ones once, the moving
//! ones with every position. `config` holds its parameters, `diagnostic` what it finds lacking.

mod config;
mod diagnostic;
mod error;
mod stage;

pub use config::MachineFramesConfig;
pub use diagnostic::Diagnostic;
pub use error::MachineFramesError;
pub use stage::{Input, MachineFramesStage, Output};
