//! Parameters and machine files that cannot work.

use machine::ChainError;
use metrology::bound::BoundError;

/// Why a stage is not built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineFramesError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The machine file's chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
}
