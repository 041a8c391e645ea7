//! Trajectories that cannot or must not be run.

use metrology::Axis;
use metrology::number::{number, quantity};

/// A trajectory that cannot or must not be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum TrajectoryError {
    #[error("{key} = {value}: {rule}", value = quantity(key, *value))]
    Number {
        key: &'static str,
        value: f64,
        rule: &'static str,
    },
    #[error("axis {axis} is not in the machine file; this trajectory moves it")]
    AxisMissing { axis: Axis },
    #[error("axis = {axis}: must be X, Y or Z: this trajectory runs along a line")]
    NotLinear { axis: Axis },
    #[error("{place}: axis {axis} would go to {position_mm} mm, travel is [{least}, {greatest}]", position_mm = number(*position_mm), least = number(*least), greatest = number(*greatest))]
    OutsideTravel {
        place: &'static str,
        axis: Axis,
        position_mm: f64,
        least: f64,
        greatest: f64,
    },
    #[error("rotary axis {axis} must stand at zero, travel is [{least}, {greatest}] deg", least = number(*least), greatest = number(*greatest))]
    RotaryZeroOutside {
        axis: Axis,
        least: f64,
        greatest: f64,
    },
    #[error(
        "placement \"{placement}\": the head would be {reach_mm:.3} mm from the plate's centre, its field ends at {radius_mm} mm", radius_mm = number(*radius_mm))]
    OutsideField {
        placement: String,
        reach_mm: f64,
        radius_mm: f64,
    },
    #[error("feed {feed_mm_min} mm/min exceeds the limit of axis {axis}, {limit_mm_min} mm/min", feed_mm_min = number(*feed_mm_min), limit_mm_min = number(*limit_mm_min))]
    FeedAboveLimit {
        feed_mm_min: f64,
        axis: Axis,
        limit_mm_min: f64,
    },
    #[error(
        "radius of curvature {radius_mm} mm: feed {feed_mm_min} mm/min needs at least {needed_mm:.3} mm at an acceleration of {acceleration_mm_s2} mm/s2", radius_mm = number(*radius_mm), feed_mm_min = number(*feed_mm_min), acceleration_mm_s2 = number(*acceleration_mm_s2))]
    CurvatureTooTight {
        radius_mm: f64,
        feed_mm_min: f64,
        needed_mm: f64,
        acceleration_mm_s2: f64,
    },
    #[error(
        "overrun_mm = {overrun_mm}: must be at least {needed_mm:.1} mm, for the axis to reach {feed_mm_min} mm/min and settle before the first target", overrun_mm = number(*overrun_mm), feed_mm_min = number(*feed_mm_min))]
    OverrunTooShort {
        overrun_mm: f64,
        needed_mm: f64,
        feed_mm_min: f64,
    },
    #[error("targets[{index}] = {position_mm} mm: must be above targets[{}] = {before_mm} mm", index - 1, position_mm = number(*position_mm), before_mm = number(*before_mm))]
    TargetsNotAscending {
        index: usize,
        position_mm: f64,
        before_mm: f64,
    },
    #[error("{n} {what}: at least {least} are needed")]
    TooFew {
        what: &'static str,
        n: usize,
        least: usize,
    },
    #[error("{n} {what}: at most {greatest} are sensible")]
    TooMany {
        what: &'static str,
        n: usize,
        greatest: usize,
    },
    #[error("the machine file has no {what} \"{name}\" (known: {known})")]
    Unknown {
        what: &'static str,
        name: String,
        known: String,
    },
    #[error("beam \"{beam}\" does not run along axis {axis} alone")]
    BeamOffAxis { beam: String, axis: Axis },
}
