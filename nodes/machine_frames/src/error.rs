//! Parameters and machine files that cannot work.

use machine::ChainError;
use metrology::number::{number, quantity};

/// Why a stage is not built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineFramesError {
    /// A parameter outside its range.
    #[error("{name} = {value}: must be from {least} to {greatest}", value = quantity(name, *value), least = number(*least), greatest = quantity(name, *greatest))]
    OutOfRange {
        /// Parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least value.
        least: f64,
        /// Greatest value.
        greatest: f64,
    },
    /// The machine file's chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
}
