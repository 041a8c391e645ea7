//! The sections of positioning tests, against figures by hand.

use super::*;
use crate::evaluate::test_conditions::{Readings, Thermometers};
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
        place_mm: None,
        targets_mm: vec![0.0, 100.0, 300.0],
        up_mm: vec![vec![0.0, 0.001, 0.003]],
        mean_mm: 0.0,
        began: metrology::stamp::Stamp::from_nanos(0),
        outlying: Default::default(),
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
    let words = "the command rested for 0.20 s at most, and readings of a stop count from 0.3 s on";
    assert!(section.lines[0].contains(words), "{:?}", section.lines);
    short.longest_rest = Some(STOP_SETTLE);
    assert_eq!(too_short(&short), None);
}

const MACHINE: &str = include_str!("../../../../../launch_configs/gap_first/machine.yaml");

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

/// The budget of a shop without a thermometer at the axis.
fn budget_without_temperature() -> Budget {
    let text = "
grid_encoder: {expanded_uncertainty_um: 0.4, expanded_uncertainty_um_per_m: 2.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {thermometers: [bed], temperature_half_width_k: 0.2, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.0
";
    Budget::read(text, Path::new("budget.yaml")).unwrap()
}

#[test]
fn a_length_that_is_not_at_20_degc_has_no_uncertainty_and_says_so_first() {
    let tests = warm(Reference::Length, &UNEVEN_MM);
    let section = &sections(&tests, Some(&budget_without_temperature())).unwrap()[0];
    let found = &section.figures["iso230_2"];
    // 8.85 µm as read; at 20 °C the axis has 0.05 µm, which no U of the reading states.
    assert!((um_of(&found["systematic_error"], "value_mm") - 8.85).abs() < 1e-6);
    for key in ["accuracy", "systematic_error", "mean_systematic_error"] {
        assert!(
            found[key]["expanded_uncertainty_mm"].is_null(),
            "{key}: {found}"
        );
    }
    for side in ["up", "down"] {
        let value = &found[side]["systematic_error"]["expanded_uncertainty_mm"];
        assert!(value.is_null(), "{side}: {found}");
    }
    // What repeats and what reverses is no length.
    for key in ["repeatability", "reversal"] {
        assert!(
            found[key]["expanded_uncertainty_mm"].is_number(),
            "{key}: {found}"
        );
    }
    let answer = &section.answers[0];
    assert!(
        answer.starts_with("as measured, not at 20 °C: accuracy A 8."),
        "{answer}"
    );
    assert!(
        !answer[..answer.find("repeatability").unwrap()].contains('±'),
        "{answer}"
    );
    let warned = section
        .warnings
        .iter()
        .find(|one| one.kind == "Not corrected to 20 °C");
    let line = &warned.unwrap().line;
    assert!(
        line.contains("the budget file's `machine` names the thermometer bed"),
        "{line}"
    );
    let stated = &sections(&tests, Some(&budget())).unwrap()[0];
    assert!(
        stated.answers[0].ends_with("(± U, k = 2)."),
        "{:?}",
        stated.answers
    );
    assert!(
        stated
            .warnings
            .iter()
            .all(|one| one.kind != "Not corrected to 20 °C")
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
    let warned = section
        .warnings
        .iter()
        .any(|one| one.kind == "Read by the machine's scale");
    let begin = "not ISO 230-2, read by the machine's scale: accuracy";
    assert!(
        warned && section.answers[0].starts_with(begin),
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
fn the_scale_that_closes_the_loop_gives_no_figure_and_says_why() {
    let mut tests = warm(Reference::Scale, &UNEVEN_MM);
    let by_scale = MACHINE.replacen(
        "encoder_resolution_um: 0.05",
        "encoder_resolution_um: 0.05, scale_resolution_um: 0.05, position_feedback: scale",
        1,
    );
    tests.machine = Some(MachineFile::parse(&by_scale, "machine.yaml").unwrap());
    let section = sections(&tests, Some(&budget())).unwrap().remove(0);
    let why = section.unevaluated.unwrap();
    assert!(
        why.starts_with("the scale of X closes the position loop"),
        "{why}"
    );
    assert!(section.figures["iso230_2"].is_null());
}

#[test]
fn targets_on_whole_leads_of_the_machine_file_are_warned_of() {
    let on_leads = [0.0, 100.0, 190.0, 310.0, 400.0];
    for (targets_mm, warned) in [(on_leads, true), (UNEVEN_MM, false)] {
        let tests = warm(Reference::Length, &targets_mm);
        let section = &sections(&tests, None).unwrap()[0];
        let kinds = || {
            section
                .warnings
                .iter()
                .filter(|one| one.kind == "Deviates from ISO 230-2")
        };
        let phase = "All targets are multiples of 10.000 mm apart, within 0.0 % of it.";
        assert_eq!(kinds().any(|one| one.line.contains(phase)), warned);
        let remark = |line: &String| line.contains(phase);
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
    let remark = |line: &String| line.contains("multiples of 51.550 mm apart");
    assert!(section.lines.iter().any(remark), "{:?}", section.lines);
}

#[test]
fn a_test_of_one_run_has_the_figures_that_need_no_scatter() {
    let mut one = test([1.0, 0.0, 0.0]);
    (one.kind, one.axis) = (TestKind::Positioning, Some(Axis::X));
    let both = &sections(&tests_of(one.clone()), None).unwrap()[0];
    let found = &both.figures["iso230_2"];
    let um = |place: &str| 1e3 * found.pointer(place).unwrap()["value_mm"].as_f64().unwrap();
    for (place, wanted_um) in [
        ("/up/systematic_error", 3.0),
        ("/down/systematic_error", 3.0),
        ("/systematic_error", 5.0),
        ("/reversal", 2.0),
        ("/mean_reversal", -2.0),
        ("/mean_systematic_error", 3.0),
    ] {
        assert!(
            (um(place) - wanted_um).abs() < 1e-9,
            "{place} {}",
            um(place)
        );
    }
    assert!(found["accuracy"].is_null() && found["repeatability"].is_null());
    assert!(
        both.lines
            .iter()
            .any(|line| line.contains("R and accuracy A need at least 2 runs"))
    );
    assert!(both.answers[0].contains("repeatability R and accuracy A need more runs"));
    for (up, side) in [(true, "up"), (false, "down")] {
        let mut one = one.clone();
        if up { &mut one.down_mm } else { &mut one.up_mm }.clear();
        let section = &sections(&tests_of(one), None).unwrap()[0];
        let found = &section.figures["iso230_2"];
        assert!(found[side]["systematic_error"].is_object(), "{found}");
        assert!(found["reversal"].is_null(), "{found}");
        assert!(section.lines.iter().any(|line| line.contains("one-way")));
    }
}

#[test]
fn what_a_machine_changes_under_a_table_is_stated_with_its_slopes_and_temperatures() {
    // Five runs over 600 mm with slopes of -12.4 to -19.9 µm/m, as a scenario dual_loop after production: by hand 7.5 µm/m of
    // 0.6 m are 4.5 µm.
    let targets_mm = [-300.0, -160.0, 10.0, 150.0, 300.0];
    let run = |slope: f64| -> Vec<f64> { targets_mm.iter().map(|at| slope * 1e-6 * at).collect() };
    let slopes = [-12.4, -14.5, -16.4, -18.2, -19.9];
    let mut tests = warm(Reference::Length, &targets_mm);
    let test = &mut tests.linear[0];
    test.compensated = true;
    test.up_mm = slopes.map(run).to_vec();
    test.down_mm = test.up_mm.clone();
    tests.tables = vec![metrology::sample::PositioningTable {
        at: metrology::Stamp::from_nanos(0),
        axis: Axis::X,
        position: vec![],
        deviation_up: vec![],
        deviation_down: vec![],
        n_runs: 1,
        weight: 0.3,
        sequence: 1,
    }];
    let mut nut = Readings::new(22.56);
    nut.add(22.05);
    let read = Thermometers::from([("nut_x".to_owned(), nut)]);
    tests.conditions.thermometers_of_run(1, read);
    let text = include_str!("../../../../../launch_configs/dual_loop/budget.yaml");
    let text = text.replace(
        "machine: {thermometers: [bed]",
        "machine: {temperature_deviation_k: 0.5",
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let section = &sections(&tests, Some(&budget)).unwrap()[0];
    let line = section.lines.last().unwrap();
    for words in [
        "first run -12.4 µm/m, of the last one -19.9 µm/m: 4.50 µm over 600 mm",
        "The table of X was not refreshed during the test.",
        "The ball screw of X went from 22.56 to 22.05 °C (nut_x).",
    ] {
        // 8 µm/(m K) of 0.5 K are taken out of every run alike.
        let words = words.replace("-12.4", "-16.4").replace("-19.9", "-23.9");
        assert!(line.contains(&words), "{line}");
    }
    assert!(section.warnings.iter().any(|one| one.line == *line));
    // What does not change is not stated.
    let test = &mut tests.linear[0];
    test.up_mm = vec![run(-12.4); 5];
    test.down_mm = test.up_mm.clone();
    let section = &sections(&tests, Some(&budget)).unwrap()[0];
    assert!(section.lines.iter().all(|line| !line.contains("Slope of")));
}
