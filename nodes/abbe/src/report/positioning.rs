//! ISO 230-2 and 230-6 of a bag.

use anyhow::Result;
use metrology::iso230::diagonal::{DiagonalResult, DiagonalRuns, DiagonalsResult, SpaceDiagonal};
use metrology::iso230::positioning::{
    PointResult, PositioningRemark, PositioningResult, PositioningRuns,
};
use metrology::iso230::{ExpandedLength, diagonal, positioning};
use metrology::sample::TestKind;

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head, um};
use crate::evaluate::budget::Budget;
use crate::evaluate::linear::{LinearTest, Reference, SETTLE};

/// A figure and, where a budget was given, its expanded uncertainty.
pub fn figure(value: &ExpandedLength, stated: bool) -> String {
    if stated {
        format!(
            "{} ± {}",
            um(value.value_mm),
            um(value.expanded_uncertainty_mm)
        )
    } else {
        um(value.value_mm)
    }
}

/// One part for each test; a test that cannot be evaluated says why.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(tests: &[LinearTest], budget: Option<&Budget>) -> Result<Vec<Section>> {
    let mut sections = Vec::new();
    for test in tests {
        sections.push(section(test, budget)?);
    }
    sections.extend(diagonals(tests, budget));
    Ok(sections)
}

fn runs(test: &LinearTest) -> PositioningRuns {
    PositioningRuns {
        targets_mm: test.targets_mm.clone(),
        up_mm: test.up_mm.clone(),
        down_mm: test.down_mm.clone(),
        zero_mm: test.targets_mm.first().copied().unwrap_or(0.0),
        periods_mm: Vec::new(),
    }
}

fn section(test: &LinearTest, budget: Option<&Budget>) -> Result<Section> {
    let what = match test.kind {
        TestKind::Diagonal => "Diagonal",
        _ => "Positioning",
    };
    let state = if test.compensated {
        "compensated"
    } else {
        "not compensated"
    };
    let by = match test.reference {
        Reference::Length => "length reference",
        Reference::Scale => "linear scale",
    };
    let mut section = Section::new(format!(
        "{what} {}, run {} on: {state}, by the {by}",
        test.name, test.first_run
    ));
    let used = budget.copied().unwrap_or(Budget::nothing()).positioning();
    match positioning::evaluate(&runs(test), &used) {
        Ok(result) => fill(&mut section, test, &result, budget.is_some())?,
        Err(error) => {
            let why = too_short(test).unwrap_or_else(|| error.to_string());
            section.lines.push(format!("Not evaluated: {why}."));
        }
    }
    Ok(section)
}

/// Why a test has no target, where its stops were too short for one.
fn too_short(test: &LinearTest) -> Option<String> {
    let longest = test.longest_rest?;
    (test.targets_mm.is_empty() && longest < SETTLE).then(|| {
        format!(
            "the command rested for {:.2} s at most, and readings of a stop count from {:.1} s on",
            longest.as_secs_f64(),
            SETTLE.as_secs_f64()
        )
    })
}

fn fill(
    section: &mut Section,
    test: &LinearTest,
    result: &PositioningResult,
    stated: bool,
) -> Result<()> {
    section.lines.push(format!(
        "{} targets from {:.3} to {:.3} mm, {} runs up and down.",
        test.targets_mm.len(),
        test.targets_mm.first().copied().unwrap_or(f64::NAN),
        test.targets_mm.last().copied().unwrap_or(f64::NAN),
        result.n_runs
    ));
    let remarks = result.remarks.iter().map(remark_in_words);
    section.lines.extend(remarks);
    section.tables.push(figures(result, stated));
    section.drawings.push(means(result)?);
    section.figures = serde_json::json!({ "test": section.title, "iso230_2": result });
    Ok(())
}

fn figures(result: &PositioningResult, stated: bool) -> Rows {
    let of = |value: &ExpandedLength| figure(value, stated);
    let row = |name: &str, up: String, down: String, both: &ExpandedLength| {
        vec![name.to_owned(), up, down, of(both)]
    };
    let dash = || "—".to_owned();
    let (up, down) = (&result.up, &result.down);
    Rows {
        head: head(&["ISO 230-2 / µm", "up", "down", "both"]),
        rows: vec![
            row(
                "accuracy A",
                of(&up.accuracy),
                of(&down.accuracy),
                &result.accuracy,
            ),
            row(
                "systematic deviation E",
                of(&up.systematic_error),
                of(&down.systematic_error),
                &result.systematic_error,
            ),
            row(
                "repeatability R",
                of(&up.repeatability),
                of(&down.repeatability),
                &result.repeatability,
            ),
            row("reversal B", dash(), dash(), &result.reversal),
            row("mean reversal", dash(), dash(), &result.mean_reversal),
            row(
                "range of means M",
                dash(),
                dash(),
                &result.mean_systematic_error,
            ),
        ],
        note: if stated {
            "± expanded uncertainty, k = 2.".to_owned()
        } else {
            "Without --budget no uncertainty is stated.".to_owned()
        },
    }
}

fn means(result: &PositioningResult) -> Result<Drawing> {
    let trace = |name: &str, value: fn(&PointResult) -> f64| Trace {
        name: name.to_owned(),
        points: result
            .points
            .iter()
            .map(|p| (p.target_mm, value(p) * 1e3))
            .collect(),
        marks: false,
    };
    Ok(Drawing {
        svg: plot::svg(&Plot {
            x: "target / mm".to_owned(),
            y: "mean deviation / µm".to_owned(),
            traces: vec![
                trace("up", |point| point.up.mean_mm),
                trace("down", |point| point.down.mean_mm),
            ],
        })?,
        caption: "Mean deviation at each target, from either side; the mean of all is taken out."
            .to_owned(),
    })
}

fn remark_in_words(remark: &PositioningRemark) -> String {
    match remark {
        PositioningRemark::FewRuns { n_runs, required } => {
            format!("{n_runs} runs in each direction; the standard asks for {required}.")
        }
        PositioningRemark::FewTargets {
            n_targets,
            required,
        } => format!("{n_targets} targets; the standard asks for {required} over this length."),
        PositioningRemark::LongAxis {
            length_mm,
            limit_mm,
        } => format!(
            "{length_mm:.0} mm are more than {limit_mm:.0} mm, for which the standard has another programme."
        ),
        PositioningRemark::EvenSpacing { interval_mm } => format!(
            "All targets are {interval_mm:.3} mm apart: a periodic error of that length is not seen."
        ),
        PositioningRemark::TargetsOnPeriod {
            period_mm,
            phase_spread_rad,
        } => format!(
            "All targets lie within {phase_spread_rad:.2} rad of one phase of the {period_mm:.3} mm period."
        ),
    }
}

/// Least share of every axis in a space diagonal.
const LEAST_SHARE: f64 = 0.1;

/// The space diagonal along which a test ran, and whether it ran it upwards.
fn space_diagonal(test: &LinearTest) -> Option<(SpaceDiagonal, bool)> {
    let along = test.direction;
    if test.kind != TestKind::Diagonal || along.iter().any(|share| share.abs() < LEAST_SHARE) {
        return None;
    }
    let positive = along.map(|share| share > 0.0);
    // A diagonal and its reverse are one: the one with at most one negative axis names it.
    let upwards = positive.iter().filter(|p| **p).count() >= 2;
    let [x, y, z] = [positive.x, positive.y, positive.z].map(|p| p == upwards);
    let diagonal = match (x, y, z) {
        (false, _, _) => SpaceDiagonal::Npp,
        (_, false, _) => SpaceDiagonal::Pnp,
        (_, _, false) => SpaceDiagonal::Ppn,
        _ => SpaceDiagonal::Ppp,
    };
    Some((diagonal, upwards))
}

/// The runs as they are upwards along the diagonal, positions counted from its lower end.
fn upwards(test: &LinearTest, is_upwards: bool) -> PositioningRuns {
    let mut runs = runs(test);
    if is_upwards {
        return runs;
    }
    let last_mm = test.targets_mm.last().copied().unwrap_or(0.0);
    runs.targets_mm = test
        .targets_mm
        .iter()
        .rev()
        .map(|at| last_mm - at)
        .collect();
    // Seen from the other end a deviation along the line is of the other sign, and up is down.
    let turned = |all: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let turn = |run: &Vec<f64>| run.iter().rev().map(|deviation| -deviation).collect();
        all.iter().map(turn).collect()
    };
    (runs.up_mm, runs.down_mm) = (turned(&test.down_mm), turned(&test.up_mm));
    runs.zero_mm = runs.targets_mm.first().copied().unwrap_or(0.0);
    runs
}

/// Deviations from the mean at the lower end, so that diagonals of one corner can be compared.
fn from_lower_end(runs: &mut PositioningRuns) {
    let all = || runs.up_mm.iter().chain(&runs.down_mm);
    let first: Vec<f64> = all().filter_map(|run| run.first().copied()).collect();
    let mean_mm = first.iter().sum::<f64>() / first.len().max(1) as f64;
    for deviation in runs.up_mm.iter_mut().chain(&mut runs.down_mm).flatten() {
        *deviation -= mean_mm;
    }
}

/// ISO 230-6, for each state in which the four space diagonals are there.
fn diagonals(tests: &[LinearTest], budget: Option<&Budget>) -> Vec<Section> {
    let mut sections = Vec::new();
    for compensated in [false, true] {
        let mut first: Vec<DiagonalRuns> = Vec::new();
        let evaluable =
            |test: &&LinearTest| test.compensated == compensated && !test.targets_mm.is_empty();
        for test in tests.iter().filter(evaluable) {
            if let Some((diagonal, is_upwards)) = space_diagonal(test)
                && first.iter().all(|known| known.diagonal != diagonal)
            {
                let mut runs = upwards(test, is_upwards);
                from_lower_end(&mut runs);
                first.push(DiagonalRuns { diagonal, runs });
            }
        }
        if first.len() == SpaceDiagonal::ALL.len() {
            sections.push(diagonals_section(&first, compensated, budget));
        }
    }
    sections
}

fn diagonals_section(runs: &[DiagonalRuns], compensated: bool, budget: Option<&Budget>) -> Section {
    let state = if compensated {
        "compensated"
    } else {
        "not compensated"
    };
    let mut section = Section::new(format!("Space diagonals, ISO 230-6: {state}"));
    let used = budget.copied().unwrap_or(Budget::nothing()).positioning();
    match diagonal::evaluate(runs, &used) {
        Ok(result) => {
            let stated = budget.is_some();
            section.lines.push(format!(
                "Systematic deviation E_d {} µm, reversal B_d {} µm; the diagonals differ by {} µm.",
                figure(&result.systematic_error, stated),
                figure(&result.reversal, stated),
                figure(&result.spread, stated)
            ));
            section.tables.push(of_diagonals(&result, stated));
            section.figures = serde_json::json!({ "test": section.title, "iso230_6": result });
        }
        Err(error) => section.lines.push(format!("Not evaluated: {error}.")),
    }
    section
}

fn of_diagonals(result: &DiagonalsResult, stated: bool) -> Rows {
    let row = |one: &DiagonalResult| {
        let (points, found) = (&one.positioning.points, &one.positioning);
        let mean = |point: Option<&PointResult>| {
            point.map_or(f64::NAN, |p| f64::midpoint(p.up.mean_mm, p.down.mean_mm))
        };
        vec![
            one.diagonal.name().to_owned(),
            um(mean(points.last()) - mean(points.first())),
            figure(&found.systematic_error, stated),
            figure(&found.reversal, stated),
            figure(&found.repeatability, stated),
            figure(&found.accuracy, stated),
        ]
    };
    Rows {
        head: head(&["diagonal / µm", "too long by", "E", "B", "R", "A"]),
        rows: result.diagonals.iter().map(row).collect(),
        note: if stated {
            "± expanded uncertainty, k = 2. All too long alike: a scale error; unlike: squareness."
        } else {
            "Without --budget no uncertainty is stated. All too long alike: a scale error; unlike: squareness."
        }
        .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::stamp::Span;
    use nalgebra::Vector3;

    fn test(direction: [f64; 3]) -> LinearTest {
        LinearTest {
            kind: TestKind::Diagonal,
            axis: None,
            name: String::new(),
            first_run: 1,
            reference: Reference::Length,
            direction: Vector3::from(direction).normalize(),
            targets_mm: vec![0.0, 100.0, 300.0],
            up_mm: vec![vec![0.0, 0.001, 0.003]],
            down_mm: vec![vec![0.002, 0.003, 0.005]],
            compensated: false,
            longest_rest: None,
        }
    }

    #[test]
    fn stops_that_were_too_short_are_told_with_their_dwell_and_the_limit() {
        let mut short = test([1.0, 0.0, 0.0]);
        short.longest_rest = Some(Span::from_nanos(200_000_000));
        short.targets_mm.clear();
        (short.up_mm, short.down_mm) = (vec![vec![]], vec![vec![]]);
        let section = &sections(&[short.clone()], None).unwrap()[0];
        let words =
            "the command rested for 0.20 s at most, and readings of a stop count from 0.3 s on";
        assert!(section.lines[0].contains(words), "{:?}", section.lines);
        short.longest_rest = Some(SETTLE);
        assert_eq!(too_short(&short), None);
    }

    #[test]
    fn a_diagonal_is_known_by_its_direction_and_not_by_its_place_in_the_plan() {
        for (direction, wanted) in [
            ([2.0, 1.0, 1.5], (SpaceDiagonal::Ppp, true)),
            ([-2.0, 1.0, 1.5], (SpaceDiagonal::Npp, true)),
            ([2.0, -1.0, 1.5], (SpaceDiagonal::Pnp, true)),
            ([2.0, 1.0, -1.5], (SpaceDiagonal::Ppn, true)),
            ([-2.0, -1.0, 1.5], (SpaceDiagonal::Ppn, false)),
            ([-2.0, -1.0, -1.5], (SpaceDiagonal::Ppp, false)),
        ] {
            assert_eq!(
                space_diagonal(&test(direction)),
                Some(wanted),
                "{direction:?}"
            );
        }
        assert_eq!(space_diagonal(&test([1.0, 1.0, 0.0])), None);
    }

    #[test]
    fn a_diagonal_that_is_run_from_its_upper_end_is_as_long_and_has_the_same_reversal() {
        let turned = upwards(&test([-1.0, -1.0, 1.0]), false);
        assert_eq!(turned.targets_mm, [0.0, 200.0, 300.0]);
        assert_eq!(turned.up_mm, [vec![-0.005, -0.003, -0.002]]);
        assert_eq!(turned.down_mm, [vec![-0.003, -0.001, -0.0]]);
        let mut levelled = turned;
        from_lower_end(&mut levelled);
        assert!((levelled.up_mm[0][0] + 0.001).abs() < 1e-12);
        assert!((levelled.down_mm[0][0] - 0.001).abs() < 1e-12);
    }
}
