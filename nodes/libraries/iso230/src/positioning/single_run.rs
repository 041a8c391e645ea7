//! Positioning by a single run, up and down or from one side (ISO 230-2): what needs no scatter.
//!
//! Equations (1), (2), (5) and (6) of [`super`] with n = 1, so that each mean deviation is the reading itself. One run has no
//! standard deviation: R, A and the intervals of the means do not exist, and what stands in E, B and M of the scatter of single
//! readings is not known.

use serde::Serialize;

use super::budget::{FigureUncertainties, PositioningBudget, PositioningContributions};
use super::{PositioningRemark, PositioningRuns, between, spacing};
use crate::extent::{check_finite, check_length, greatest, mean};
use crate::{Direction, ExpandedLength, Iso230Error};

/// One target; what the side that was not approached would have is not there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SingleRunPoint {
    /// P_i, mm.
    pub target_mm: f64,
    /// The deviation upwards, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_mm: Option<f64>,
    /// The deviation downwards, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub down_mm: Option<f64>,
}

/// One direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SingleRunDirection {
    /// E↑ or E↓.
    pub systematic_error: ExpandedLength,
}

/// What both directions say together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SingleRunBoth {
    /// B, the greatest reversal error without its sign.
    pub reversal: ExpandedLength,
    /// B̄, the mean reversal error with its sign.
    pub mean_reversal: ExpandedLength,
    /// E, bi-directional.
    pub systematic_error: ExpandedLength,
    /// M, range of the mean bi-directional deviations.
    pub mean_systematic_error: ExpandedLength,
}

/// The axis by one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SingleRunResult {
    /// n, which is 1.
    pub n_runs: usize,
    /// Each target, ascending.
    pub points: Vec<SingleRunPoint>,
    /// Moving up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<SingleRunDirection>,
    /// Moving down.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub down: Option<SingleRunDirection>,
    /// Of both directions.
    #[serde(flatten)]
    pub both: Option<SingleRunBoth>,
    /// Standard uncertainties over the measured length.
    pub contributions: PositioningContributions,
    /// What is unlike the standard.
    pub remarks: Vec<PositioningRemark>,
}

/// Whether a test has one run: one of each side that was approached.
#[must_use]
pub fn is_single(runs: &PositioningRuns) -> bool {
    let [up, down] = [runs.up_mm.len(), runs.down_mm.len()];
    up.max(down) == 1
}

/// Evaluates one axis by a single run.
///
/// # Errors
/// No run, more than one run of a side, fewer than two targets, targets that do not ascend, lists that do not fit together, a
/// number that is not finite, a budget with a negative entry.
pub fn evaluate(
    runs: &PositioningRuns,
    budget: &PositioningBudget,
) -> Result<SingleRunResult, Iso230Error> {
    runs.check_targets()?;
    budget.check()?;
    let [up, down] = [Direction::Up, Direction::Down].map(|side| the_run(runs, side));
    let (up, down) = (up?, down?);
    if up.is_none() && down.is_none() {
        let direction = Direction::Up;
        return Err(Iso230Error::DirectionMissing { direction });
    }
    let span_mm = runs.span_mm();
    // No figure of a single run is made of standard deviations.
    let u = |length_mm: f64| budget.over(length_mm, span_mm).figures(1, 1);
    let one_way = |run: Option<&[f64]>| {
        run.map(|run| SingleRunDirection {
            systematic_error: systematic(&runs.targets_mm, &[run], &u),
        })
    };
    let at = |run: Option<&[f64]>, i: usize| run.and_then(|run| run.get(i)).copied();
    let targets = runs.targets_mm.iter().enumerate();
    let points = targets.map(|(i, target_mm)| SingleRunPoint {
        target_mm: *target_mm,
        up_mm: at(up, i),
        down_mm: at(down, i),
    });
    Ok(SingleRunResult {
        n_runs: 1,
        points: points.collect(),
        up: one_way(up),
        down: one_way(down),
        both: up.zip(down).map(|sides| both(&runs.targets_mm, sides, &u)),
        contributions: budget.over(span_mm, span_mm),
        remarks: spacing::remarks(&PositioningRuns {
            up_mm: up.or(down).map(<[f64]>::to_vec).into_iter().collect(),
            ..runs.clone()
        }),
    })
}

/// The run of a side, if there is one.
fn the_run(runs: &PositioningRuns, side: Direction) -> Result<Option<&[f64]>, Iso230Error> {
    let place = match side {
        Direction::Up => "up_mm",
        Direction::Down => "down_mm",
    };
    let rows = runs.in_direction(side);
    if rows.len() > 1 {
        let n = rows.len();
        return Err(Iso230Error::SeveralRuns { place, n });
    }
    let Some(row) = rows.first() else {
        return Ok(None);
    };
    check_length(place, 0, row.len(), runs.targets_mm.len())?;
    check_finite(place, 0, row)?;
    Ok(Some(row))
}

/// (2), (5) and (6) of a run up and its run down.
fn both(
    targets_mm: &[f64],
    (up, down): (&[f64], &[f64]),
    u: &impl Fn(f64) -> FigureUncertainties,
) -> SingleRunBoth {
    let pairs = || up.iter().zip(down);
    let reversals: Vec<f64> = pairs().map(|(up, down)| up - down).collect();
    let means: Vec<f64> = pairs()
        .map(|(up, down)| f64::midpoint(*up, *down))
        .collect();
    let of_means = range_of(targets_mm, &[&means]);
    let u_reversal_mm = u(0.0).reversal_mm();
    let greatest_mm = greatest(reversals.iter().map(|b| b.abs()));
    SingleRunBoth {
        reversal: ExpandedLength::new(greatest_mm, u_reversal_mm),
        mean_reversal: ExpandedLength::new(mean(&reversals), u_reversal_mm),
        systematic_error: systematic(targets_mm, &[up, down], u),
        mean_systematic_error: ExpandedLength::new(
            of_means[0],
            u(of_means[1]).mean_systematic_mm(),
        ),
    }
}

/// (5) of one or both directions.
fn systematic(
    targets_mm: &[f64],
    sides: &[&[f64]],
    u: &impl Fn(f64) -> FigureUncertainties,
) -> ExpandedLength {
    let [range_mm, apart_mm] = range_of(targets_mm, sides);
    ExpandedLength::new(range_mm, u(apart_mm).systematic_mm())
}

/// Range of values at the targets, and the distance of the places of its ends, mm.
fn range_of(targets_mm: &[f64], sides: &[&[f64]]) -> [f64; 2] {
    let all = sides
        .iter()
        .flat_map(|values| targets_mm.iter().zip(*values));
    let found = between(all.map(|(target_mm, value_mm)| [*target_mm, *value_mm, *value_mm, 0.0]));
    [found.range_mm, found.apart_mm]
}

#[cfg(test)]
mod tests {
    use super::super::evaluate as evaluate_runs;
    use super::super::one_sided::tests::budget;
    use super::*;

    fn runs(n: usize) -> PositioningRuns {
        PositioningRuns {
            targets_mm: vec![0.0, 17.0, 40.0, 71.0],
            up_mm: vec![vec![0.001, 0.004, 0.002, -0.001]; n],
            down_mm: vec![vec![0.003, 0.005, 0.005, 0.0]; n],
            zero_mm: 0.0,
            periods_mm: vec![],
        }
    }

    #[test]
    fn val_a_single_run_by_hand() {
        let found = evaluate(&runs(1), &budget()).unwrap();
        let both = found.both.unwrap();
        // B_i -2, -1, -3, -1 um; means 2, 4.5, 3.5, -0.5 um; all readings from -1 to 5 um.
        for (value, wanted_um) in [
            (found.up.unwrap().systematic_error, 5.0),
            (found.down.unwrap().systematic_error, 5.0),
            (both.reversal, 3.0),
            (both.mean_reversal, -1.75),
            (both.systematic_error, 6.0),
            (both.mean_systematic_error, 5.0),
        ] {
            let found_um = value.value_mm * 1e3;
            assert!(
                (found_um - wanted_um).abs() < 1e-12,
                "{found_um} {wanted_um}"
            );
        }
        let few = PositioningRemark::FewRuns {
            n_runs: 1,
            required: spacing::RUNS,
        };
        assert!(found.remarks.contains(&few), "{:?}", found.remarks);
    }

    #[test]
    fn equal_runs_have_the_figures_of_one_and_a_smaller_uncertainty_by_drift() {
        let one = evaluate(&runs(1), &budget()).unwrap();
        let of_one = one.both.unwrap();
        let two = evaluate_runs(&runs(2), &budget()).unwrap();
        for (one, two) in [
            (of_one.reversal, two.reversal),
            (of_one.mean_reversal, two.mean_reversal),
            (of_one.systematic_error, two.systematic_error),
            (of_one.mean_systematic_error, two.mean_systematic_error),
            (one.up.unwrap().systematic_error, two.up.systematic_error),
            (
                one.down.unwrap().systematic_error,
                two.down.systematic_error,
            ),
        ] {
            assert!((one.value_mm - two.value_mm).abs() < 1e-15);
            assert!(one.expanded_uncertainty_mm > two.expanded_uncertainty_mm);
        }
    }

    #[test]
    fn one_side_has_its_e_and_nothing_of_both() {
        let mut one_sided = runs(1);
        one_sided.up_mm.clear();
        let found = evaluate(&one_sided, &budget()).unwrap();
        let whole = evaluate(&runs(1), &budget()).unwrap();
        assert_eq!((found.up, found.both), (None, None));
        assert_eq!(found.down, whole.down);
        assert_eq!(found.points[2].up_mm, None);
        one_sided.down_mm.clear();
        assert!(!is_single(&one_sided));
        let said = evaluate(&one_sided, &budget()).unwrap_err().to_string();
        assert!(said.contains("no run up"), "{said}");
        let said = evaluate(&runs(2), &budget()).unwrap_err().to_string();
        assert!(said.starts_with("up_mm: 2 runs were given"), "{said}");
        let mut short = runs(1);
        short.down_mm[0].pop();
        let said = evaluate(&short, &budget()).unwrap_err().to_string();
        assert!(said.starts_with("down_mm[0] has 3 values"), "{said}");
    }
}
