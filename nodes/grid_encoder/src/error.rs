//! Parameters that cannot work, inputs that break the stage's contract, and recordings that cannot be fitted.

use machine::ChainError;
use metrology::Axis;
use metrology::bound::BoundError;
use metrology::sample::TestKind;

/// Why a stage is not built, or an event not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridEncoderError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// A component that the chain does not have.
    #[error("components: \"{name}\" is not an error component of {chain}")]
    NoComponent {
        /// As written.
        name: String,
        /// The chain.
        chain: String,
    },
    /// The machine file's chain cannot be read.
    #[error("chain: {error}")]
    Chain {
        /// Where and why.
        #[source]
        error: ChainError,
    },
    /// The machine file has no grid encoder.
    #[error("grid_encoder: the machine file has none")]
    NoGridEncoder,
    /// A sample lacks an axis that the machine file has.
    #[error("axis state lacks axis {axis} of the machine file")]
    AxisMissing {
        /// The axis.
        axis: Axis,
    },
}

/// Why recordings are not fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// No component was asked for.
    #[error("no error component is asked for")]
    NothingAsked,
    /// There are no points.
    #[error("the recordings have no points")]
    NoPoints,
    /// A recording without a plane.
    #[error("run {run}: a grid recording needs a plane")]
    NoPlane {
        /// Its run.
        run: u32,
    },
    /// One zero was used in two planes or set-ups: the plate moved without being zeroed.
    #[error("run {run}: zero {zero_id} was used in another plane or set-up before")]
    ZeroUsedTwice {
        /// The zero.
        zero_id: u32,
        /// The later run.
        run: u32,
    },
    /// Radii need a circle.
    #[error("run {run}: {kind:?} has no radius, and only radii are used")]
    NotRound {
        /// Its run.
        run: u32,
        /// Its trajectory.
        kind: TestKind,
    },
    /// A number is not finite, or an uncertainty not above 0.
    #[error("run {run}, point {point}: a number is not finite or an uncertainty not above 0")]
    NotUsable {
        /// Its run.
        run: u32,
        /// Index of the point.
        point: usize,
    },
    /// The singular value decomposition did not converge.
    #[error("singular value decomposition did not converge")]
    NoDecomposition,
}
