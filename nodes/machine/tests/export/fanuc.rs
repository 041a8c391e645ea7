//! FANUC: whole pulses for each interval, counted from the reference point.

use std::collections::BTreeMap;

use machine::export::AxisErrors;
use machine::export::fanuc::{PitchTable, Record, pitch_table};
use metrology::Axis;

use crate::slide::{self, common_mm, left, measured};

const UNIT_MM: f64 = 0.001;

pub fn set_up() -> PitchTable {
    PitchTable {
        reference_number: 40,
        reference: 0.0,
        detection_unit: UNIT_MM,
        magnification: 1,
        max_pulses: 7,
        max_number: 1023,
        record: Record::Plain,
    }
}

/// Pulses by number.
fn record(text: &str) -> BTreeMap<i64, i64> {
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines.first(), lines.last()), (Some(&"%"), Some(&"%")));
    lines[1..lines.len() - 1]
        .iter()
        .map(|line| {
            let (number, value) = line.strip_prefix('N').unwrap().split_once('P').unwrap();
            let number = number.trim_end_matches("Q0").parse::<i64>().unwrap();
            (number - 10_000, value.parse().unwrap())
        })
        .collect()
}

/// Sum of the pulses put out on the way from the reference point, mm.
fn put_out_mm(pulses: &BTreeMap<i64, i64>, command_mm: f64, spacing_mm: f64) -> f64 {
    let number = 40 + (command_mm / spacing_mm).round() as i64;
    let between = |from: i64, to: i64| -> i64 {
        let passed = pulses.iter().filter(|(n, _)| from < **n && **n <= to);
        passed.map(|(_, value)| value).sum()
    };
    let sum = between(40, number) - between(number, 40);
    sum as f64 * UNIT_MM
}

#[test]
fn eq1_to_eq4_the_pulses_bring_the_slide_to_the_command_and_double_the_error_when_turned_round() {
    let error = |at_mm: f64, _: bool| common_mm(at_mm) - common_mm(0.0);
    for sign in [1.0, -1.0] {
        let file = pitch_table(&measured(sign).mean(), &set_up()).unwrap();
        let pulses = record(&file.text);
        assert_eq!(pulses.len(), slide::POINTS - 1);
        assert!(
            file.notes
                .iter()
                .any(|note| note.contains("3620 = 40, 3621 = 26, 3622 = 55, 3623 = 1, 3624 = 20"))
        );
        let left = left(error, |command_mm, up| {
            let motor_mm = command_mm + put_out_mm(&pulses, command_mm, slide::SPACING_MM);
            motor_mm + error(motor_mm, up)
        });
        if sign > 0.0 {
            left.assert_corrected("FANUC pitch table", UNIT_MM);
        } else {
            // Half a pulse of 1 um in an error of 2 um or more.
            println!(
                "FANUC, sign turned round: error times {:.3} to {:.3}",
                left.least_ratio, left.greatest_ratio
            );
            assert!(left.least_ratio > 1.7 && left.greatest_ratio < 2.3);
        }
    }
}

#[test]
fn eq4_rounding_never_adds_up() {
    // 0.4 pulses in each interval: rounded one by one nothing would ever be put out.
    let at: Vec<f64> = (0..=100).map(|k| f64::from(k) * 10.0).collect();
    let e: Vec<f64> = at.iter().map(|p| -0.4e-4 * p).collect();
    let errors = AxisErrors::new(Axis::X, at, e.clone(), e).unwrap();
    let pulses = record(&pitch_table(&errors, &set_up()).unwrap().text);
    assert_eq!(pulses.values().sum::<i64>(), 40);
    assert!(pulses.values().all(|value| (0..=1).contains(value)));
}

#[test]
fn val_fanuc_b_63980_page_100_numbers_and_values_of_the_linear_axis() {
    // Numbers 33 to 49, reference point 40 at 0, first interval at -400 mm.
    let printed = [2, 1, 1, -2, 0, -1, 0, -1, 2, 1, 0, -1, -1, -2, 0, 1, 2];
    let at: Vec<f64> = (0..=17).map(|k| f64::from(k) * 50.0 - 400.0).collect();
    let mut e = vec![0.0];
    for value in printed {
        e.push(e[e.len() - 1] - f64::from(value) * UNIT_MM);
    }
    let errors = AxisErrors::new(Axis::X, at, e.clone(), e).unwrap();
    let pulses = record(&pitch_table(&errors, &set_up()).unwrap().text);
    let numbers: Vec<i64> = pulses.keys().copied().collect();
    assert_eq!(numbers, (33..=49).collect::<Vec<_>>());
    assert_eq!(
        pulses.into_values().collect::<Vec<_>>(),
        printed.map(i64::from)
    );
}

#[test]
fn newer_series_get_the_mark_of_pitch_data() {
    let marked = PitchTable {
        record: Record::Marked,
        ..set_up()
    };
    let file = pitch_table(&measured(1.0).mean(), &marked).unwrap();
    assert!(file.text.lines().nth(1).unwrap().starts_with("N10026Q0P"));
    assert_eq!(record(&file.text).len(), slide::POINTS - 1);
}
