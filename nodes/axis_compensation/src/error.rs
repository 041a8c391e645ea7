//! What is refused when the node starts. Bad input while it runs is a [`crate::Diagnostic`].

use machine::ChainError;
use metrology::Axis;
use metrology::number::number;

use crate::positioning::refusal::PositioningRefusal;

/// A configuration or machine that cannot be compensated safely.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AxisCompensationError {
    /// A parameter is outside its limits.
    #[error("{key} = {value} {unit}: must be from {lower} to {upper} {unit}", value = number(*value), lower = number(*lower), upper = number(*upper))]
    ParameterOutOfRange {
        /// The parameter.
        key: &'static str,
        /// What was given.
        value: f64,
        /// Least value allowed.
        lower: f64,
        /// Greatest value allowed.
        upper: f64,
        /// Unit of all three.
        unit: &'static str,
    },
    /// A limit of one axis is outside its limits.
    #[error("axes.{axis}.{key} = {value} {unit}: must be from {lower} to {upper} {unit}", value = number(*value), lower = number(*lower), upper = number(*upper))]
    LimitOutOfRange {
        /// The axis.
        axis: Axis,
        /// The key.
        key: &'static str,
        /// What was given.
        value: f64,
        /// Least value allowed.
        lower: f64,
        /// Greatest value allowed.
        upper: f64,
        /// Unit of all three.
        unit: &'static str,
    },
    /// No axis is to be compensated.
    #[error("axes: no axis is given, at least 1 is needed")]
    NoAxis,
    /// The axis is not a linear axis of the machine.
    #[error("axes.{axis}: the machine file has no such linear axis")]
    NotALinearAxis {
        /// The axis.
        axis: Axis,
    },
    /// A parameter of an axis' positioning part is outside its limits.
    #[error("positioning.{axis}.{key} = {value} {unit}: must be from {lower} to {upper} {unit}", value = number(*value), lower = number(*lower), upper = number(*upper))]
    PositioningOutOfRange {
        /// The axis.
        axis: Axis,
        /// The key.
        key: &'static str,
        /// What was given.
        value: f64,
        /// Least value allowed.
        lower: f64,
        /// Greatest value allowed.
        upper: f64,
        /// Unit of all three.
        unit: &'static str,
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
