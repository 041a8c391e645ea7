//! Which body carries the positions, and which expansion is corrected.

use super::*;
use crate::evaluate::test_conditions::Readings;
use std::path::Path;

const BUDGET: &str = "
grid_encoder: {expanded_uncertainty_um: 0.4, expanded_uncertainty_um_per_m: 2.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 2.0, temperature_half_width_k: 0.2, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 1.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 5.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.3
";

const MACHINE: &str = include_str!("../../../../../../launch_configs/dual_loop/machine.yaml");

fn measured(budget: Option<&str>, reference: Reference) -> Measured {
    let budget = budget.map(|text| Budget::read(text, Path::new("budget.yaml")).unwrap());
    let about = About {
        runs: &[1],
        reference,
        axis: Some(Axis::X),
        is_compensated: false,
    };
    Measured::of(&Tests::default(), budget.as_ref(), about)
}

#[test]
fn the_screw_carries_what_the_motor_leads_and_the_machine_what_a_scale_or_a_table_does_by_hand() {
    // Bed 21 °C with a scale of 8 µm/(m K), nut 24 °C on a screw of 11.6 µm/(m K): 46.4 against 8 µm/m, over 400 mm
    // 18.56 against 3.2 µm.
    let text = BUDGET
        .replacen("temperature_deviation_k: 2.0", "thermometers: [bed]", 1)
        .replacen("expansion_um_per_m_k: 11.0", "expansion_um_per_m_k: 8.0", 1)
        .replacen("expansion_um_per_m_k: 5.0", "expansion_um_per_m_k: 0.0", 1);
    let text = format!(
        "{text}screws:\n  X: {{thermometers: [nut_x], temperature_half_width_k: 1.5, expansion_um_per_m_k: 11.6, expansion_half_width_um_per_m_k: 0.6}}\n"
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let read = Thermometers::from([
        ("bed".to_owned(), Readings::new(21.0)),
        ("nut_x".to_owned(), Readings::new(24.0)),
    ]);
    let mut tests = Tests::default();
    tests.conditions.thermometers_of_run(1, read);
    let about = |axis, is_compensated| About {
        runs: &[1],
        reference: Reference::Length,
        axis,
        is_compensated,
    };
    let of =
        |axis, is_compensated| Measured::of(&tests, Some(&budget), about(axis, is_compensated));
    let motor = of(Some(Axis::X), false);
    assert!((motor.correction.differential_expansion() - 46.4e-6).abs() < 1e-15);
    let words = motor.correction.in_words(400.0);
    assert!(
        words.starts_with("Corrected to 20 °C: 18.56 µm taken out over 400 mm; ball screw of X 24.00 °C (read by nut_x"),
        "{words}"
    );
    assert_eq!(motor.correction.as_json()["carrier"], "ball screw of X");
    // U has the limits of the screw: 11.6 µm/(m K) 1.5 K 0.4 m over √3.
    let terms = motor.budget.over(400.0, 400.0);
    assert!((terms.machine_temperature_mm - 6.96e-3 / 3.0_f64.sqrt()).abs() < 1e-12);
    // By a table of the scale, along another axis, along several.
    for other in [
        of(Some(Axis::X), true),
        of(Some(Axis::Y), false),
        of(None, false),
    ] {
        assert!((other.correction.differential_expansion() - 8e-6).abs() < 1e-15);
        assert!(
            other
                .correction
                .in_words(400.0)
                .contains("400 mm; machine 21.00 °C")
        );
    }
    // With the scale in the loop.
    const OF_SCALE: &str = "scale_expanded_uncertainty_um_per_m: 3.0";
    let file = |feedback: &str| {
        let text = MACHINE.replacen(OF_SCALE, &format!("{OF_SCALE}{feedback}"), 1);
        Some(machine::MachineFile::parse(&text, "machine.yaml").unwrap())
    };
    for (feedback, expansion) in [("", 46.4e-6), (", position_feedback: scale", 8e-6)] {
        tests.machine = file(feedback);
        let found = Measured::of(&tests, Some(&budget), about(Some(Axis::X), false));
        assert!(
            (found.correction.differential_expansion() - expansion).abs() < 1e-15,
            "{feedback}"
        );
    }
}

#[test]
fn a_screw_whose_thermometer_is_silent_is_named() {
    let text = format!(
        "{BUDGET}screws:\n  X: {{thermometers: [nut_x], temperature_half_width_k: 1.5, expansion_um_per_m_k: 11.6, expansion_half_width_um_per_m_k: 0.6}}\n"
    );
    let why = measured(Some(&text), Reference::Length)
        .correction
        .lacks()
        .unwrap();
    assert!(
        why.contains("`screws.X` names the thermometer nut_x"),
        "{why}"
    );
}

#[test]
fn what_is_taken_out_is_machine_less_device_by_hand() {
    // 11 µm/(m K) 2 K − 5 µm/(m K) 1 K = 17 µm/m; 6.8 µm over 400 mm.
    let found = measured(Some(BUDGET), Reference::Length).correction;
    assert!((found.differential_expansion() - 17e-6).abs() < 1e-15);
    assert_eq!(found.lacks(), None);
    let words = found.in_words(400.0);
    assert!(
        words
            .starts_with("Corrected to 20 °C: 6.80 µm taken out over 400 mm; machine 22.00 °C (stated in the budget: for every test)"),
        "{words}"
    );
    assert!(found.as_json()["machine"]["temperature_range_k"].is_null());
}

#[test]
fn a_temperature_that_changed_during_the_test_is_stated_with_its_range() {
    let text = BUDGET.replacen("temperature_deviation_k: 2.0", "thermometers: [bed]", 1);
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    // Three runs at 21.0, 22.0 and 22.6 °C: their mean is 21.87 °C, the range 1.6 K.
    let mut bed = Readings::new(21.0);
    bed.add(22.0);
    bed.add(22.6);
    let read = Thermometers::from([("bed".to_owned(), bed)]);
    let known = Known::of(Some(&budget), &read, Carrier::Machine);
    let found = known.correction(Some(&budget), false);
    let words = found.in_words(400.0);
    let wanted = "machine 21.87 °C (read by bed: mean of the test for all its runs, range 1.60 K), 11.0 µm/(m K)";
    assert!(words.contains(wanted), "{words}");
    // 1.6 K, 11 µm/(m K), 0.4 m: 7.04 µm; over 5 mm it is below a tenth of a micrometre.
    assert!(
        words.contains("changed by 7.04 µm over 400 mm at most during the test."),
        "{words}"
    );
    // The range of single readings holds their noise: not all of it need be in the scatter.
    assert!(
        words.contains("the part that is not noise of the thermometer"),
        "{words}"
    );
    assert!(!found.in_words(5.0).contains("during the test."));
    let all = found.as_json();
    let near = |key: &str, by_hand: f64| {
        let value = all["machine"][key].as_f64().unwrap();
        assert!((value - by_hand).abs() < 1e-9, "{key}: {value}");
    };
    near("temperature_range_k", 1.6);
    // ± 0.2 K of the thermometer and half of 1.6 K.
    near("temperature_half_width_k", 0.68_f64.sqrt());
}

#[test]
fn an_instrument_that_corrects_is_not_corrected_again() {
    let text = format!("{BUDGET}length_corrected_by_instrument: true\n");
    let found = measured(Some(&text), Reference::Length);
    assert_eq!(found.correction, Correction::ByInstrument);
    assert!(found.correction.differential_expansion().abs() < 1e-30);
    // What is not known about temperature and coefficient stays.
    let terms = found.budget.over(400.0, 400.0);
    assert!((terms.machine_expansion_mm - 0.000_8 / 3.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn a_plate_does_not_correct_itself() {
    let text = format!("{BUDGET}length_corrected_by_instrument: true\n");
    let without = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let by_plate = |budget| MeasuredCircle::by_plate(budget, &Thermometers::new());
    let unstated = by_plate(Some(&without));
    assert!(unstated.correction.lacks().unwrap().contains("no plate"));
    // 11 µm/(m K) 2 K − 8 µm/(m K) 1.5 K = 10 µm/m.
    let text = format!(
        "{text}plate: {{temperature_deviation_k: 1.5, temperature_half_width_k: 0.1, expansion_um_per_m_k: 8.0, expansion_half_width_um_per_m_k: 0.0}}\n"
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let plate = by_plate(Some(&budget));
    assert!((plate.correction.differential_expansion() - 10e-6).abs() < 1e-15);
    assert!((plate.budget.differential_expansion() - 10e-6).abs() < 1e-15);
    assert!((plate.budget.displacement.expanded_uncertainty_mm - 0.4e-3).abs() < 1e-15);
    let unknown = by_plate(None);
    assert!(unknown.correction.lacks().unwrap().contains("no budget"));
}

#[test]
fn without_temperatures_the_reason_names_what_to_state() {
    let lacks = |budget, reference| measured(budget, reference).correction.lacks().unwrap();
    assert!(lacks(None, Reference::Length).contains("no budget was given (--budget)"));
    let silent = BUDGET.replacen("temperature_deviation_k: 2.0", "thermometers: [bed]", 1);
    let why = lacks(Some(&silent), Reference::Length);
    assert!(
        why.contains("`machine` names the thermometer bed, which has no reading"),
        "{why}"
    );
    let own = measured(Some(BUDGET), Reference::Scale);
    assert!(own.correction.lacks().unwrap().contains("own scale"));
    assert!(!own.is_stated);
}

#[test]
fn a_temperature_far_from_20_degc_that_the_budget_states_is_named_with_its_key() {
    let of = |text: &str| {
        let mut section = Section::new("X".to_owned());
        let correction = measured(Some(text), Reference::Length).correction;
        correction.name_far(&mut section);
        section.warnings
    };
    assert!(of(BUDGET).is_empty());
    let warm = |k: &str| BUDGET.replacen("temperature_deviation_k: 2.0", k, 1);
    assert!(of(&warm("temperature_deviation_k: 9.9")).is_empty());
    let found = of(&warm("temperature_deviation_k: 22.0"));
    let words = "temperature_deviation_k = 22 K of the budget file is a temperature of 42 °C";
    assert!(found[0].line.contains(words), "{found:?}");
}
