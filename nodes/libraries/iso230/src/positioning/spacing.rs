//! What the standard would have asked of the targets and runs of a positioning test.
//!
//! Targets at P_i = (i − 1) p + r with another r at each target see a periodic error at many
//! phases. Targets at multiples of its period all see the same phase: the error then looks like a
//! constant, and nothing in the figures shows it.

use std::f64::consts::TAU;

use serde::Serialize;

use super::PositioningRuns;
use crate::extent::greatest;

/// Runs per direction that the standard asks of an axis of up to 2 m.
pub const RUNS: usize = 5;
/// Targets that it asks, at least and on each metre.
pub const TARGETS: usize = 5;
/// Travel above which the standard has another programme, mm.
pub const LONG_AXIS_MM: f64 = 2000.0;
/// Mean interval of the targets in that programme, mm.
pub const LONG_AXIS_INTERVAL_MM: f64 = 250.0;
/// Phases that differ by less than this share of a period count as one.
pub const SAME_PHASE: f64 = 0.05;
/// Intervals that differ by less than this share count as equal.
pub const SAME_INTERVAL: f64 = 0.01;

/// What a reader of the figures must know about how they came to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum PositioningRemark {
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
        /// What it asks over this length.
        required: usize,
    },
    /// Over this length the standard has another programme.
    LongAxis {
        /// Measured length, mm.
        length_mm: f64,
        /// Where the programme of this test ends, mm.
        limit_mm: f64,
    },
    /// All intervals are equal: an error of that period, or of a whole fraction of it, is not seen.
    EvenSpacing {
        /// The interval, mm.
        interval_mm: f64,
    },
    /// All targets see one phase of a period of the axis, or of half of it.
    TargetsOnPeriod {
        /// The period, mm.
        period_mm: f64,
        /// The farthest that a target is from the first one's phase, rad.
        phase_spread_rad: f64,
    },
}

/// Everything that is unlike the standard.
pub(super) fn remarks(runs: &PositioningRuns) -> Vec<PositioningRemark> {
    let (n_runs, n_targets) = (runs.up_mm.len(), runs.targets_mm.len());
    let length_mm = runs.span_mm();
    let mut remarks = Vec::new();
    // The other programme of a long axis is content with one run, but one run has no scatter.
    if n_runs < RUNS && length_mm <= LONG_AXIS_MM {
        remarks.push(PositioningRemark::FewRuns {
            n_runs,
            required: RUNS,
        });
    }
    let required = targets_for(length_mm);
    if n_targets < required {
        remarks.push(PositioningRemark::FewTargets {
            n_targets,
            required,
        });
    }
    if length_mm > LONG_AXIS_MM {
        remarks.push(PositioningRemark::LongAxis {
            length_mm,
            limit_mm: LONG_AXIS_MM,
        });
    }
    let interval_mm = length_mm / (n_targets as f64 - 1.0);
    let uneven = |pair: &[f64]| match pair {
        [a, b] => ((b - a) / interval_mm - 1.0).abs(),
        _ => 0.0,
    };
    if greatest(runs.targets_mm.windows(2).map(uneven)) < SAME_INTERVAL {
        remarks.push(PositioningRemark::EvenSpacing { interval_mm });
    }
    for period_mm in runs.periods_mm.iter().flat_map(|p| [*p, p / 2.0]) {
        let phase_spread_rad = phase_spread_rad(&runs.targets_mm, period_mm);
        if phase_spread_rad < SAME_PHASE * TAU {
            remarks.push(PositioningRemark::TargetsOnPeriod {
                period_mm,
                phase_spread_rad,
            });
        }
    }
    remarks
}

/// Targets that the standard asks over a length.
fn targets_for(length_mm: f64) -> usize {
    let on_length = if length_mm > LONG_AXIS_MM {
        length_mm / LONG_AXIS_INTERVAL_MM
    } else {
        TARGETS as f64 * length_mm / 1000.0
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a span is above 0; the cast saturates"
    )]
    TARGETS.max(on_length.ceil() as usize)
}

/// How far the phases of the targets are from the first one's, at most, rad.
fn phase_spread_rad(targets_mm: &[f64], period_mm: f64) -> f64 {
    let from_first = |target: &f64| {
        let turns = (target - targets_mm[0]) / period_mm;
        (turns - turns.round()).abs() * TAU
    };
    greatest(targets_mm.iter().map(from_first))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(targets_mm: &[f64], n_runs: usize, periods_mm: &[f64]) -> PositioningRuns {
        let row = vec![0.0; targets_mm.len()];
        PositioningRuns {
            targets_mm: targets_mm.to_vec(),
            up_mm: vec![row.clone(); n_runs],
            down_mm: vec![row; n_runs],
            zero_mm: 0.0,
            periods_mm: periods_mm.to_vec(),
        }
    }

    #[test]
    fn uneven_targets_and_five_runs_leave_nothing_to_say() {
        let targets = [3.1, 104.7, 196.2, 301.9, 407.3];
        assert_eq!(remarks(&runs(&targets, 5, &[10.0])), []);
    }

    #[test]
    fn targets_on_a_period_or_on_half_of_it_are_named() {
        let targets = [0.0, 105.0, 200.0, 305.0, 410.0];
        let found = remarks(&runs(&targets, 5, &[10.0]));
        assert!(
            matches!(
                found[..],
                [PositioningRemark::TargetsOnPeriod { period_mm, .. }] if (period_mm - 5.0).abs() < 1e-12
            ),
            "{found:?}"
        );
        let found = remarks(&runs(&[0.0, 100.0, 200.0, 300.0, 400.0], 5, &[10.0]));
        assert!(
            matches!(
                found[..],
                [
                    PositioningRemark::EvenSpacing { interval_mm: 100.0 },
                    PositioningRemark::TargetsOnPeriod { .. },
                    PositioningRemark::TargetsOnPeriod { .. }
                ]
            ),
            "{found:?}"
        );
    }

    #[test]
    fn too_few_runs_and_targets_are_counted() {
        let found = remarks(&runs(&[1.0, 407.0, 1300.0], 3, &[]));
        assert_eq!(
            found,
            [
                PositioningRemark::FewRuns {
                    n_runs: 3,
                    required: 5
                },
                PositioningRemark::FewTargets {
                    n_targets: 3,
                    required: 7
                }
            ]
        );
        let found = remarks(&runs(&[0.0, 900.0, 3000.0], 2, &[]));
        assert_eq!(
            found,
            [
                PositioningRemark::FewTargets {
                    n_targets: 3,
                    required: 12
                },
                PositioningRemark::LongAxis {
                    length_mm: 3000.0,
                    limit_mm: 2000.0
                }
            ]
        );
    }
}
