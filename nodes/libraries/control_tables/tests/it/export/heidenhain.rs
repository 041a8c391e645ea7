//! HEIDENHAIN: a positive value moves the axis the way that was given; the manual's error curve comes out as printed.

use std::collections::BTreeMap;

use control_tables::heidenhain::compensation_table;
use control_tables::{AxisErrors, CrossErrors, Sign};
use metrology::{Axis, ErrorComponent};

use crate::export::slide::{error_mm, left, look_up, measured, positions_mm};

/// Columns by name, as (AXISPOS, value).
fn columns(text: &str) -> BTreeMap<String, Vec<(f64, f64)>> {
    let mut lines = text.lines();
    let begin = lines.next().unwrap();
    assert!(begin.starts_with("BEGIN ") && begin.ends_with("_AXIS.COM MM"));
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
fn eq1_the_table_brings_the_slide_to_the_command_whichever_way_a_control_moves() {
    for (sign, way) in [(Sign::Minus, -1.0), (Sign::Plus, 1.0)] {
        let file = compensation_table("X_AXIS", &measured(1.0), &[], sign).unwrap();
        let said = format!("sign UNPROVEN by any manual seen, given by --sign {sign}");
        assert!(file.notes.iter().any(|note| note.starts_with(&said)));
        assert!(file.notes.iter().any(|note| note.contains("enter 0.010")));
        let columns = columns(&file.text);
        let left = left(error_mm, |command_mm, up| {
            let column = if up { "X" } else { "BACKLASH" };
            let motor_mm = command_mm + way * look_up(&columns[column], command_mm);
            motor_mm + error_mm(motor_mm, up)
        });
        left.assert_corrected("HEIDENHAIN .COM", 1e-4);
    }
}

#[test]
fn val_heidenhain_tnc_306_page_4_21_error_curve_comes_out_as_printed() {
    // Y as a function of Z from -990 mm every 16.384 mm; lines 3 and 4 are left out there, since the control goes straight from
    // line 2 to line 5: -0.1 and -0.11 mm.
    let printed = [0.0, -0.06, -0.09, -0.1, -0.11, -0.12, -0.12, -0.1, -0.09];
    let at: Vec<f64> = (0..9).map(|k| f64::from(k) * 16.384 - 990.0).collect();
    let own = AxisErrors::new(Axis::Z, at.clone(), vec![0.0; 9], vec![0.0; 9]).unwrap();
    let parts = vec![ErrorComponent::motion(Axis::Y, Axis::Z)];
    let of_y = CrossErrors::new(Axis::Z, Axis::Y, at, printed.to_vec(), parts).unwrap();
    let file = compensation_table("Z_AXIS", &own, &[of_y], Sign::Plus).unwrap();
    let columns = columns(&file.text);
    let positions = [
        -990.0, -973.616, -957.232, -940.848, -924.464, -908.08, -891.696, -875.312, -858.928,
    ];
    for ((row, at), value) in columns["C2"].iter().zip(positions).zip(printed) {
        assert!(
            (row.0 - at).abs() < 1e-9 && (row.1 - value).abs() < 1e-9,
            "{row:?}"
        );
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
    let file = compensation_table("X_AXIS", &measured(1.0).mean(), &others, Sign::Plus).unwrap();
    let columns = columns(&file.text);
    assert_eq!(columns.keys().collect::<Vec<_>>(), ["C2", "C6", "X"]);
    // 300 mm out: 6 um of straightness, 30 urad = 0.001719 degree of yaw.
    assert!((columns["C2"][30].1 - 0.006).abs() < 1e-9);
    assert!((columns["C6"][30].1 - 0.001_719).abs() < 1e-9);
    assert!(file.notes.iter().any(|note| note.contains("X_AXIS.C6")));
}
