//! What is refused when the node starts. Bad input while it runs is a [`crate::Diagnostic`].

use machine::ChainError;
use metrology::Axis;
use metrology::bound::BoundError;

use crate::positioning::refusal::PositioningRefusal;

/// A configuration or machine that cannot be compensated safely.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AxisCompensationError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// No axis is to be compensated.
    #[error("axes: no axis is given, at least 1 is needed")]
    NoAxis,
    /// The axis is not a linear axis of the machine.
    #[error("axes.{axis}: the machine file has no such linear axis")]
    NotALinearAxis {
        /// The axis.
        axis: Axis,
    },
    /// A positioning part for an axis that is not compensated.
    #[error("positioning.{axis}: the axis has no limits under `axes`")]
    NotCompensated {
        /// The axis.
        axis: Axis,
    },
    /// What is to be measured has no scale.
    #[error("positioning.{axis}: the machine file gives the axis no scale_resolution_um")]
    NoScale {
        /// The axis.
        axis: Axis,
    },
    /// A start table or loop that is refused.
    #[error("positioning: {source}")]
    Positioning {
        /// Why.
        #[from]
        source: PositioningRefusal,
    },
    /// The chain of the machine file cannot be read.
    #[error("chain of the machine file: {source}")]
    Chain {
        /// Where and why.
        source: ChainError,
    },
}
