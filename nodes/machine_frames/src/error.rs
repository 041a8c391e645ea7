//! Parameters and machine files that cannot work.

use machine::ChainError;
use metrology::bound::BoundError;
use metrology::number::quantity;

/// Why a stage is not built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineFramesError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// A rate that is none and is not zero.
    #[error("rate_hz = {rate_hz}: must be 0 (every position) or at least {least_hz}", rate_hz = quantity("rate_hz", *rate_hz), least_hz = quantity("rate_hz", *least_hz))]
    Rate {
        /// The rate, Hz.
        rate_hz: f64,
        /// Least rate, Hz.
        least_hz: f64,
    },
    /// The machine file's chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
}
