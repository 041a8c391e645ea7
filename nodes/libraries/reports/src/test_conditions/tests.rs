use super::*;
use crate::evaluate::angular::RotaryTest;
use metrology::Axis;
use metrology::stamp::Span;
use std::path::Path;

#[test]
fn a_rotary_test_has_its_reference_and_its_dwell_among_the_conditions() {
    let tests = Tests {
        rotary_positioning: vec![RotaryTest {
            axis: Axis::C,
            first_run: 1,
            targets_rad: vec![0.0, 1.0],
            up_rad: vec![],
            down_rad: vec![],
            mean_rad: 0.0,
            began: metrology::stamp::Stamp::from_nanos(0),
            outlying: Default::default(),
            left_out: vec![],
            longest_rest: Some(Span::from_nanos(2_000_000_000)),
            has_readings: true,
        }],
        ..Tests::default()
    };
    // What stands before its own instruments.
    let text = include_str!("../../../../../launch_configs/diagonals/budget.yaml");
    let text = text.split("instruments:").next().unwrap();
    let text = format!(
        "{text}\ninstruments: {{angular_reference: {{instrument: an encoder, certificate: K 9 of 2026-01-02}}}}\n"
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let found = of(&TestConditions::default(), Some(&budget), Some(&tests));
    let rows = &found.section.tables[0].rows;
    for (name, value) in [
        ("dwell", "2.0 s"),
        ("angular reference", "an encoder"),
        ("angular reference, certificate", "K 9 of 2026-01-02"),
    ] {
        let row = rows.iter().find(|row| row[0] == name);
        assert_eq!(row.map(|row| row[1].as_str()), Some(value), "{rows:?}");
    }
    let kinds = &found.section.figures["instruments"];
    assert_eq!(kinds[0]["kind"], "angular_reference", "{kinds}");
}

fn cell(conditions: &Conditions, name: &str) -> String {
    let mut rows = conditions.section.tables[0].rows.iter();
    rows.find(|row| row[0] == name).unwrap()[1].clone()
}

fn fact(conditions: &Conditions, name: &str) -> String {
    let fact = conditions.facts.iter().find(|(known, _)| known == name);
    fact.unwrap().1.clone()
}

#[test]
fn what_is_not_stated_is_named_with_where_to_state_it() {
    let mut seen = TestConditions::default();
    seen.between = Some((
        Stamp::from_nanos(1_767_600_000_000_000_000),
        Stamp::from_nanos(1_767_603_600_000_000_000),
    ));
    seen.has_length = true;
    seen.feeds_mm_s = vec![100.0];
    let silent = of(&seen, None, None);
    assert_eq!(
        cell(&silent, "date"),
        "2026-01-05 08:00:00 UTC to 2026-01-05 09:00:00 UTC"
    );
    assert_eq!(cell(&silent, "feed"), "6000 mm/min");
    assert_eq!(fact(&silent, "Temperature"), NOT_STATED);
    assert_eq!(
        cell(&silent, "length reference, serial number"),
        "not stated (instruments.length_reference.serial_number in budget.yaml)"
    );
    assert!(cell(&silent, "operator").starts_with("not stated (operator in budget.yaml"));
    for words in ["Temperatures not stated", "Correction to 20 °C: not done"] {
        assert!(silent.terminal().contains(words));
    }
    // What stands before its own instruments.
    let text = include_str!("../../../../../launch_configs/diagonals/budget.yaml");
    let text = text.split("instruments:").next().unwrap();
    let budget = Budget::read(text, Path::new("budget.yaml")).unwrap();
    let stated = of(&seen, Some(&budget), None).terminal();
    let is_stated = stated.contains("no thermometer was read: machine 2");
    assert!(
        is_stated && !stated.contains("Temperatures not stated"),
        "{stated}"
    );
    seen.thermometers
        .insert("bed".to_owned(), Readings::new(21.5));
    let text = format!(
        "{text}\ninstruments: {{length_reference: {{instrument: a laser, serial_number: 12-3, certificate: K 7 of 2026-01-02}}}}\noperator: A. B.\nwarm_up: an hour of G0 along X\n"
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let whole = of(&seen, Some(&budget), None);
    assert_eq!(cell(&whole, "length reference, serial number"), "12-3");
    assert_eq!(whole.section.figures["operator"], "A. B.");
    assert_eq!(fact(&whole, "Operator"), "A. B.");
    let laser = "a laser; serial number 12-3; certificate K 7 of 2026-01-02";
    assert_eq!(fact(&whole, "Length reference"), laser);
    assert_eq!(fact(&whole, "Temperature"), "bed 21.50 to 21.50 °C");
    assert_eq!(
        whole.section.figures["instruments"][0]["certificate"],
        "K 7 of 2026-01-02"
    );
    let terminal = whole.terminal();
    for words in [
        "dwell not stated; production",
        "operator A. B.",
        "bed 21.50 to 21.50 °C (range 0.00 K)",
    ] {
        assert!(terminal.contains(words), "{terminal}");
    }
}
