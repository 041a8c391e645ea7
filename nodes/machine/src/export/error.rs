//! Why a table cannot be made for a control.

use metrology::{Axis, ErrorComponent};

use super::grid::SAME;
use crate::volumetric::VolumetricError;

/// Errors that a control cannot be given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// A number that is none.
    #[error("axis {axis}: {quantity}[{index}] = {value}: must be finite")]
    NotFinite {
        /// The axis.
        axis: Axis,
        /// Which number.
        quantity: &'static str,
        /// Place in its list; 0 for a single number.
        index: usize,
        /// What it is.
        value: f64,
    },
    /// Lists that belong together differ in length.
    #[error("axis {axis}: {n} values of {quantity} for {positions} positions")]
    Lengths {
        /// The axis.
        axis: Axis,
        /// Which list.
        quantity: &'static str,
        /// Its length.
        n: usize,
        /// Number of positions.
        positions: usize,
    },
    /// Too few points for a line.
    #[error("axis {axis}: {n} points: at least {least} are needed")]
    TooFewPoints {
        /// The axis.
        axis: Axis,
        /// How many.
        n: usize,
        /// How many are needed.
        least: usize,
    },
    /// More points than the control takes.
    #[error("axis {axis}: {n} points: {control} takes at most {limit}")]
    TooManyPoints {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// How many.
        n: usize,
        /// How many it takes.
        limit: usize,
    },
    /// Positions do not ascend.
    #[error("axis {axis}: position[{index}] = {position} does not lie above {before} (mm, rad)")]
    NotAscending {
        /// The axis.
        axis: Axis,
        /// Place in the list.
        index: usize,
        /// The position, mm or rad.
        position: f64,
        /// The one before it, mm or rad.
        before: f64,
    },
    /// Unequal spacing where the control knows only one.
    #[error(
        "axis {axis}: spacing before point {index} is {spacing}, before point 1 {first}: {control} needs equal spacing (mm, rad)"
    )]
    UnequalSpacing {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// The point after the interval that differs.
        index: usize,
        /// Its spacing, mm or rad.
        spacing: f64,
        /// The first spacing, mm or rad.
        first: f64,
    },
    /// A spacing that is no spacing.
    #[error("axis {axis}: spacing {spacing}: must be a finite number above {least:e} (mm, rad)", least = SAME)]
    Spacing {
        /// The axis.
        axis: Axis,
        /// The spacing, mm or rad.
        spacing: f64,
    },
    /// A point outside the travel.
    #[error("axis {axis}: point at {position}: travel is [{least}, {greatest}] (mm, rad)")]
    OutsideTravel {
        /// The axis.
        axis: Axis,
        /// The point, mm or rad.
        position: f64,
        /// Least position, mm or rad.
        least: f64,
        /// Greatest position, mm or rad.
        greatest: f64,
    },
    /// A point where nothing was measured.
    #[error(
        "axis {axis}: point at {position}: measured is [{least}, {greatest}], nothing is extrapolated (mm, rad)"
    )]
    OutsideMeasured {
        /// The axis.
        axis: Axis,
        /// The point, mm or rad.
        position: f64,
        /// Least measured position, mm or rad.
        least: f64,
        /// Greatest measured position, mm or rad.
        greatest: f64,
    },
    /// A value beyond what the control takes.
    #[error(
        "axis {axis}: value {value} {unit} at {position}: {control} takes at most {limit} {unit}"
    )]
    BeyondLimit {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// Where, in the unit of the axis (mm, rad).
        position: f64,
        /// The value.
        value: f64,
        /// The greatest size it takes.
        limit: f64,
        /// Unit of both.
        unit: &'static str,
    },
    /// The value at the reference point is not zero.
    #[error(
        "axis {axis}: error {error} at the reference point {reference}: {control} needs zero there, or the axis jumps when it is referenced (mm, rad)"
    )]
    ReferenceNotZero {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// Reference point, mm or rad.
        reference: f64,
        /// Error there, mm or rad.
        error: f64,
    },
    /// The reference point is not one of the points.
    #[error(
        "axis {axis}: point at {position} is not a whole number of spacings {spacing} from the reference point {reference}: {control} counts from there (mm, rad)"
    )]
    OffReference {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// The point, mm or rad.
        position: f64,
        /// Spacing, mm or rad.
        spacing: f64,
        /// Reference point, mm or rad.
        reference: f64,
    },
    /// The two directions differ and the control has one table.
    #[error(
        "axis {axis}: errors up and down differ by {difference} at {position}: {control} has one table for both, choose their mean or another table (mm, rad)"
    )]
    DirectionDependent {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// Where, mm or rad.
        position: f64,
        /// Up minus down, mm or rad.
        difference: f64,
    },
    /// Columns of one table stand at different positions.
    #[error("axis {axis}: column of {component} stands at other positions than the first column")]
    DifferentPositions {
        /// The axis.
        axis: Axis,
        /// The column's first part.
        component: ErrorComponent,
    },
    /// The recordings do not determine a coefficient by itself.
    #[error(
        "{component}: coefficient {index} is not estimable by itself, so the component has no value of its own"
    )]
    NotEstimable {
        /// The component.
        component: ErrorComponent,
        /// Place among its coefficients.
        index: usize,
    },
    /// The model has no such component.
    #[error("{component}: the model does not have it")]
    MissingComponent {
        /// The component.
        component: ErrorComponent,
    },
    /// No component was asked for.
    #[error("axis {base}: no component in direction {direction} was named")]
    NoComponent {
        /// The axis on whose position the error depends.
        base: Axis,
        /// Direction of the error.
        direction: Axis,
    },
    /// The component does not act that way.
    #[error("{component} has no effect in direction {direction} as a function of axis {base}")]
    NoEffect {
        /// The component.
        component: ErrorComponent,
        /// The axis on whose position the error would depend.
        base: Axis,
        /// Direction of the error.
        direction: Axis,
    },
    /// A curve that is none.
    #[error("{source}")]
    Curve {
        /// What is wrong with it.
        #[from]
        source: VolumetricError,
    },
    /// A curve that no table can take.
    #[error("{component}: {rule}")]
    Malformed {
        /// The component.
        component: ErrorComponent,
        /// What holds for it.
        rule: &'static str,
    },
    /// A number of the control's set-up that is out of range.
    #[error("{control}: {quantity} = {value}: {rule}")]
    Setting {
        /// Control and kind of table.
        control: &'static str,
        /// Which number.
        quantity: &'static str,
        /// What it is.
        value: f64,
        /// What holds for it.
        rule: &'static str,
    },
    /// A name that the control cannot have.
    #[error(
        "{control}: name \"{name}\": must begin with a letter and have letters, digits and _ only"
    )]
    Name {
        /// Control and kind of table.
        control: &'static str,
        /// The name.
        name: String,
    },
    /// The control takes no rotary or no linear axis here.
    #[error("axis {axis}: {control} is made for linear axes only")]
    NotLinear {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
    },
    /// A part of the drift model could not be estimated.
    #[error("axis {axis}: the {part} of the thermal drift is not identifiable")]
    DriftNotIdentifiable {
        /// The axis.
        axis: Axis,
        /// `offset` or `slope`.
        part: &'static str,
    },
    /// The model waits for a second measurement.
    #[error(
        "axis {axis}: the thermal model is in quarantine until a second measurement confirms it"
    )]
    Quarantined {
        /// The axis.
        axis: Axis,
    },
    /// The drift depends on other axes, which the control's parameters cannot say.
    #[error(
        "axis {axis}: its drift changes with axis {other} by {slope}: {control} knows the own position only (mm/mm)"
    )]
    DriftOfOtherAxis {
        /// Control and kind of parameters.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// The other axis.
        other: Axis,
        /// Change with it, mm/mm.
        slope: f64,
    },
}
