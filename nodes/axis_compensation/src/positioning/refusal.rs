//! What the positioning part refuses, with place, value and limit.

use metrology::Axis;
use metrology::number::number;

use super::direction::Direction;

/// A table, test or loop that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each sentence names its fields with their units"
)]
pub enum PositioningRefusal {
    #[error("axis {axis}: {runs} runs, must be from {lower} to {upper}")]
    RunsOutOfRange {
        axis: Axis,
        runs: u32,
        lower: u32,
        upper: u32,
    },
    #[error("axis {axis}: {points} points, at least {least} are needed")]
    TooFewPoints {
        axis: Axis,
        points: usize,
        least: usize,
    },
    #[error(
        "axis {axis}: more than {most} points, as many as its travel has at the least distance"
    )]
    TooManyPoints { axis: Axis, most: usize },
    #[error("axis {axis}: {points} points but {deviations} deviations")]
    LengthsDiffer {
        axis: Axis,
        points: usize,
        deviations: usize,
    },
    #[error("axis {axis}: point {position_mm} mm must lie above the one before, {before_mm} mm", position_mm = number(*position_mm), before_mm = number(*before_mm))]
    NotAscending {
        axis: Axis,
        position_mm: f64,
        before_mm: f64,
    },
    #[error(
        "axis {axis}: point {position_mm} mm lies {spacing_mm} mm after the one before, must be from {lower_mm} to {upper_mm} mm", position_mm = number(*position_mm), spacing_mm = number(*spacing_mm), lower_mm = number(*lower_mm), upper_mm = number(*upper_mm))]
    SpacingOutOfRange {
        axis: Axis,
        position_mm: f64,
        spacing_mm: f64,
        lower_mm: f64,
        upper_mm: f64,
    },
    #[error("axis {axis}: a position of {position_mm} mm is no length up to 1 km", position_mm = number(*position_mm))]
    PositionNotFinite { axis: Axis, position_mm: f64 },
    #[error(
        "axis {axis}: deviation {deviation_mm} mm at {position_mm} mm must be a number up to {limit_mm} mm", position_mm = number(*position_mm), deviation_mm = number(*deviation_mm), limit_mm = number(*limit_mm))]
    DeviationOutOfRange {
        axis: Axis,
        position_mm: f64,
        deviation_mm: f64,
        limit_mm: f64,
    },
    #[error("axis {axis}: no scale reading at {position_mm} mm", position_mm = number(*position_mm))]
    ScaleMissing { axis: Axis, position_mm: f64 },
    #[error("axis {axis}: run {run} was broken off, its points are left out")]
    RunBrokenOff { axis: Axis, run: u32 },
    #[error(
        "axis {axis}: {visits} dwells at {position_mm} mm going {direction}, {expected} elsewhere in the run", position_mm = number(*position_mm))]
    RunIncomplete {
        axis: Axis,
        position_mm: f64,
        direction: Direction,
        visits: u32,
        expected: u32,
    },
    #[error("axis {axis}: no run goes {direction}, which tables apart need")]
    DirectionMissing { axis: Axis, direction: Direction },
    #[error("axis {axis}: {position_mm} mm is a point of one run but not of the others", position_mm = number(*position_mm))]
    OtherPoints { axis: Axis, position_mm: f64 },
    #[error("axes {axis} and {other} both moved from point to point, one must stand")]
    NotOneAxis { axis: Axis, other: Axis },
    #[error("axis {axis}: deviations for the way down belong to directions apart")]
    DownIsTogether { axis: Axis },
    #[error(
        "axis {axis}: gain {gain} of the measured loop, must be below {limit} with a delay of {delay_cycles} cycles", gain = number(*gain), limit = number(*limit))]
    LoopUnstable {
        axis: Axis,
        gain: f64,
        limit: f64,
        delay_cycles: u32,
    },
}
