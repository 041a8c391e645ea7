//! HEIDENHAIN: a column is a curve of the error, which the control takes off the command.

use std::collections::BTreeMap;

use machine::export::CrossErrors;
use machine::export::heidenhain::compensation_table;
use metrology::{Axis, ErrorComponent};

use crate::slide::{error_mm, left, look_up, measured, positions_mm};

/// Columns by name, as (AXISPOS, value).
fn columns(text: &str) -> BTreeMap<String, Vec<(f64, f64)>> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("BEGIN X_AXIS.COM MM"));
    let names: Vec<&str> = lines.next().unwrap().split_whitespace().collect();
    assert_eq!(names[..2], ["NR", "AXISPOS"]);
    let mut columns: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    for (row, line) in lines
        .by_ref()
        .take_while(|line| *line != "[END]")
        .enumerate()
    {
        let cells: Vec<f64> = line
            .split_whitespace()
            .map(|cell| cell.parse().unwrap())
            .collect();
        assert_eq!(cells.len(), names.len());
        assert_eq!(cells[0] as usize, row);
        for (name, value) in names.iter().zip(&cells).skip(2) {
            columns
                .entry((*name).to_owned())
                .or_default()
                .push((cells[1], *value));
        }
    }
    assert_eq!(lines.next(), None, "[END] ends it");
    columns
}

#[test]
fn eq1_the_table_brings_the_slide_to_the_command_in_both_directions_and_doubles_the_error_when_turned_round()
 {
    for sign in [1.0, -1.0] {
        let file = compensation_table("X_AXIS", &measured(sign), &[]).unwrap();
        let columns = columns(&file.text);
        let left = left(error_mm, |command_mm, up| {
            let column = if up { "X" } else { "BACKLASH" };
            let motor_mm = command_mm - look_up(&columns[column], command_mm);
            motor_mm + error_mm(motor_mm, up)
        });
        if sign > 0.0 {
            left.assert_corrected("HEIDENHAIN .COM", 1e-4);
        } else {
            left.assert_doubled("HEIDENHAIN .COM");
        }
    }
}

#[test]
fn other_errors_of_the_axis_stand_in_the_columns_of_kinematicscomp_lengths_in_mm_angles_in_degrees()
{
    let at = positions_mm();
    let curve = |direction, scale: f64| {
        let error = at.iter().map(|p| scale * p).collect();
        let parts = vec![ErrorComponent::motion(direction, Axis::X)];
        CrossErrors::new(Axis::X, direction, at.clone(), error, parts).unwrap()
    };
    let others = [curve(Axis::Y, 2e-5), curve(Axis::C, 1e-7)];
    let file = compensation_table("X_AXIS", &measured(1.0).mean(), &others).unwrap();
    let columns = columns(&file.text);
    assert_eq!(columns.keys().collect::<Vec<_>>(), ["C2", "C6", "X"]);
    // 300 mm out: 6 um of straightness, 30 urad = 0.001719 degree of yaw.
    assert!((columns["C2"][30].1 - 0.006).abs() < 1e-9);
    assert!((columns["C6"][30].1 - 0.001_719).abs() < 1e-9);
    assert!(file.notes.iter().any(|note| note.contains("X_AXIS.C6")));
}
