//! Positioning by approaches from one side alone (ISO 230-2): A↑, E↑ and R↑, or those downwards.
//!
//! Equations (1), (3), (4), (5), (7) and (8) of [`super`] for that side. Reversal B, and what is made of both sides (A, E,
//! R, M without an arrow), do not exist for such a test.

use serde::Serialize;

use super::budget::{PositioningBudget, PositioningContributions};
use super::{
    DirectionResult, PointDirection, PositioningRemark, PositioningRuns, direction, side, spacing,
};
use crate::{Direction, Iso230Error};

/// One target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OneSidedPoint {
    /// P_i, mm.
    pub target_mm: f64,
    /// What was found there.
    #[serde(flatten)]
    pub side: PointDirection,
}

/// The axis from one side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OneSidedResult {
    /// The side.
    pub direction: Direction,
    /// n, runs.
    pub n_runs: usize,
    /// Each target, ascending.
    pub points: Vec<OneSidedPoint>,
    /// A, E and R of that side.
    pub result: DirectionResult,
    /// Standard uncertainties over the measured length.
    pub contributions: PositioningContributions,
    /// What is unlike the standard.
    pub remarks: Vec<PositioningRemark>,
}

/// Evaluates one axis from one side; runs of the other side are not looked at.
///
/// # Errors
/// As [`super::evaluate`], of that side alone.
pub fn evaluate(
    runs: &PositioningRuns,
    towards: Direction,
    budget: &PositioningBudget,
) -> Result<OneSidedResult, Iso230Error> {
    runs.check_targets()?;
    runs.check_direction(towards)?;
    budget.check()?;
    let rows = runs.in_direction(towards);
    let point = |(i, target_mm): (usize, &f64)| {
        let length_mm = target_mm - runs.zero_mm;
        let u_length_mm = budget.over(length_mm, runs.span_mm()).length_part_mm();
        OneSidedPoint {
            target_mm: *target_mm,
            side: side(rows, i, u_length_mm),
        }
    };
    let points: Vec<OneSidedPoint> = runs.targets_mm.iter().enumerate().map(point).collect();
    let span_mm = runs.span_mm();
    let u = |length_mm: f64| {
        budget
            .over(length_mm, span_mm)
            .figures(rows.len(), points.len())
    };
    // The remarks count runs of the side that there is.
    let counted = PositioningRuns {
        up_mm: rows.to_vec(),
        down_mm: rows.to_vec(),
        ..runs.clone()
    };
    Ok(OneSidedResult {
        direction: towards,
        n_runs: rows.len(),
        result: direction(points.iter().map(|point| (point.target_mm, point.side)), &u),
        points,
        contributions: budget.over(span_mm, span_mm),
        remarks: spacing::remarks(&counted),
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::evaluate as evaluate_both;
    use super::*;
    use crate::budget::{DeviceUncertainty, Expansion};

    fn runs(down: bool) -> PositioningRuns {
        let up_mm = vec![
            vec![0.001, 0.003, 0.002],
            vec![0.002, 0.003, 0.004],
            vec![0.0, 0.006, 0.003],
        ];
        PositioningRuns {
            targets_mm: vec![0.0, 17.0, 40.0],
            down_mm: if down { up_mm.clone() } else { vec![] },
            up_mm,
            zero_mm: 0.0,
            periods_mm: vec![],
        }
    }

    /// A budget with a share of every kind.
    pub(in super::super) fn budget() -> PositioningBudget {
        let body = Expansion {
            temperature_deviation_k: 0.5,
            temperature_half_width_k: 0.2,
            expansion_per_k: 11e-6,
            expansion_half_width_per_k: 1e-6,
        };
        PositioningBudget {
            device: DeviceUncertainty {
                expanded_uncertainty_mm: 1e-4,
                expanded_uncertainty_per_length: 1e-6,
                coverage_factor: 2.0,
            },
            misalignment_mm: 0.1,
            machine: body,
            device_expansion: body,
            environmental_drift_mm: 1e-4,
            environmental_unrest_mm: None,
        }
    }

    #[test]
    fn val_one_side_by_hand() {
        let found = evaluate(&runs(false), Direction::Up, &budget()).unwrap();
        // Means 1, 4, 3 µm; s = 1, sqrt(3), 1 µm.
        let root3 = 3.0_f64.sqrt();
        let (e_um, r_um) = (3.0, 4.0 * root3);
        let a_um = (4.0 + 2.0 * root3) - (1.0 - 2.0);
        let result = &found.result;
        for (value, wanted_um) in [
            (result.systematic_error.value_mm, e_um),
            (result.repeatability.value_mm, r_um),
            (result.accuracy.value_mm, a_um),
        ] {
            assert!(
                (value * 1e3 - wanted_um).abs() < 1e-12,
                "{value} {wanted_um}"
            );
        }
        assert_eq!(found.n_runs, 3);
    }

    #[test]
    fn one_side_has_the_values_that_it_has_in_a_test_of_both() {
        let both = evaluate_both(&runs(true), &budget()).unwrap();
        let one = evaluate(&runs(false), Direction::Up, &budget()).unwrap();
        assert_eq!(one.result, both.up);
        for (point, of_both) in one.points.iter().zip(&both.points) {
            assert_eq!(point.side, of_both.up);
        }
        assert_eq!(one.remarks, both.remarks);
        let missing = evaluate(&runs(false), Direction::Down, &budget()).unwrap_err();
        assert!(missing.to_string().contains("no run down"), "{missing}");
    }
}
