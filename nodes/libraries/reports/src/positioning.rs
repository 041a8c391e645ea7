//! ISO 230-2 and 230-6 of a bag.

use abbe_msgs::topics;
use anyhow::Result;
use iso230::positioning::one_sided::{self, OneSidedResult};
use iso230::positioning::single_run;
use iso230::positioning::{PositioningRemark, PositioningResult, PositioningRuns};
use iso230::{Direction, ExpandedLength, positioning};
use machine::MachineFile;
use machine::file::PositionFeedback;
use metrology::Axis;
use metrology::number::decimals_of;
use metrology::sample::TestKind;

mod change;
mod curves;
mod diagonals;
mod one_value;
mod single;
#[cfg(test)]
mod tests;
mod uncertainty;

pub use diagonals::shown_title;

use super::section::{Rows, Section, head, um};
use super::svg::unsigned_zero;
use crate::evaluate::Tests;
use crate::evaluate::budget::{Budget, unstate, unstate_named};
use crate::evaluate::correction::{About, BY_OWN_SCALE, Measured};
use crate::evaluate::linear::{LinearTest, Reference, STOP_SETTLE, level};
use crate::evaluate::thermometer::name_dead;

/// A figure and, where a budget was given, its expanded uncertainty.
pub fn figure(value: &ExpandedLength, stated: bool) -> String {
    if stated {
        with_u(value.value_mm * 1e3, value.expanded_uncertainty_mm * 1e3)
    } else {
        um(value.value_mm)
    }
}

/// A value and its expanded uncertainty with two decimals, or more where its second digit is behind them.
pub(crate) fn with_u(value: f64, expanded: f64) -> String {
    let decimals = decimals_of(expanded).max(2);
    let value = unsigned_zero(format!("{value:.decimals$}"));
    format!("{value} ± {expanded:.decimals$}")
}

/// One part for each test; a test that cannot be evaluated says why.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(tests: &Tests, budget: Option<&Budget>) -> Result<Vec<Section>> {
    // What all four diagonals say together comes before each of them.
    let mut sections = diagonals::sections(tests, budget);
    for test in &tests.linear {
        sections.push(section(tests, test, budget)?);
    }
    Ok(sections)
}

/// The runs at 20 °C, where they are corrected here.
fn runs(test: &LinearTest, periods_mm: Vec<f64>, measured: &Measured) -> PositioningRuns {
    let mut runs = measured.correction.runs_at_20_degc(test, periods_mm);
    level(&mut runs.up_mm, &mut runs.down_mm);
    runs
}

/// Least share of an axis in a line at which its periods count.
const LEAST_SHARE: f64 = 0.1;

/// Linear axes that move along the line of a test: their leads and scale signals may show as periods of its error.
pub fn axes_along(test: &LinearTest) -> Vec<Axis> {
    let has_share = |axis: &Axis| test.direction[axis.index()].abs() >= LEAST_SHARE;
    Axis::LINEAR.into_iter().filter(has_share).collect()
}

/// Periods of the machine along the line of a test, mm.
fn periods_mm(test: &LinearTest, machine: Option<&MachineFile>) -> Vec<f64> {
    let mut periods_mm = Vec::new();
    for axis in axes_along(test) {
        let share = test.direction[axis.index()].abs();
        let entry = machine.and_then(|machine| machine.linear(axis));
        if let Some(entry) = entry {
            let repeats_mm = entry.repeats_mm().into_iter();
            periods_mm.extend(repeats_mm.map(|period_mm| period_mm / share));
        }
    }
    periods_mm
}

fn section(tests: &Tests, test: &LinearTest, budget: Option<&Budget>) -> Result<Section> {
    let measured = &Measured::of(tests, budget, About::line(test));
    let what = match test.kind {
        TestKind::Diagonal => diagonals::DIAGONAL,
        _ => "Positioning ",
    };
    let state = ["not compensated", "compensated"][usize::from(test.compensated)];
    let by = match test.reference {
        _ if nothing_was_read(test) => "nothing was read",
        Reference::Length => "by the length reference",
        Reference::Scale => "by the linear scale",
    };
    let title = |name: &str| format!("{what}{name}, run {} on: {state}, {by}", test.first_run);
    let mut section = Section::new(title(&test.name));
    if let Some(why) = closed_loop(tests, test) {
        section.without_figures(why);
        section.tell_left_out(&test.left_out);
        return Ok(section);
    }
    let runs = runs(test, periods_mm(test, tests.machine.as_ref()), measured);
    let found = match side_of(test) {
        _ if single_run::is_single(&runs) => single_run::evaluate(&runs, &measured.budget)
            .map(|result| single::fill(&mut section, test, &result, measured)),
        None => positioning::evaluate(&runs, &measured.budget)
            .map(|result| fill(&mut section, test, &result, measured)),
        Some(direction) => one_sided::evaluate(&runs, direction, &measured.budget)
            .map(|result| fill_one_sided(&mut section, test, &result, measured)),
    };
    if section.figures.get("iso230_2").is_some() {
        section.drawings.push(curves::drawing(&runs)?);
    }
    match found {
        Ok(filled) => {
            filled?;
            state_reference(&mut section, test, measured);
            let r_mm = section.figures["iso230_2"]["repeatability"]["value_mm"].as_f64();
            change::state(&mut section, (test, &runs), (tests, budget), r_mm);
        }
        Err(error) => {
            let too_short = too_short(test);
            // A run that was not made to be read at its stops lacks nothing.
            let is_lost = test.targets_mm.is_empty() && too_short.is_none();
            let why = too_short
                .or_else(|| without_places(tests, test))
                .or_else(|| without_readings(test))
                .unwrap_or_else(|| error.to_string());
            if is_lost {
                section.without_figures(why);
            } else {
                section.not_evaluated(why);
            }
        }
    }
    section.tell_left_out(&test.left_out);
    // The figures keep the beam's own name, by which a history knows the test.
    if test.kind == TestKind::Diagonal {
        section.title = title(&diagonals::shown_name(test));
    }
    section.name_far(&test.outlying.far);
    one_value::name(&mut section, test);
    name_dead(&mut section, &tests.conditions.during(&test.runs));
    Ok(section)
}

/// By what the test was read, at which temperature its lengths are, and why nothing is decided of it.
fn state_reference(section: &mut Section, test: &LinearTest, measured: &Measured) {
    let (first_mm, last_mm) = (test.targets_mm.first(), test.targets_mm.last());
    let span_mm = first_mm
        .zip(last_mm)
        .map_or(0.0, |(first, last)| last - first);
    let correction = &measured.correction;
    let mut no_verdict = correction.lacks();
    section.figures["feed_mm_min"] = (test.feed_mm_s * 60.0).into();
    section.figures["dwell_s"] = test.longest_rest.map(|rest| rest.as_secs_f64()).into();
    section.figures["correction_to_20_degc"] = correction.as_json();
    if let (Some(along), Some(place_mm)) = (test.axis, test.place_mm) {
        let others = Axis::ALL
            .into_iter()
            .filter(|axis| axis.is_linear() && *axis != along);
        let place = others.map(|axis| (axis.to_string(), place_mm[axis.index()].into()));
        section.figures["place_mm"] = serde_json::Value::Object(place.collect());
    }
    if test.reference == Reference::Scale {
        section.warn_first(OWN_SCALE, format!("{}.", capital(BY_OWN_SCALE)));
        if !measured.is_stated {
            section.lines.insert(1, SCALE_NOT_STATED.to_owned());
        }
        section.figures["label"] = BY_OWN_SCALE.into();
        no_verdict = Some(BY_OWN_SCALE.to_owned());
        let tables = section.tables.iter_mut();
        tables.for_each(|table| table.head[0] = "read by the machine's scale / µm".to_owned());
    }
    if !measured.is_stated {
        unstate(&mut section.figures);
    } else if !measured.are_lengths_stated {
        unstate_named(&mut section.figures, &LENGTHS);
    }
    measured.state_correction(section, span_mm);
    section.figures["no_verdict"] = no_verdict.into();
}

/// Figures that are lengths of the machine, and change with its temperature.
const LENGTHS: [&str; 3] = ["accuracy", "systematic_error", "mean_systematic_error"];
/// What warnings of figures that a machine read itself have in common.
const OWN_SCALE: &str = "Read by the machine's scale";
/// What warnings of tests have in common that are not those of the standard.
const DEVIATES: &str = "Deviates from ISO 230-2";

const SCALE_NOT_STATED: &str = "The scale's uncertainty is not stated: scale_expanded_uncertainty_um and scale_expanded_uncertainty_um_per_m of the axis in the machine file, and a budget (--budget).";

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// The side from which alone the targets were approached; none: both.
fn side_of(test: &LinearTest) -> Option<Direction> {
    match (test.up_mm.is_empty(), test.down_mm.is_empty()) {
        (false, true) => Some(Direction::Up),
        (true, false) => Some(Direction::Down),
        _ => None,
    }
}

fn fill_one_sided(
    section: &mut Section,
    test: &LinearTest,
    result: &OneSidedResult,
    measured: &Measured,
) -> Result<()> {
    let towards = result.direction;
    section.lines.push(format!(
        "{} targets from {:.3} to {:.3} mm, {} runs {towards} only (one-way): the values of ISO 230-2 for one side; reversal and what is made of both sides need runs the other way. The range of the means of one way is its E.",
        test.targets_mm.len(),
        test.targets_mm.first().copied().unwrap_or(f64::NAN),
        test.targets_mm.last().copied().unwrap_or(f64::NAN),
        result.n_runs
    ));
    state_remarks(section, &result.remarks);
    let (stated, lengths_stated) = (measured.is_stated, measured.are_lengths_stated);
    let arrow = match towards {
        Direction::Up => "↑",
        Direction::Down => "↓",
    };
    let row = |name: &str, value: &ExpandedLength, stated: bool| {
        vec![format!("{name}{arrow}"), figure(value, stated)]
    };
    let of = &result.result;
    section.answers.push(format!(
        "{}one way: accuracy A{arrow} {} µm, systematic deviation E{arrow} {} µm, repeatability R{arrow} {} µm{}.",
        measured.reservation(),
        figure(&of.accuracy, lengths_stated),
        figure(&of.systematic_error, lengths_stated),
        figure(&of.repeatability, stated),
        measured.coverage()
    ));
    section.tables.push(Rows {
        head: head(&["ISO 230-2, one side / µm", &towards.to_string()]),
        rows: vec![
            row("accuracy A", &of.accuracy, lengths_stated),
            row(
                "systematic deviation E",
                &of.systematic_error,
                lengths_stated,
            ),
            row("repeatability R", &of.repeatability, stated),
        ],
        note: measured.uncertainty_note().to_owned(),
    });
    section
        .lines
        .extend(uncertainty::largest(&result.contributions, measured));
    let terms = uncertainty::table(&result.contributions, measured);
    section.tables.extend(terms);
    let mut figures = serde_json::json!({
        "one_sided": towards,
        "n_runs": result.n_runs,
        "points": result.points,
        "contributions": result.contributions,
        "remarks": result.remarks,
    });
    // Under the names that they have in a test of both sides.
    figures[towards.to_string()] = serde_json::to_value(of)?;
    section.figures = serde_json::json!({
        "test": section.title, "iso230_2": figures, "left_out": test.left_out,
    });
    Ok(())
}

/// Whether no place has a reading.
const fn nothing_was_read(test: &LinearTest) -> bool {
    test.targets_mm.is_empty() && test.left_out.is_empty()
}

/// Why a test has no target when no position of the axes was recorded.
fn without_places(tests: &Tests, test: &LinearTest) -> Option<String> {
    let name = topics::AXES_STATE.name;
    let mut rows = tests.reading.account.topics.iter();
    let came = rows.any(|row| row.topic.ends_with(name) && row.used > 0);
    (nothing_was_read(test) && !came).then(|| {
        format!(
            "no message of the topic {name} can be used, so it is not known where the axes were: record it together with {}",
            topics::LENGTH_POSITION.name
        )
    })
}

/// Why a test has no figure that was read by the scale which the control itself goes by.
fn closed_loop(tests: &Tests, test: &LinearTest) -> Option<String> {
    let is_by_scale = test.reference == Reference::Scale && !nothing_was_read(test);
    let axis = test.axis.filter(|_| is_by_scale)?;
    let entry = tests.machine.as_ref()?.linear(axis)?;
    (entry.position_feedback == PositionFeedback::Scale).then(|| {
        format!(
            "the scale of {axis} closes the position loop (position_feedback: scale) and reads 0 whatever the axis is off: measure with a length reference"
        )
    })
}

/// Why a test has no target, where nothing was read at its stops.
fn without_readings(test: &LinearTest) -> Option<String> {
    nothing_was_read(test).then(|| {
        format!(
            "no reading of {}, nor one of a scale, counts at any stop",
            topics::LENGTH_POSITION.name
        )
    })
}

/// Why a test has no target, where its stops were too short for one.
fn too_short(test: &LinearTest) -> Option<String> {
    let longest = test.longest_rest?;
    (test.targets_mm.is_empty() && longest < STOP_SETTLE).then(|| {
        format!(
            "the command rested for {:.2} s at most, and readings of a stop count from {:.1} s on",
            longest.as_secs_f64(),
            STOP_SETTLE.as_secs_f64()
        )
    })
}

fn fill(
    section: &mut Section,
    test: &LinearTest,
    result: &PositioningResult,
    measured: &Measured,
) -> Result<()> {
    section.lines.push(format!(
        "{} targets from {:.3} to {:.3} mm, {} runs up and down.",
        test.targets_mm.len(),
        test.targets_mm.first().copied().unwrap_or(f64::NAN),
        test.targets_mm.last().copied().unwrap_or(f64::NAN),
        result.n_runs
    ));
    state_remarks(section, &result.remarks);
    section.answers.push(format!(
        "{}accuracy A {} µm, systematic deviation E {} µm, repeatability R {} µm, reversal B {} µm{}.",
        measured.reservation(),
        figure(&result.accuracy, measured.are_lengths_stated),
        figure(&result.systematic_error, measured.are_lengths_stated),
        figure(&result.repeatability, measured.is_stated),
        figure(&result.reversal, measured.is_stated),
        measured.coverage()
    ));
    section.tables.push(figures(result, measured));
    section
        .lines
        .extend(uncertainty::largest(&result.contributions, measured));
    let terms = uncertainty::table(&result.contributions, measured);
    section.tables.extend(terms);
    section.figures = serde_json::json!({
        "test": section.title, "iso230_2": result, "left_out": test.left_out,
    });
    Ok(())
}

fn figures(result: &PositioningResult, measured: &Measured) -> Rows {
    let of = |value: &ExpandedLength| figure(value, measured.is_stated);
    let length = |value: &ExpandedLength| figure(value, measured.are_lengths_stated);
    let row =
        |name: &str, up: String, down: String, both: String| vec![name.to_owned(), up, down, both];
    let dash = || "—".to_owned();
    let (up, down) = (&result.up, &result.down);
    Rows {
        head: head(&["ISO 230-2 / µm", "up", "down", "both"]),
        rows: vec![
            row(
                "accuracy A",
                length(&up.accuracy),
                length(&down.accuracy),
                length(&result.accuracy),
            ),
            row(
                "systematic deviation E",
                length(&up.systematic_error),
                length(&down.systematic_error),
                length(&result.systematic_error),
            ),
            row(
                "repeatability R",
                of(&up.repeatability),
                of(&down.repeatability),
                of(&result.repeatability),
            ),
            row("reversal B", dash(), dash(), of(&result.reversal)),
            row("mean reversal", dash(), dash(), of(&result.mean_reversal)),
            row(
                "range of means M",
                dash(),
                dash(),
                length(&result.mean_systematic_error),
            ),
        ],
        note: measured.uncertainty_note().to_owned(),
    }
}

/// What of a test is not as the standard has it, each a warning.
fn state_remarks(section: &mut Section, remarks: &[PositioningRemark]) {
    for remark in remarks {
        section.warn(DEVIATES, remark_in_words(remark));
    }
}

/// Fewer runs than a standard asks for.
pub(crate) fn few_runs(n_runs: usize, required: usize) -> String {
    let runs = if n_runs == 1 { "run" } else { "runs" };
    format!("{n_runs} {runs} in each direction; the standard asks for {required}.")
}

fn remark_in_words(remark: &PositioningRemark) -> String {
    match remark {
        PositioningRemark::FewRuns { n_runs, required } => few_runs(*n_runs, *required),
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
            "All targets are multiples of {period_mm:.3} mm apart, within {:.1} % of it. That is a period of the machine file (lead_mm, periods_mm or scale) or half of one: an error of that period is not seen. Choose targets that are no multiples of it.",
            100.0 * phase_spread_rad / std::f64::consts::TAU
        ),
    }
}
