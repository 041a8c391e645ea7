//! Why a test is not evaluated.

use std::fmt;

use serde::{Deserialize, Serialize};

use metrology::Axis;
use metrology::fit::ShapeError;
use metrology::least_squares::FitError;
use metrology::number::{degrees, number, quantity};

/// Side from which a target is approached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Moving towards greater coordinates.
    Up,
    /// Moving towards lesser coordinates.
    Down,
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Up => "up",
            Self::Down => "down",
        })
    }
}

/// Why a test is not evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Iso230Error {
    /// Too few points.
    #[error("{place}: {n} points were given, at least {least} are needed")]
    TooFewPoints {
        /// Which list.
        place: &'static str,
        /// How many were given.
        n: usize,
        /// How many are needed.
        least: usize,
    },
    /// Too few runs.
    #[error("{place}: {n} runs were given, at least {least} are needed")]
    TooFewRuns {
        /// Which list.
        place: &'static str,
        /// How many were given.
        n: usize,
        /// How many are needed.
        least: usize,
    },
    /// Two lists that belong together differ in length.
    #[error("{place}[{row}] has {n} values, but {expected} belong there")]
    Lengths {
        /// Which list of lists.
        place: &'static str,
        /// Which of them, from 0.
        row: usize,
        /// Its length.
        n: usize,
        /// The length it must have.
        expected: usize,
    },
    /// A value is no number.
    #[error("{place}[{row}], value {index} is {value}: must be finite", value = number(*value))]
    NotFinite {
        /// Which list.
        place: &'static str,
        /// Which run or channel of it, from 0.
        row: usize,
        /// Which value, from 0.
        index: usize,
        /// What stood there.
        value: f64,
    },
    /// A value must be above 0.
    #[error("{place} = {value}: must be above 0", value = quantity(place, *value))]
    NotPositive {
        /// Which value; its unit ends the name.
        place: &'static str,
        /// What was given.
        value: f64,
    },
    /// A value must not be below 0.
    #[error("{place} = {value}: must be at least 0", value = quantity(place, *value))]
    Negative {
        /// Which value; its unit ends the name.
        place: &'static str,
        /// What was given.
        value: f64,
    },
    /// Values must ascend.
    #[error(
        "{place}[{index}] = {value} follows {previous}: must be greater",
        value = measured(place, *value), previous = measured(place, *previous)
    )]
    NotAscending {
        /// Which list; its unit ends the name.
        place: &'static str,
        /// Which value, from 0.
        index: usize,
        /// What stood there.
        value: f64,
        /// The value before it.
        previous: f64,
    },
    /// One target is given twice.
    #[error(
        "targets_mm[{index}] = {value_mm} mm is the target before it once more",
        value_mm = number(*value_mm)
    )]
    DuplicateTarget {
        /// Which target, from 0.
        index: usize,
        /// Its position, mm.
        value_mm: f64,
    },
    /// All runs are in one direction.
    #[error("no run {direction}: a bi-directional test needs both directions")]
    DirectionMissing {
        /// The direction without runs.
        direction: Direction,
    },
    /// Runs up and down differ in number.
    #[error("{n_up} runs up and {n_down} runs down: must be equally many")]
    RunCounts {
        /// Runs up.
        n_up: usize,
        /// Runs down.
        n_down: usize,
    },
    /// Several runs, where one is evaluated.
    #[error("{place}: {n} runs were given, where a single run is evaluated")]
    SeveralRuns {
        /// Which list.
        place: &'static str,
        /// How many were given.
        n: usize,
    },
    /// A value is outside the range that has a meaning.
    #[error(
        "{place} = {value}: must be from {lower} to {upper}",
        value = measured(place, *value), lower = measured(place, *lower), upper = measured(place, *upper)
    )]
    OutOfRange {
        /// Which value; its unit ends the name.
        place: &'static str,
        /// What was given.
        value: f64,
        /// Least value.
        lower: f64,
        /// Greatest value.
        upper: f64,
    },
    /// A recording covers too little.
    #[error(
        "{name}: {covered} are covered, {needed} are needed",
        name = without_unit(place), covered = measured(place, *covered), needed = measured(place, *needed)
    )]
    TooShort {
        /// Along what; its unit ends the name.
        place: &'static str,
        /// How much is covered.
        covered: f64,
        /// How much is needed.
        needed: f64,
    },
    /// A recording has a hole.
    #[error(
        "{name}: a gap of {gap} behind {at}, at most {limit} are allowed",
        name = without_unit(place), gap = measured(place, *gap), at = measured(place, *at), limit = measured(place, *limit)
    )]
    Gap {
        /// Along what; its unit ends the name.
        place: &'static str,
        /// Length of the gap.
        gap: f64,
        /// Where it begins.
        at: f64,
        /// The longest gap allowed.
        limit: f64,
    },
    /// Angles round a circle have a hole.
    #[error(
        "{place}: a gap of {} behind {}, at most {} are allowed: are the angles in degrees, and does the circle close?",
        degrees(*gap_rad), degrees(*at_rad), degrees(*limit_rad)
    )]
    AngularGap {
        /// Which trace.
        place: &'static str,
        /// Length of the gap, rad.
        gap_rad: f64,
        /// Where it begins, rad.
        at_rad: f64,
        /// The longest gap allowed, rad.
        limit_rad: f64,
    },
    /// The data do not tell two quantities apart.
    #[error("{place}: the {n_points} positions determine {rank} of {n_parameters} parameters")]
    NotDetermined {
        /// What was to be estimated.
        place: &'static str,
        /// Positions given.
        n_points: usize,
        /// Parameters that they determine.
        rank: usize,
        /// Parameters asked for.
        n_parameters: usize,
    },
    /// No circle was recorded.
    #[error("neither sense of rotation was recorded")]
    NoTrace,
    /// Channels of one axis do not make an angle.
    #[error("axis {axis} has {n} channels: {reason}")]
    Channels {
        /// The axis.
        axis: Axis,
        /// Its channels.
        n: usize,
        /// What is wrong.
        reason: ChannelFault,
    },
    /// A space diagonal is missing or given twice.
    #[error("space diagonal {diagonal} was given {n} times: must be once")]
    Diagonals {
        /// Which one.
        diagonal: &'static str,
        /// How often.
        n: usize,
    },
    /// A specification has no limit at all or its limits are crossed.
    #[error(
        "lower limit {} and upper limit {} specify nothing: the lower one must be below the upper one",
        limit(*lower_mm), limit(*upper_mm)
    )]
    NoZone {
        /// Lower limit, mm.
        lower_mm: Option<f64>,
        /// Upper limit, mm.
        upper_mm: Option<f64>,
    },
    /// A specification of an angle has no limit at all or its limits are crossed.
    #[error(
        "lower limit {} and upper limit {} specify nothing: the lower one must be below the upper one",
        angle(*lower_rad), angle(*upper_rad)
    )]
    NoAngularZone {
        /// Lower limit, rad.
        lower_rad: Option<f64>,
        /// Upper limit, rad.
        upper_rad: Option<f64>,
    },
    /// A shape could not be fitted.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// A fit was refused.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// A value with its unit; angles in degrees.
fn measured(place: &str, value: f64) -> String {
    if place.ends_with("_rad") {
        degrees(value)
    } else {
        quantity(place, value)
    }
}

/// What a value is of, without the unit that its name ends with.
fn without_unit(place: &'static str) -> &'static str {
    place
        .strip_suffix("_rad")
        .or_else(|| place.strip_suffix("_mm"))
        .or_else(|| place.strip_suffix("_s"))
        .unwrap_or(place)
}

fn angle(value_rad: Option<f64>) -> String {
    value_rad.map_or_else(
        || "none".to_owned(),
        |value_rad| format!("{} arcsec", number(value_rad.to_degrees() * 3600.0)),
    )
}

fn limit(value_mm: Option<f64>) -> String {
    value_mm.map_or_else(
        || "none".to_owned(),
        |value_mm| format!("{} mm", number(value_mm)),
    )
}

/// Why channels of one axis do not make an angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelFault {
    /// A rotary axis has no displacement.
    Rotary,
    /// More than two.
    TooMany,
    /// Both at one height.
    SameHeight,
    /// Two heights of the axis along which heights are counted.
    AlongHeight,
}

impl fmt::Display for ChannelFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rotary => "displacements are along X, Y or Z",
            Self::TooMany => "at most two heights make an angle",
            Self::SameHeight => "two channels at one height make no angle",
            Self::AlongHeight => "heights are along Z, so Z has one channel",
        })
    }
}
