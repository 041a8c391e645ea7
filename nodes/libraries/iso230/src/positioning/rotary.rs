//! Accuracy and repeatability of positioning of one rotary axis (ISO 230-2).
//!
//! # Model
//!
//! Equations (1) to (8) of [`super`] with angles for lengths. Targets count on without a wrap: 0° and 360° are two targets,
//! the second one turn behind the first. A reference and a control may wrap; a deviation is therefore the least of all
//! that differ by whole turns:
//!
//! ```text
//!   x_ij = P_ij − P_i + 2π m,   m such that −π < x_ij ≤ π                              (1)
//!   B, R↑, R: u by (2) to (5) of [`super::budget`]                                                (2)
//!   E↑, E, M, A: u by (6) to (8) there, with u_D for u_L                                           (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | P_i | `targets_rad` | rad |
//! | x_ij | `up_rad[j][i]`, `down_rad[j][i]` | rad |
//! | u_D, u_V | reference, drift of one reading | rad |
//!
//! # Holds when
//! u_D is that of the angle between two positions, as (3) has it once; where a certificate states U of one position, √2 of it
//! is meant. The reference measures the angle about the axis; its alignment and eccentricity are in its own uncertainty. The number
//! of targets asked for is that of an axis of at most one turn. A single run has B, E and M alone, as [`super::single_run`].
//!
//! # Agreement
//! By hand: `val_a_rotary_axis_by_hand`, below 1e-15 rad. Second implementation: a table of a turn that wraps by numpy,
//! `tests/validation/iso230_tables.py`, to the rounding of its table. U held E and M of 96 % of simulated machines, with u_D of
//! one position of 87 % (`tests/validation/coverage_of_u.py`; `iso230_2_u_holds_the_figures_of_a_rotary_axis`).
//!
//! # References
//! \[1\] ISO 230-2:2014; from the literature, the text was not at hand.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::budget::PositioningBudget;
use super::single_run::{self, SingleRunDirection, SingleRunResult};
use super::{LEAST_RUNS, LEAST_TARGETS, PositioningRuns, RUNS, one_sided};
use crate::budget::{DeviceUncertainty, Expansion};
use crate::extent::{
    check_ascending, check_finite, check_length, check_not_negative, check_points, check_positive,
    range,
};
use crate::{Direction, ExpandedAngle, ExpandedLength, Iso230Error};

/// Targets that the standard asks of a rotary axis, up to a travel in degrees.
pub const ROTARY_TARGETS: [(f64, usize); 3] = [(90.0, 3), (180.0, 5), (f64::INFINITY, 8)];

/// The readings of one rotary axis; a direction without runs is empty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotaryRuns {
    /// Target positions, ascending, rad.
    pub targets_rad: Vec<f64>,
    /// Deviations of each run towards greater angles, in the order of the targets, rad.
    pub up_rad: Vec<Vec<f64>>,
    /// Deviations of each run towards lesser angles, in the order of the targets (not of time), rad.
    pub down_rad: Vec<Vec<f64>>,
}

/// What is not known about the readings of a rotary axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotaryBudget {
    /// Expanded uncertainty of the reference, by its certificate, rad.
    pub expanded_uncertainty_rad: f64,
    /// Coverage factor of it.
    pub coverage_factor: f64,
    /// Range of the reading with the axis at rest, as long as a test takes, rad.
    pub environmental_drift_rad: f64,
    /// Standard deviation of a reading at rest from one moment to the next, rad; none: all drift counts as new at every
    /// reading.
    #[serde(default)]
    pub environmental_unrest_rad: Option<f64>,
}

/// One target from one side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RotaryPoint {
    /// P_i, rad.
    pub target_rad: f64,
    /// Side of the approach.
    pub direction: Direction,
    /// x̄_i↑ or x̄_i↓, rad.
    pub mean_rad: f64,
    /// s_i↑ or s_i↓, rad; `None` of a single run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_deviation_rad: Option<f64>,
}

/// The axis in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RotaryDirection {
    /// R↑ or R↓; `None` of a single run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeatability: Option<ExpandedAngle>,
    /// E↑ or E↓.
    pub systematic_error: ExpandedAngle,
    /// A↑ or A↓; `None` of a single run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<ExpandedAngle>,
}

/// What needs both directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RotaryBoth {
    /// B, the greatest reversal error without its sign.
    pub reversal: ExpandedAngle,
    /// B̄, the mean reversal error with its sign.
    pub mean_reversal: ExpandedAngle,
    /// R; `None` of a single run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeatability: Option<ExpandedAngle>,
    /// E.
    pub systematic_error: ExpandedAngle,
    /// M.
    pub mean_systematic_error: ExpandedAngle,
    /// A; `None` of a single run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<ExpandedAngle>,
}

/// What a reader of the figures must know about how they came to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RotaryRemark {
    /// Fewer runs than the standard asks.
    FewRuns {
        /// Runs per direction.
        n_runs: usize,
        /// What it asks.
        required: usize,
    },
    /// Fewer targets than the standard asks.
    FewTargets {
        /// Targets.
        n_targets: usize,
        /// What it asks over this travel.
        required: usize,
    },
}

/// The axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RotaryResult {
    /// n, runs in each direction that there is.
    pub n_runs: usize,
    /// Each target from each side.
    pub points: Vec<RotaryPoint>,
    /// Moving up; `None` without such runs.
    pub up: Option<RotaryDirection>,
    /// Moving down; `None` without such runs.
    pub down: Option<RotaryDirection>,
    /// `None` where one direction is missing.
    pub both: Option<RotaryBoth>,
    /// What is unlike the standard.
    pub remarks: Vec<RotaryRemark>,
}

/// The least of an angle's differences by whole turns, rad: (1).
#[must_use]
pub fn within_half_a_turn_rad(angle_rad: f64) -> f64 {
    let turned = (angle_rad + PI).rem_euclid(TAU) - PI;
    // The half turn itself is positive.
    if turned <= -PI { PI } else { turned }
}

/// Evaluates one rotary axis, of both sides or of the one that there is. A single run has no figure that needs scatter.
///
/// # Errors
/// No runs, one run of a side beside more of the other, fewer than two targets, targets that do not ascend, lists that do not
/// fit together, a value that is not finite, a budget with a negative entry.
pub fn evaluate(runs: &RotaryRuns, budget: &RotaryBudget) -> Result<RotaryResult, Iso230Error> {
    runs.check()?;
    budget.check()?;
    let (alike, budget) = (runs.alike(), budget.alike());
    if single_run::is_single(&alike) {
        let found = single_run::evaluate(&alike, &budget)?;
        return Ok(of_single(runs, &found));
    }
    let of = |direction| match alike.in_direction(direction) {
        [] => Ok(None),
        _ => one_sided::evaluate(&alike, direction, &budget).map(Some),
    };
    let (up, down) = (of(Direction::Up)?, of(Direction::Down)?);
    let both = match (&up, &down) {
        (Some(_), Some(_)) => Some(super::evaluate(&alike, &budget)?),
        _ => None,
    };
    let side = |found: &one_sided::OneSidedResult| RotaryDirection {
        repeatability: Some(angle(found.result.repeatability)),
        systematic_error: angle(found.result.systematic_error),
        accuracy: Some(angle(found.result.accuracy)),
    };
    let points = up.iter().chain(&down).flat_map(|found| {
        found.points.iter().map(|point| RotaryPoint {
            target_rad: point.target_mm,
            direction: found.direction,
            mean_rad: point.side.mean_mm,
            standard_deviation_rad: Some(point.side.standard_deviation_mm),
        })
    });
    let n_runs = alike.up_mm.len().max(alike.down_mm.len());
    Ok(RotaryResult {
        n_runs,
        points: points.collect(),
        both: both.map(|found| RotaryBoth {
            reversal: angle(found.reversal),
            mean_reversal: angle(found.mean_reversal),
            repeatability: Some(angle(found.repeatability)),
            systematic_error: angle(found.systematic_error),
            mean_systematic_error: angle(found.mean_systematic_error),
            accuracy: Some(angle(found.accuracy)),
        }),
        up: up.as_ref().map(side),
        down: down.as_ref().map(side),
        remarks: remarks(runs, n_runs),
    })
}

/// The figures of a single run as those of an axis.
fn of_single(runs: &RotaryRuns, found: &SingleRunResult) -> RotaryResult {
    let side = |one: SingleRunDirection| RotaryDirection {
        repeatability: None,
        systematic_error: angle(one.systematic_error),
        accuracy: None,
    };
    let of = |direction: Direction| {
        found.points.iter().filter_map(move |point| {
            let mean_rad = match direction {
                Direction::Up => point.up_mm,
                Direction::Down => point.down_mm,
            };
            Some(RotaryPoint {
                target_rad: point.target_mm,
                direction,
                mean_rad: mean_rad?,
                standard_deviation_rad: None,
            })
        })
    };
    RotaryResult {
        n_runs: found.n_runs,
        points: of(Direction::Up).chain(of(Direction::Down)).collect(),
        up: found.up.map(side),
        down: found.down.map(side),
        both: found.both.map(|both| RotaryBoth {
            reversal: angle(both.reversal),
            mean_reversal: angle(both.mean_reversal),
            repeatability: None,
            systematic_error: angle(both.systematic_error),
            mean_systematic_error: angle(both.mean_systematic_error),
            accuracy: None,
        }),
        remarks: remarks(runs, found.n_runs),
    }
}

/// A figure of (1) to (8) whose numbers were angles.
const fn angle(figure: ExpandedLength) -> ExpandedAngle {
    ExpandedAngle {
        value_rad: figure.value_mm,
        expanded_uncertainty_rad: figure.expanded_uncertainty_mm,
    }
}

fn remarks(runs: &RotaryRuns, n_runs: usize) -> Vec<RotaryRemark> {
    let travel_deg = range(runs.targets_rad.iter().copied()).to_degrees();
    // A travel of 90° may come out a last bit longer.
    let asked = ROTARY_TARGETS
        .into_iter()
        .find(|(up_to_deg, _)| travel_deg <= up_to_deg + 1e-6);
    let required = asked.map_or(0, |(_, targets)| targets);
    let n_targets = runs.targets_rad.len();
    let few_runs = (n_runs < RUNS).then_some(RotaryRemark::FewRuns {
        n_runs,
        required: RUNS,
    });
    let few_targets = (n_targets < required).then_some(RotaryRemark::FewTargets {
        n_targets,
        required,
    });
    few_runs.into_iter().chain(few_targets).collect()
}

impl RotaryRuns {
    fn check(&self) -> Result<(), Iso230Error> {
        check_points("targets_rad", self.targets_rad.len(), LEAST_TARGETS)?;
        check_finite("targets_rad", 0, &self.targets_rad)?;
        check_ascending("targets_rad", &self.targets_rad)?;
        let (n_up, n_down) = (self.up_rad.len(), self.down_rad.len());
        if n_up == 0 && n_down == 0 {
            return Err(Iso230Error::TooFewRuns {
                place: "up_rad",
                n: 0,
                least: LEAST_RUNS,
            });
        }
        for (place, rows) in [("up_rad", &self.up_rad), ("down_rad", &self.down_rad)] {
            if rows.len() == 1 && n_up.max(n_down) > 1 {
                return Err(Iso230Error::TooFewRuns {
                    place,
                    n: 1,
                    least: LEAST_RUNS,
                });
            }
            for (row, values) in rows.iter().enumerate() {
                check_length(place, row, values.len(), self.targets_rad.len())?;
                check_finite(place, row, values)?;
            }
        }
        Ok(())
    }

    /// (1) to (8) are the same for angles: numbers in rad stand where they have numbers in mm.
    fn alike(&self) -> PositioningRuns {
        let least = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let row = |row: &Vec<f64>| row.iter().copied().map(within_half_a_turn_rad).collect();
            rows.iter().map(row).collect()
        };
        PositioningRuns {
            targets_mm: self.targets_rad.clone(),
            up_mm: least(&self.up_rad),
            down_mm: least(&self.down_rad),
            zero_mm: self.targets_rad.first().copied().unwrap_or(0.0),
            periods_mm: vec![],
        }
    }
}

impl RotaryBudget {
    fn check(&self) -> Result<(), Iso230Error> {
        check_not_negative("expanded_uncertainty_rad", self.expanded_uncertainty_rad)?;
        check_positive("coverage_factor", self.coverage_factor)?;
        check_not_negative("environmental_drift_rad", self.environmental_drift_rad)?;
        let unrest_rad = self.environmental_unrest_rad.unwrap_or(0.0);
        check_not_negative("environmental_unrest_rad", unrest_rad)
    }

    /// The same in a budget of which nothing grows with the angle: (2), (3).
    const fn alike(&self) -> PositioningBudget {
        const RIGID: Expansion = Expansion {
            temperature_deviation_k: 0.0,
            temperature_half_width_k: 0.0,
            expansion_per_k: 0.0,
            expansion_half_width_per_k: 0.0,
        };
        PositioningBudget {
            device: DeviceUncertainty {
                expanded_uncertainty_mm: self.expanded_uncertainty_rad,
                expanded_uncertainty_per_length: 0.0,
                coverage_factor: self.coverage_factor,
            },
            misalignment_mm: 0.0,
            machine: RIGID,
            device_expansion: RIGID,
            environmental_drift_mm: self.environmental_drift_rad,
            environmental_unrest_mm: self.environmental_unrest_rad,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARCSEC: f64 = PI / 648_000.0;

    fn budget() -> RotaryBudget {
        RotaryBudget {
            expanded_uncertainty_rad: 0.6 * ARCSEC,
            coverage_factor: 2.0,
            environmental_drift_rad: 0.0,
            environmental_unrest_rad: None,
        }
    }

    /// Runs of 1, 2, 3 more each, five targets; downwards 8 more.
    fn runs(down: bool) -> RotaryRuns {
        let row = |run: i32, more: i32| -> Vec<f64> {
            (0..5).map(|k| f64::from(k + run + more) * ARCSEC).collect()
        };
        RotaryRuns {
            targets_rad: (0..5).map(|k| f64::from(k * 30).to_radians()).collect(),
            up_rad: (0..3).map(|run| row(run, 1)).collect(),
            down_rad: if down {
                (0..3).map(|run| row(run, 9)).collect()
            } else {
                vec![]
            },
        }
    }

    fn is_arcsec(found: ExpandedAngle, wanted: f64) {
        let arcsec = found.value_rad / ARCSEC;
        assert!((arcsec - wanted).abs() < 1e-9, "{arcsec} {wanted}");
    }

    #[test]
    fn val_a_rotary_axis_by_hand() {
        let found = evaluate(&runs(true), &budget()).unwrap();
        // Means upwards 2 to 6″, downwards 10 to 14″; every s is 1″.
        let (up, both) = (found.up.unwrap(), found.both.unwrap());
        is_arcsec(up.systematic_error, 4.0);
        is_arcsec(up.repeatability.unwrap(), 4.0);
        is_arcsec(up.accuracy.unwrap(), 8.0);
        is_arcsec(both.reversal, 8.0);
        is_arcsec(both.mean_reversal, -8.0);
        is_arcsec(both.systematic_error, 12.0);
        is_arcsec(both.mean_systematic_error, 4.0);
        is_arcsec(both.repeatability.unwrap(), 12.0);
        is_arcsec(both.accuracy.unwrap(), 16.0);
        let expanded = both.systematic_error.expanded_uncertainty_rad / ARCSEC;
        assert!((expanded - 0.6).abs() < 1e-12, "{expanded}");
        // 120° ask for 5 targets; 3 runs are fewer than 5.
        assert_eq!(
            found.remarks,
            [RotaryRemark::FewRuns {
                n_runs: 3,
                required: 5
            }]
        );
    }

    #[test]
    fn one_way_has_its_values_and_none_that_need_the_other() {
        let found = evaluate(&runs(false), &budget()).unwrap();
        assert!(found.down.is_none() && found.both.is_none());
        is_arcsec(found.up.unwrap().accuracy.unwrap(), 8.0);
        assert_eq!(found.points.len(), 5);
    }

    #[test]
    fn val_a_single_run_has_by_hand_what_needs_no_scatter() {
        let mut both_ways = runs(true);
        both_ways.up_rad.truncate(1);
        both_ways.down_rad.truncate(1);
        let found = evaluate(&both_ways, &budget()).unwrap();
        // 1 to 5″ upwards, 9 to 13″ downwards.
        let (up, both) = (found.up.unwrap(), found.both.unwrap());
        is_arcsec(up.systematic_error, 4.0);
        is_arcsec(both.reversal, 8.0);
        is_arcsec(both.mean_reversal, -8.0);
        is_arcsec(both.systematic_error, 12.0);
        is_arcsec(both.mean_systematic_error, 4.0);
        assert_eq!(
            (up.accuracy, both.accuracy, both.repeatability),
            (None, None, None)
        );
        assert_eq!((found.n_runs, found.points.len()), (1, 10));
        // The certificate is in E as it is of more runs; without a drift B has none.
        let expanded = both.systematic_error.expanded_uncertainty_rad / ARCSEC;
        assert!((expanded - 0.6).abs() < 1e-12, "{expanded}");
        both_ways.down_rad.clear();
        let found = evaluate(&both_ways, &budget()).unwrap();
        assert!(found.down.is_none() && found.both.is_none());
        is_arcsec(found.up.unwrap().systematic_error, 4.0);
    }

    #[test]
    fn eq1_a_reference_that_wraps_gives_the_deviation_of_one_that_does_not() {
        let mut wrapped = runs(true);
        for value in wrapped.up_rad.iter_mut().flatten() {
            *value -= TAU;
        }
        let (plain, found) = (runs(true), wrapped);
        let [plain, found] = [plain, found].map(|runs| evaluate(&runs, &budget()).unwrap());
        let [a, b] = [plain, found].map(|result| result.both.unwrap().reversal.value_rad);
        assert!((a - b).abs() < 1e-14, "{a} {b}");
        assert!((within_half_a_turn_rad(PI) - PI).abs() < 1e-15);
        assert!((within_half_a_turn_rad(-PI) - PI).abs() < 1e-15);
    }

    #[test]
    fn what_gives_no_figure_is_refused_with_its_place() {
        let refused = |runs: &RotaryRuns| evaluate(runs, &budget()).unwrap_err().to_string();
        let mut one_down = runs(true);
        one_down.down_rad.truncate(1);
        assert!(refused(&one_down).contains("down_rad: 1 runs"));
        let mut short = runs(true);
        short.down_rad[1].pop();
        assert!(refused(&short).contains("down_rad[1]"));
        let mut twice = runs(true);
        twice.targets_rad[1] = 0.0;
        assert!(refused(&twice).contains("targets_rad[1]"));
        let none = RotaryRuns {
            up_rad: vec![],
            ..runs(false)
        };
        assert!(refused(&none).contains("0 runs"));
    }
}
