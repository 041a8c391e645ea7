//! What is refused of a geometry model, and of a pose.

use metrology::number::{along, number};
use metrology::{Axis, ErrorComponent};

use crate::chain::ChainError;

/// A published model that cannot be used for a machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumetricError {
    /// The chain string of the model cannot be read.
    #[error("chain \"{chain}\" of the geometry model: {error}")]
    ChainUnreadable {
        /// The string.
        chain: String,
        /// Where and why.
        #[source]
        error: ChainError,
    },
    /// The model is of another machine.
    #[error("geometry model is of a machine {found}, this one is {expected}")]
    ChainDiffers {
        /// Chain of the model.
        found: String,
        /// Chain of the machine.
        expected: String,
    },
    /// The axis does not exist.
    #[error("{component}: chain {chain} has no axis {}", .component.of)]
    NoSuchAxis {
        /// The component.
        component: ErrorComponent,
        /// Chain of the machine.
        chain: String,
    },
    /// The location error has no meaning for the chain.
    #[error("{component}: chain {chain} has no such location error")]
    NoSuchLocation {
        /// The component.
        component: ErrorComponent,
        /// Chain of the machine.
        chain: String,
    },
    /// A component is given twice, perhaps by two models.
    #[error("{component} is given twice")]
    Duplicate {
        /// The component.
        component: ErrorComponent,
    },
    /// A location error that depends on a position.
    #[error("{component} is a location error and must be a constant")]
    LocationNotConstant {
        /// The component.
        component: ErrorComponent,
    },
    /// A number is not finite.
    #[error("{component}: {what}[{index}] = {value}: must be a finite number", value = number(*value))]
    NotFinite {
        /// The component.
        component: ErrorComponent,
        /// Which list.
        what: &'static str,
        /// Place in it.
        index: usize,
        /// What stands there.
        value: f64,
    },
    /// Coefficients and powers or knots do not belong together.
    #[error("{component}: {n_coefficients} coefficients need {needed} {what}, there are {found}")]
    LengthsDiffer {
        /// The component.
        component: ErrorComponent,
        /// Powers or knots.
        what: &'static str,
        /// Coefficients given.
        n_coefficients: usize,
        /// Powers or knots needed.
        needed: usize,
        /// Powers or knots given.
        found: usize,
    },
    /// Too few coefficients for the form.
    #[error("{component}: {found} coefficients, its form needs {needed}")]
    CoefficientCount {
        /// The component.
        component: ErrorComponent,
        /// Coefficients given.
        found: usize,
        /// How many are needed, at least.
        needed: usize,
    },
    /// A power is given twice.
    #[error("{component}: power {power} is given twice")]
    RepeatedPower {
        /// The component.
        component: ErrorComponent,
        /// The power.
        power: u8,
    },
    /// Knots of a table in the wrong order.
    #[error(
        "{component}: knot {index} at {} must lie above the one before, at {}",
        along(component.of, *position), along(component.of, *before)
    )]
    KnotsNotAscending {
        /// The component.
        component: ErrorComponent,
        /// Place of the knot.
        index: usize,
        /// Position of the one before, mm or rad.
        before: f64,
        /// Its position, mm or rad.
        position: f64,
    },
    /// A span that is none.
    #[error(
        "{component}: recorded span from {} to {}: must be finite and ascending",
        along(component.of, *lower), along(component.of, *upper)
    )]
    SpanNotAscending {
        /// The component.
        component: ErrorComponent,
        /// Its lower end, mm or rad.
        lower: f64,
        /// Its upper end, mm or rad.
        upper: f64,
    },
}

/// A pose for which a model gives no error.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PoseRefusal {
    /// A position is not a finite number.
    #[error("position of axis {axis} is not a finite number")]
    PositionNotFinite {
        /// The axis.
        axis: Axis,
    },
    /// The tool offset is not finite.
    #[error("tool offset along {axis} is not a finite number")]
    ToolOffsetNotFinite {
        /// The direction.
        axis: Axis,
    },
    /// The policy refuses positions outside what was recorded.
    #[error(
        "position {} of axis {axis} is outside the recorded span {} to {}",
        along(*axis, *position), along(*axis, *lower), along(*axis, *upper)
    )]
    OutOfSpan {
        /// The axis.
        axis: Axis,
        /// Its position, mm or rad.
        position: f64,
        /// Least position at which all its error motions were recorded.
        lower: f64,
        /// Greatest such position.
        upper: f64,
    },
    /// Rotary axes have turned two linear axes into one plane or line, so that they cannot reach.
    #[error("the linear axes span no volume at this pose")]
    NotReachable,
}
