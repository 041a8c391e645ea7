//! What the machine changed from run to run of a positioning test while it was compensated.
//!
//! With d̄_i(p) the mean of both directions at target p in run i:
//!
//! ```text
//!   d̄_i = a_i + b_i p,   least squares; stated: b of the first and of the last run, |b_last − b_first| span        (1)
//! ```
//!
//! A table that is not refreshed stays behind what the screw grows or shrinks. One temperature per test cannot take that out, so
//! it is in R, and R in A.

use iso230::positioning::PositioningRuns;
use metrology::Axis;

use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;
use crate::evaluate::linear::LinearTest;
use crate::section::Section;

/// Change over the span from which on it is stated, µm.
const LEAST_CHANGE_UM: f64 = 0.5;
/// Share of the repeatability from which on it is a warning.
const MOST_OF_R: f64 = 0.5;
/// What such warnings have in common.
const CHANGED: &str = "Changed during the test";

/// States the change of a compensated test whose repeatability is `repeatability_mm`.
pub(super) fn state(
    section: &mut Section,
    (test, runs): (&LinearTest, &PositioningRuns),
    (tests, budget): (&Tests, Option<&Budget>),
    repeatability_mm: Option<f64>,
) {
    let slopes = slopes(runs);
    let (Some(first), Some(last)) = (slopes.first(), slopes.last()) else {
        return;
    };
    let span_mm = runs.span_mm();
    let change_um = (last - first).abs() * span_mm * 1e3;
    if !test.compensated || change_um < LEAST_CHANGE_UM {
        return;
    }
    let mut line = format!(
        "Slope of the first run {:.1} µm/m, of the last one {:.1} µm/m: {change_um:.2} µm over {span_mm:.0} mm that changed while the compensation acted. One temperature for the test cannot take that out: it is in R and A.",
        first * 1e6,
        last * 1e6
    );
    if let Some(axis) = test.axis {
        line += &table_in_words(tests, test, axis);
        line += &screw_in_words(tests, test, (budget, axis));
    }
    let is_most = repeatability_mm.is_some_and(|r_mm| change_um > MOST_OF_R * r_mm * 1e3);
    if is_most {
        section.warn(CHANGED, line);
    } else {
        section.lines.push(line);
    }
}

/// How often the table of the axis was made anew during the test; empty where the bag has none.
fn table_in_words(tests: &Tests, test: &LinearTest, axis: Axis) -> String {
    if !tests.tables.iter().any(|table| table.axis == axis) {
        return String::new();
    }
    match tests.conditions.tables_during(&test.runs, axis) {
        0 => format!(" The table of {axis} was not refreshed during the test."),
        n => format!(" The table of {axis} was refreshed {n} times during the test."),
    }
}

/// What the thermometers of the ball screw read; empty where the budget names none.
fn screw_in_words(
    tests: &Tests,
    test: &LinearTest,
    (budget, axis): (Option<&Budget>, Axis),
) -> String {
    let names = budget.map_or(&[][..], |budget| budget.thermometers_of_screw(axis));
    let read = tests.conditions.during(&test.runs);
    let words = names.iter().filter_map(|name| {
        let (name, read) = read.get_key_value(name)?;
        Some(format!(
            " The ball screw of {axis} went from {:.2} to {:.2} °C ({name}).",
            read.first_degc, read.last_degc
        ))
    });
    words.collect()
}

/// b of (1) for each run, mm/mm.
fn slopes(runs: &PositioningRuns) -> Vec<f64> {
    let n = runs.targets_mm.len() as f64;
    let centre_mm = runs.targets_mm.iter().sum::<f64>() / n;
    let squares: f64 = { runs.targets_mm.iter() }
        .map(|at_mm| (at_mm - centre_mm).powi(2))
        .sum();
    let slope = |run: &[f64]| {
        let pairs = runs.targets_mm.iter().zip(run);
        pairs
            .map(|(at_mm, d_mm)| (at_mm - centre_mm) * d_mm)
            .sum::<f64>()
            / squares
    };
    let n_runs = runs.up_mm.len().max(runs.down_mm.len());
    let of_run = |k: usize| {
        let sides = [runs.up_mm.get(k), runs.down_mm.get(k)];
        let found: Vec<f64> = sides.into_iter().flatten().map(|run| slope(run)).collect();
        found.iter().sum::<f64>() / found.len() as f64
    };
    let all = (0..n_runs).map(of_run);
    all.filter(|slope| slope.is_finite()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_numpy_eq1_slopes_of_runs() {
        // numpy.polyfit(targets, (up + down) / 2, 1)[0] of each run.
        let runs = PositioningRuns {
            targets_mm: vec![-300.0, -110.0, 15.0, 140.0, 300.0],
            up_mm: vec![
                vec![0.0041, 0.0013, -0.0002, -0.0019, -0.0034],
                vec![0.0058, 0.0021, -0.0004, -0.0027, -0.0061],
            ],
            down_mm: vec![
                vec![0.0039, 0.0016, 0.0001, -0.0015, -0.0038],
                vec![0.0063, 0.0019, 0.0002, -0.0031, -0.0055],
            ],
            zero_mm: -300.0,
            periods_mm: vec![],
        };
        for (found, expected) in slopes(&runs)
            .into_iter()
            .zip([-1.266_617_813_918_305_5e-5, -1.974_163_199_697_428_5e-5])
        {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
