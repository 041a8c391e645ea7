//! ISO 230-2 and 230-6 of a bag.

use anyhow::Result;
use metrology::iso230::diagonal::{DiagonalRuns, SpaceDiagonal};
use metrology::iso230::positioning::{
    PointResult, PositioningRemark, PositioningResult, PositioningRuns,
};
use metrology::iso230::{ExpandedLength, diagonal, positioning};
use metrology::sample::TestKind;

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head, um};
use crate::evaluate::budget::Budget;
use crate::evaluate::linear::{LinearTest, Reference};

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
        Err(error) => section.lines.push(format!("Not evaluated: {error}.")),
    }
    Ok(section)
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

/// ISO 230-6, where the four space diagonals are there.
fn diagonals(tests: &[LinearTest], budget: Option<&Budget>) -> Option<Section> {
    let of_kind: Vec<&LinearTest> = tests
        .iter()
        .filter(|test| test.kind == TestKind::Diagonal)
        .collect();
    let names = SpaceDiagonal::ALL;
    if of_kind.len() < names.len() {
        return None;
    }
    let first: Vec<DiagonalRuns> = names
        .into_iter()
        .zip(&of_kind)
        .map(|(diagonal, test)| DiagonalRuns {
            diagonal,
            runs: runs(test),
        })
        .collect();
    let mut section = Section::new("Space diagonals, ISO 230-6");
    let used = budget.copied().unwrap_or(Budget::nothing()).positioning();
    match diagonal::evaluate(&first, &used) {
        Ok(result) => {
            let stated = budget.is_some();
            section.lines.push(format!(
                "Systematic deviation E_d {} µm, reversal B_d {} µm; the diagonals differ by {} µm.",
                figure(&result.systematic_error, stated),
                figure(&result.reversal, stated),
                figure(&result.spread, stated)
            ));
            section.figures = serde_json::json!({ "iso230_6": result });
        }
        Err(error) => section.lines.push(format!("Not evaluated: {error}.")),
    }
    Some(section)
}
