//! Why a table cannot be made for a control.

use metrology::number::{along, number};
use metrology::{Axis, ErrorComponent};

use machine::volumetric::VolumetricError;

/// Errors that a control cannot be given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// A number that is none.
    #[error("axis {axis}: {quantity}[{index}] = {value}: must be finite", value = number(*value))]
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
    #[error(
        "axis {axis}: position[{index}] = {} does not lie above {}",
        along(*axis, *position), along(*axis, *before)
    )]
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
        "axis {axis}: spacing before point {index} is {}, before point 1 {}: {control} needs equal spacing",
        along(*axis, *spacing), along(*axis, *first)
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
    #[error(
        "axis {axis}: spacing {}: must be a finite number above {}",
        along(*axis, *spacing), along(*axis, *least)
    )]
    Spacing {
        /// The axis.
        axis: Axis,
        /// The spacing, mm or rad.
        spacing: f64,
        /// The spacing that it must be above, mm or rad.
        least: f64,
    },
    /// A point outside the travel.
    #[error(
        "axis {axis}: point at {}: the travel is from {} to {}",
        along(*axis, *position), along(*axis, *least), along(*axis, *greatest)
    )]
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
        "axis {axis}: point at {}: measured from {} to {}, nothing is extrapolated",
        along(*axis, *position), along(*axis, *least), along(*axis, *greatest)
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
    /// An error that no machine has.
    #[error(
        "axis {axis}: error {} in direction {direction} at {}: at most {} is an error of a machine: \
         look for an outlier or another unit in the readings there, and measure again",
        along(*direction, *error), along(*axis, *position), along(*direction, *limit)
    )]
    Implausible {
        /// The axis.
        axis: Axis,
        /// Direction of the error.
        direction: Axis,
        /// Where, mm or rad.
        position: f64,
        /// The error, mm or rad.
        error: f64,
        /// Its greatest size, mm or rad.
        limit: f64,
    },
    /// An error that changes so much between neighbours that it is one of the recording.
    #[error(
        "axis {axis}: the error in direction {direction} changes by {} between the points {} and {}: at most {} (1/64 of the way): \
         look for an outlier in the readings there, measure again, or take a greater spacing",
        along(*direction, *change), along(*axis, *from), along(*axis, *to), along(*direction, *limit)
    )]
    TooSteep {
        /// The axis.
        axis: Axis,
        /// Direction of the error.
        direction: Axis,
        /// Change of the error, mm or rad.
        change: f64,
        /// One point, mm or rad.
        from: f64,
        /// The next, mm or rad.
        to: f64,
        /// The greatest size of the change, mm or rad.
        limit: f64,
    },
    /// A value beyond what the control takes.
    #[error(
        "axis {axis}: value {} {unit} at {}: {control} takes at most {} {unit}",
        number(*value), along(*axis, *position), number(*limit)
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
        "axis {axis}: error {} at the reference point {}: {control} needs zero there, or the axis jumps when it is referenced",
        along(*axis, *error), along(*axis, *reference)
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
        "axis {axis}: point at {} is not a whole number of spacings of {} from the reference point {}: {control} counts from there",
        along(*axis, *position), along(*axis, *spacing), along(*axis, *reference)
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
        "axis {axis}: errors up and down differ by {} at {}: {control} has one table for both, choose their mean or another table",
        along(*axis, *difference), along(*axis, *position)
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
    /// An invalid curve.
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
    #[error("{control}: {quantity} = {value}: {rule}", value = metrology::number::quantity(quantity, *value))]
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
    /// Nobody knows which way a positive value moves the axis.
    #[error(
        "{control}: no manual seen says which way a positive value moves the axis, and a wrong sign doubles every error: \
         nothing is written without --sign plus|minus. To find it: {check}"
    )]
    SignUnproven {
        /// Control and kind of table.
        control: &'static str,
        /// One step at the machine that shows the sign.
        check: &'static str,
    },
    /// A point's number that another axis has.
    #[error(
        "axis {axis}: point number {number} is one of axis {other}: {control} has one list for all axes; \
         give another number of the reference point (--reference-number {axis}=...)"
    )]
    NumberTaken {
        /// Control and kind of table.
        control: &'static str,
        /// The axis.
        axis: Axis,
        /// The number.
        number: i64,
        /// Whose it is.
        other: Axis,
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
        "axis {axis}: its drift changes with axis {other} by {} mm/mm: {control} knows the own position only",
        number(*slope)
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
