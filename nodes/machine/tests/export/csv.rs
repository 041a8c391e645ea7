//! The plain table reads back as the same doubles, and its compensation cancels its error.

use machine::export::CrossErrors;
use machine::export::csv::table;
use metrology::{Axis, ErrorComponent};

use crate::slide::{error_mm, left, look_up, measured};

#[test]
fn every_number_reads_back_and_the_compensation_is_what_is_added_to_the_command() {
    let yaw = CrossErrors::new(
        Axis::X,
        Axis::C,
        vec![0.0, 100.0],
        vec![0.0, 1e-5 / 3.0],
        vec![ErrorComponent::motion(Axis::C, Axis::X)],
    );
    let errors = measured(1.0);
    let file = table(std::slice::from_ref(&errors), &[yaw.unwrap()]);
    let mut lines = file.text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == names.len()));
    let cell =
        |row: &[&str], name: &str| row[names.iter().position(|n| *n == name).unwrap()].to_owned();
    let value = |row: &[&str], name: &str| cell(row, name).parse::<f64>().unwrap();

    let own: Vec<&Vec<&str>> = rows.iter().filter(|row| row[0] == "EXX").collect();
    for (row, (at, up)) in own.iter().zip(errors.position().iter().zip(errors.up())) {
        assert_eq!(value(row, "position").to_bits(), at.to_bits());
        assert_eq!(value(row, "error_up").to_bits(), up.to_bits());
    }
    let of = |name: &str| -> Vec<(f64, f64)> {
        own.iter()
            .map(|row| (value(row, "position"), value(row, name)))
            .collect()
    };
    let (up, down) = (of("compensation_up"), of("compensation_down"));
    left(error_mm, |command_mm, is_up| {
        let motor_mm = command_mm + look_up(if is_up { &up } else { &down }, command_mm);
        motor_mm + error_mm(motor_mm, is_up)
    })
    .assert_corrected("CSV", 0.0);

    let last = rows.last().unwrap();
    assert_eq!(
        (
            last[0],
            cell(last, "position_unit"),
            cell(last, "value_unit")
        ),
        ("ECX", "mm".to_owned(), "rad".to_owned())
    );
    assert_eq!(
        value(last, "error_up").to_bits(),
        (1e-5_f64 / 3.0).to_bits()
    );
}
