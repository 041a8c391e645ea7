//! Parameters that cannot work and inputs that break the stage's contract.

use machine::ChainError;
use metrology::Axis;
use metrology::bound::BoundError;
use metrology::number::number;

/// Why a stage is not built, or an event not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProbeError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// A latency without its uncertainty.
    #[error(
        "a latency of {latency_ms} ms is given, but latency_standard_uncertainty_ms is not: a correction needs both", latency_ms = number(*latency_ms))]
    UncertaintyMissing {
        /// The latency, ms.
        latency_ms: f64,
    },
    /// The machine file's chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
    /// No stylus is mounted.
    #[error("probe.mounted = \"{stylus}\": the machine file has no stylus of this name")]
    UnknownStylus {
        /// The name.
        stylus: String,
    },
    /// The approach of a trigger is no unit vector.
    #[error("trigger {sequence}: approach has length {length}, must be 1", length = number(*length))]
    ApproachNotUnit {
        /// Number of the trigger.
        sequence: u32,
        /// Length of the vector.
        length: f64,
    },
    /// A sample lacks an axis that the machine file has.
    #[error("{sample} lacks axis {axis} of the machine file")]
    AxisMissing {
        /// Which sample.
        sample: &'static str,
        /// The axis.
        axis: Axis,
    },
}
