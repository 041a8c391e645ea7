//! What is refused when the node starts. Bad input while it runs is a [`crate::Diagnostic`].

use metrology::Axis;

/// A configuration or machine that cannot be compensated safely.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AxisCompensationError {
    /// A parameter is outside its limits.
    #[error("{key} = {value} {unit}: must be from {lower} to {upper} {unit}")]
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
    #[error("axes.{axis}.{key} = {value} {unit}: must be from {lower} to {upper} {unit}")]
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
}
