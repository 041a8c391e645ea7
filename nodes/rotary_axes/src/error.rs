//! Parameters that cannot work, inputs that break the stage's contract, fits that have no answer.

use machine::PoseError;
use metrology::Axis;
use metrology::bound::BoundError;

/// Why a stage is not built, or an event not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RotaryAxesError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The machine's rotary axes cannot be calibrated with a sphere.
    #[error("{source}")]
    Machine {
        /// Why.
        #[from]
        source: PoseError,
    },
    /// A feature of a rotary test lacks a rotary axis of the machine.
    #[error("run {run}: sphere {sphere} does not say where axis {axis} was")]
    AxisMissing {
        /// The run.
        run: u32,
        /// The sphere.
        sphere: String,
        /// The axis.
        axis: Axis,
    },
}

/// Why there is no estimate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimateError {
    /// Fewer visits than unknowns need.
    #[error(
        "{visits} visits of {spheres} spheres: {unknowns} location errors and the spheres' places need at least {least}"
    )]
    TooFewVisits {
        /// How many.
        visits: usize,
        /// How many spheres.
        spheres: usize,
        /// How many location errors.
        unknowns: usize,
        /// How many are needed.
        least: usize,
    },
    /// A visit with a number that is not finite or a covariance that is none.
    #[error(
        "visit {index} of sphere {sphere}: centre, pose and covariance must be finite, the covariance positive definite"
    )]
    UnusableVisit {
        /// Place in the list.
        index: usize,
        /// The sphere.
        sphere: String,
    },
    /// The decomposition did not converge.
    #[error("singular value decomposition did not converge")]
    NoDecomposition,
}
