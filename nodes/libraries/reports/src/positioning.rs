//! ISO 230-2 and 230-6 of a bag.

use abbe_msgs::topics;
use anyhow::Result;
use iso230::positioning::one_sided::{self, OneSidedResult};
use iso230::positioning::{PositioningRemark, PositioningResult, PositioningRuns};
use iso230::{Direction, ExpandedLength, positioning};
use machine::MachineFile;
use metrology::Axis;
use metrology::sample::TestKind;

mod curves;
mod diagonals;

use super::section::{Rows, Section, head, um};
use crate::evaluate::Tests;
use crate::evaluate::budget::{Budget, unstate};
use crate::evaluate::correction::{BY_OWN_SCALE, Measured};
use crate::evaluate::linear::{LinearTest, Reference, STOP_SETTLE, level};

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
pub fn sections(tests: &Tests, budget: Option<&Budget>) -> Result<Vec<Section>> {
    // What all four diagonals say together comes before each of them.
    let mut sections = diagonals::sections(tests, budget);
    for test in &tests.linear {
        let about: (&[u32], _, _) = (&test.runs, test.reference, test.axis);
        let measured = Measured::of(tests, budget, about);
        sections.push(section(tests, test, &measured)?);
    }
    Ok(sections)
}

/// The runs at 20 °C, where they are corrected here.
fn runs(test: &LinearTest, periods_mm: Vec<f64>, measured: &Measured) -> PositioningRuns {
    let as_read = PositioningRuns {
        targets_mm: test.targets_mm.clone(),
        up_mm: test.up_mm.clone(),
        down_mm: test.down_mm.clone(),
        zero_mm: test.targets_mm.first().copied().unwrap_or(0.0),
        periods_mm,
    };
    let expansion = measured.correction.differential_expansion();
    let mut runs = as_read.corrected_to_20_degc(expansion);
    level(&mut runs.up_mm, &mut runs.down_mm);
    runs
}

/// Least share of an axis in a line at which its periods count.
const LEAST_SHARE: f64 = 0.1;

/// Linear axes whose periods count along the line of a test.
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

fn section(tests: &Tests, test: &LinearTest, measured: &Measured) -> Result<Section> {
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
        _ if nothing_was_read(test) => "nothing was read",
        Reference::Length => "by the length reference",
        Reference::Scale => "by the linear scale",
    };
    let mut section = Section::new(format!(
        "{what} {}, run {} on: {state}, {by}",
        test.name, test.first_run
    ));
    let runs = runs(test, periods_mm(test, tests.machine.as_ref()), measured);
    let found = match side_of(test) {
        None => positioning::evaluate(&runs, &measured.budget)
            .map(|result| fill(&mut section, test, &result, measured.is_stated)),
        Some(direction) => one_sided::evaluate(&runs, direction, &measured.budget)
            .map(|result| fill_one_sided(&mut section, test, &result, measured.is_stated)),
    };
    if section.figures.get("iso230_2").is_some() {
        section.drawings.push(curves::drawing(&runs)?);
    }
    match found {
        Ok(filled) => {
            filled?;
            state_reference(&mut section, test, measured);
        }
        Err(error) => {
            let why = too_short(test).or_else(|| without_places(tests, test));
            let why = why.or_else(|| without_readings(test));
            let why = why.unwrap_or_else(|| error.to_string());
            section.not_evaluated(why);
        }
    }
    section.tell_left_out(&test.left_out);
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
    if test.reference == Reference::Scale {
        section
            .lines
            .insert(0, format!("{}.", capital(BY_OWN_SCALE)));
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
    }
    section.lines.push(correction.in_words(span_mm));
    section.figures["no_verdict"] = no_verdict.into();
}

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
    stated: bool,
) -> Result<()> {
    let towards = result.direction;
    section.lines.push(format!(
        "{} targets from {:.3} to {:.3} mm, {} runs {towards} only (one-way): the values of ISO 230-2 for one side; reversal and what is made of both sides need runs the other way. The range of the means of one way is its E.",
        test.targets_mm.len(),
        test.targets_mm.first().copied().unwrap_or(f64::NAN),
        test.targets_mm.last().copied().unwrap_or(f64::NAN),
        result.n_runs
    ));
    section
        .lines
        .extend(result.remarks.iter().map(remark_in_words));
    let arrow = match towards {
        Direction::Up => "↑",
        Direction::Down => "↓",
    };
    let row =
        |name: &str, value: &ExpandedLength| vec![format!("{name}{arrow}"), figure(value, stated)];
    let of = &result.result;
    section.answers.push(format!(
        "one way: accuracy A{arrow} {} µm, systematic deviation E{arrow} {} µm, repeatability R{arrow} {} µm.",
        figure(&of.accuracy, stated),
        figure(&of.systematic_error, stated),
        figure(&of.repeatability, stated)
    ));
    section.tables.push(Rows {
        head: head(&["ISO 230-2, one side / µm", &towards.to_string()]),
        rows: vec![
            row("accuracy A", &of.accuracy),
            row("systematic deviation E", &of.systematic_error),
            row("repeatability R", &of.repeatability),
        ],
        note: uncertainty_note(stated),
    });
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

fn uncertainty_note(stated: bool) -> String {
    if stated {
        "± expanded uncertainty, k = 2.".to_owned()
    } else {
        "No uncertainty is stated: without --budget, or without the scale's certificate.".to_owned()
    }
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
    let of = |value: &ExpandedLength| figure(value, stated);
    section.answers.push(format!(
        "accuracy A {} µm, systematic deviation E {} µm, repeatability R {} µm, reversal B {} µm.",
        of(&result.accuracy),
        of(&result.systematic_error),
        of(&result.repeatability),
        of(&result.reversal)
    ));
    section.tables.push(figures(result, stated));
    section.figures = serde_json::json!({
        "test": section.title, "iso230_2": result, "left_out": test.left_out,
    });
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
        note: uncertainty_note(stated),
    }
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
            "All targets lie within {phase_spread_rad:.2} rad of one phase of the {period_mm:.3} mm period: an error of that period is not seen. Choose targets that are no multiples of it."
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::stamp::Span;
    use nalgebra::Vector3;
    use std::path::Path;

    pub(super) fn test(direction: [f64; 3]) -> LinearTest {
        LinearTest {
            kind: TestKind::Diagonal,
            axis: None,
            name: String::new(),
            first_run: 1,
            runs: vec![1],
            feed_mm_s: 100.0,
            reference: Reference::Length,
            direction: Vector3::from(direction).normalize(),
            targets_mm: vec![0.0, 100.0, 300.0],
            up_mm: vec![vec![0.0, 0.001, 0.003]],
            down_mm: vec![vec![0.002, 0.003, 0.005]],
            left_out: vec![],
            compensated: false,
            longest_rest: None,
        }
    }

    fn tests_of(test: LinearTest) -> Tests {
        Tests {
            linear: vec![test],
            ..Tests::default()
        }
    }

    #[test]
    fn stops_that_were_too_short_are_told_with_their_dwell_and_the_limit() {
        let mut short = test([1.0, 0.0, 0.0]);
        short.longest_rest = Some(Span::from_nanos(200_000_000));
        short.targets_mm.clear();
        (short.up_mm, short.down_mm) = (vec![vec![]], vec![vec![]]);
        let section = &sections(&tests_of(short.clone()), None).unwrap()[0];
        let words =
            "the command rested for 0.20 s at most, and readings of a stop count from 0.3 s on";
        assert!(section.lines[0].contains(words), "{:?}", section.lines);
        short.longest_rest = Some(STOP_SETTLE);
        assert_eq!(too_short(&short), None);
    }

    const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

    /// A positioning test of X of a machine of which only its length changed: 400 mm at 22 °C, 11 µm/(m K), and 0.05 µm of its own.
    fn warm(reference: Reference, targets_mm: &[f64]) -> Tests {
        let deviation = |target: &f64| 22e-6 * target + if *target > 399.0 { 5e-5 } else { 0.0 };
        let run: Vec<f64> = targets_mm.iter().map(deviation).collect();
        let mut warm = test([1.0, 0.0, 0.0]);
        (warm.kind, warm.axis, warm.reference) = (TestKind::Positioning, Some(Axis::X), reference);
        warm.targets_mm = targets_mm.to_vec();
        warm.up_mm = vec![run; 5];
        warm.down_mm = warm.up_mm.clone();
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        Tests {
            machine: Some(machine),
            ..tests_of(warm)
        }
    }

    const UNEVEN_MM: [f64; 5] = [0.0, 103.1, 196.3, 301.7, 400.0];

    fn budget() -> Budget {
        let text = "
grid_encoder: {expanded_uncertainty_um: 0.4, expanded_uncertainty_um_per_m: 2.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 2.0, temperature_half_width_k: 0.2, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.0
";
        Budget::read(text, Path::new("budget.yaml")).unwrap()
    }

    fn um_of(figure: &serde_json::Value, key: &str) -> f64 {
        figure[key].as_f64().unwrap() * 1e3
    }

    #[test]
    fn an_axis_of_400_mm_at_22_degc_has_its_figures_at_20_degc() {
        let tests = warm(Reference::Length, &UNEVEN_MM);
        let section = &sections(&tests, Some(&budget())).unwrap()[0];
        let found = &section.figures["iso230_2"]["systematic_error"];
        assert!((um_of(found, "value_mm") - 0.05).abs() < 1e-6, "{found}");
        // By hand, k = 2, rectangular: 11 µm/(m K) 0.2 K 0.4 m, 2 K 1 µm/(m K) 0.4 m, beam (0.1 mm)²/(4 · 400 mm); device 0.3 µm.
        let squares = (0.88_f64.powi(2) + 0.8_f64.powi(2) + 0.006_25_f64.powi(2)) / 3.0;
        let by_hand_um = 2.0 * (squares + 0.15_f64.powi(2)).sqrt();
        let stated_um = um_of(found, "expanded_uncertainty_mm");
        assert!(
            (stated_um - by_hand_um).abs() < 1e-6,
            "{stated_um} {by_hand_um}"
        );
        assert!(
            section
                .lines
                .iter()
                .any(|line| line.contains("8.80 µm taken out over 400 mm"))
        );
        assert!(section.figures["no_verdict"].is_null(), "{section:?}");
        assert_eq!(section.figures["correction_to_20_degc"]["done"], true);
        let without = &sections(&tests, None).unwrap()[0];
        let found = &without.figures["iso230_2"]["systematic_error"];
        assert!((um_of(found, "value_mm") - 8.85).abs() < 1e-6, "{found}");
        assert!(
            without
                .lines
                .iter()
                .any(|line| line.starts_with("Not corrected to 20 °C: "))
        );
    }

    #[test]
    fn what_the_machines_own_scale_read_is_labelled_and_has_the_scales_uncertainty_or_none() {
        let mut tests = warm(Reference::Scale, &UNEVEN_MM);
        let of = |tests: &Tests| sections(tests, Some(&budget())).unwrap().remove(0);
        let section = of(&tests);
        assert_eq!(
            section.lines[0],
            "Not ISO 230-2: read by the machine's scale."
        );
        assert!(
            section.lines[1].contains("scale_expanded_uncertainty_um"),
            "{section:?}"
        );
        assert_eq!(section.figures["no_verdict"], BY_OWN_SCALE);
        assert!(section.figures["iso230_2"]["accuracy"]["expanded_uncertainty_mm"].is_null());
        let text = MACHINE.replacen(
            "encoder_resolution_um: 0.05",
            "encoder_resolution_um: 0.05, scale_resolution_um: 0.05, scale_expanded_uncertainty_um: 0.6, scale_expanded_uncertainty_um_per_m: 3.0",
            1,
        );
        tests.machine = Some(MachineFile::parse(&text, "machine.yaml").unwrap());
        let section = of(&tests);
        // 0.6 µm and 3 µm/m over 0.4 m; the laser's and the temperatures' parts are none of the scale's.
        let stated_um = um_of(
            &section.figures["iso230_2"]["systematic_error"],
            "expanded_uncertainty_mm",
        );
        assert!((stated_um - 1.8).abs() < 1e-6, "{stated_um}");
        assert_eq!(section.figures["label"], BY_OWN_SCALE);
    }

    #[test]
    fn targets_on_whole_leads_of_the_machine_file_are_warned_of() {
        let on_leads = [0.0, 100.0, 190.0, 310.0, 400.0];
        for (targets_mm, warned) in [(on_leads, true), (UNEVEN_MM, false)] {
            let tests = warm(Reference::Length, &targets_mm);
            let section = &sections(&tests, None).unwrap()[0];
            let remark = |line: &String| line.contains("one phase of the 10.000 mm period");
            assert_eq!(
                section.lines.iter().any(remark),
                warned,
                "{:?}",
                section.lines
            );
        }
        let text = MACHINE.replacen("lead_mm: 10.0", "lead_mm: 10.0, periods_mm: [51.55]", 1);
        let mut tests = warm(Reference::Length, &[0.0, 103.1, 206.2, 309.3, 412.4]);
        tests.machine = Some(MachineFile::parse(&text, "machine.yaml").unwrap());
        let section = &sections(&tests, None).unwrap()[0];
        let remark = |line: &String| line.contains("the 51.550 mm period");
        assert!(section.lines.iter().any(remark), "{:?}", section.lines);
    }
}
