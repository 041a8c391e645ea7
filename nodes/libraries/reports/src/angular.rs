//! ISO 230-2 of rotary axes, in seconds of arc.

use abbe_msgs::topics;
use anyhow::Result;
use iso230::positioning::rotary::{self, RotaryBudget, RotaryRemark, RotaryResult};
use iso230::{Direction, ExpandedAngle};

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head};
use crate::evaluate::Tests;
use crate::evaluate::angular::RotaryTest;
use crate::evaluate::budget::{Budget, unstate};
use crate::evaluate::linear::STOP_SETTLE;

/// Seconds of arc of a radian.
const ARCSEC_PER_RAD: f64 = 648_000.0 / std::f64::consts::PI;

/// A reference of which nothing is stated.
const NOTHING: RotaryBudget = RotaryBudget {
    expanded_uncertainty_rad: 0.0,
    coverage_factor: 2.0,
    environmental_drift_rad: 0.0,
    environmental_unrest_rad: None,
};

/// One part for each test; a test that cannot be evaluated says why.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(tests: &Tests, budget: Option<&Budget>) -> Result<Vec<Section>> {
    let all = tests.rotary_positioning.iter();
    all.map(|test| section(test, budget)).collect()
}

fn section(test: &RotaryTest, budget: Option<&Budget>) -> Result<Section> {
    let mut section = Section::new(format!(
        "Positioning {}, run {} on: rotary axis, by the angular reference",
        test.axis, test.first_run
    ));
    let stated = budget.and_then(Budget::rotary);
    if budget.is_some() && stated.is_none() {
        section
            .lines
            .push("The budget has no angular_reference: no uncertainty is stated.".to_owned());
    }
    let runs = rotary::RotaryRuns {
        targets_rad: test.targets_rad.clone(),
        up_rad: test.up_rad.clone(),
        down_rad: test.down_rad.clone(),
    };
    match rotary::evaluate(&runs, &stated.unwrap_or(NOTHING)) {
        Ok(result) => fill(&mut section, test, &result, stated.is_some())?,
        Err(error) => {
            let why = why_not(test).unwrap_or_else(|| error.to_string());
            section.not_evaluated(why);
        }
    }
    section.tell_left_out(&test.left_out);
    section.name_far(&test.outlying.far);
    Ok(section)
}

/// What a recording without targets lacks.
fn why_not(test: &RotaryTest) -> Option<String> {
    if !test.has_readings {
        let longest = test.longest_rest.unwrap_or_default();
        if longest < STOP_SETTLE {
            return Some(format!(
                "the command rested for {:.2} s at most, and readings of a stop count from {:.1} s on",
                longest.as_secs_f64(),
                STOP_SETTLE.as_secs_f64()
            ));
        }
        return Some(format!(
            "no angular reference was read (topic {}), and the axis' own encoder says nothing about its positioning",
            topics::ANGLE_POSITION.name
        ));
    }
    None
}

fn fill(
    section: &mut Section,
    test: &RotaryTest,
    result: &RotaryResult,
    stated: bool,
) -> Result<()> {
    let way = match (&result.up, &result.down) {
        (Some(_), Some(_)) => "up and down",
        (Some(_), None) => {
            "up only (one-way): the values of ISO 230-2 for one side; reversal and what is made of both sides need runs the other way"
        }
        _ => {
            "down only (one-way): the values of ISO 230-2 for one side; reversal and what is made of both sides need runs the other way"
        }
    };
    let deg = |rad: Option<&f64>| rad.map_or(f64::NAN, |rad| rad.to_degrees());
    section.lines.push(format!(
        "{} targets from {:.3} to {:.3} deg, {} runs {way}.",
        test.targets_rad.len(),
        deg(test.targets_rad.first()),
        deg(test.targets_rad.last()),
        result.n_runs
    ));
    section.lines.extend(result.remarks.iter().map(in_words));
    let accuracy = result.both.map(|one| one.accuracy);
    let accuracy = accuracy.or(result.up.map(|one| one.accuracy));
    let accuracy = accuracy.or(result.down.map(|one| one.accuracy));
    section
        .answers
        .push(format!("accuracy A {} arcsec.", cell(accuracy, stated)));
    section.tables.push(table(result, stated));
    section.drawings.push(drawing(result)?);
    let mut figures = serde_json::json!({ "axis": test.axis.letter(), "figures": result });
    if !stated {
        unstate(&mut figures);
    }
    section.figures = serde_json::json!({
        "test": section.title,
        "iso230_2_rotary": figures,
        "left_out": test.left_out,
    });
    Ok(())
}

fn in_words(remark: &RotaryRemark) -> String {
    match remark {
        RotaryRemark::FewRuns { n_runs, required } => {
            format!("{n_runs} runs in each direction; the standard asks for {required}.")
        }
        RotaryRemark::FewTargets {
            n_targets,
            required,
        } => format!("{n_targets} targets; the standard asks for {required} over this travel."),
    }
}

/// A figure in arcsec, with its expanded uncertainty where that is `stated`.
fn cell(value: Option<ExpandedAngle>, stated: bool) -> String {
    let Some(value) = value else {
        return "—".to_owned();
    };
    let arcsec = value.value_rad * ARCSEC_PER_RAD;
    if stated {
        let expanded = value.expanded_uncertainty_rad * ARCSEC_PER_RAD;
        format!("{arcsec:.2} ± {expanded:.2}")
    } else {
        format!("{arcsec:.2}")
    }
}

fn table(result: &RotaryResult, stated: bool) -> Rows {
    let cell = |value: Option<ExpandedAngle>| cell(value, stated);
    let (up, down, both) = (result.up, result.down, result.both);
    let row = |name: &str, values: [Option<ExpandedAngle>; 3]| {
        std::iter::once(name.to_owned())
            .chain(values.map(cell))
            .collect()
    };
    Rows {
        head: head(&["ISO 230-2 / arcsec", "up", "down", "both"]),
        rows: vec![
            row(
                "accuracy A",
                [
                    up.map(|one| one.accuracy),
                    down.map(|one| one.accuracy),
                    both.map(|one| one.accuracy),
                ],
            ),
            row(
                "systematic deviation E",
                [
                    up.map(|one| one.systematic_error),
                    down.map(|one| one.systematic_error),
                    both.map(|one| one.systematic_error),
                ],
            ),
            row(
                "repeatability R",
                [
                    up.map(|one| one.repeatability),
                    down.map(|one| one.repeatability),
                    both.map(|one| one.repeatability),
                ],
            ),
            row("reversal B", [None, None, both.map(|one| one.reversal)]),
            row(
                "mean reversal",
                [None, None, both.map(|one| one.mean_reversal)],
            ),
            row(
                "range of means M",
                [None, None, both.map(|one| one.mean_systematic_error)],
            ),
        ],
        note: if stated {
            "± expanded uncertainty, k = 2.".to_owned()
        } else {
            "No uncertainty is stated without angular_reference in --budget.".to_owned()
        },
    }
}

fn drawing(result: &RotaryResult) -> Result<Drawing> {
    let trace = |direction: Direction| Trace {
        name: direction.to_string(),
        points: { result.points.iter() }
            .filter(|point| point.direction == direction)
            .map(|point| {
                (
                    point.target_rad.to_degrees(),
                    point.mean_rad * ARCSEC_PER_RAD,
                )
            })
            .collect(),
        marks: false,
    };
    let traces = [Direction::Up, Direction::Down].map(trace).into_iter();
    Ok(Drawing {
        svg: plot::svg(&Plot {
            x: "target / deg".to_owned(),
            y: "mean deviation / arcsec".to_owned(),
            traces: traces.filter(|trace| !trace.points.is_empty()).collect(),
        })?,
        caption: "Mean deviation at each target, from each side; the mean of all is taken out."
            .to_owned(),
    })
}
