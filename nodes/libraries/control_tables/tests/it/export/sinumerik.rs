//! SINUMERIK: which way a value moves an axis is what its manuals say in words; examples are as they print them.

use std::collections::BTreeMap;

use control_tables::sinumerik::{
    CrossTable, EncoderTable, OtherAxes, Temperature, cross_table, direction_tables, encoder_table,
    temperature,
};
use control_tables::{AxisErrors, CrossErrors, Sign};
use metrology::sample::{AxisDrift, ThermalModel};
use metrology::stamp::Stamp;
use metrology::{Axis, ErrorComponent, PerAxis};

use crate::export::slide::{self, common_mm, error_mm, left, look_up, measured};

/// `NAME[index]=value` lines without comments.
pub fn assignments(text: &str) -> BTreeMap<String, String> {
    text.lines()
        .map(|line| line.split(';').next().unwrap().trim())
        .filter_map(|line| line.split_once('='))
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect()
}

pub fn number(data: &BTreeMap<String, String>, name: &str) -> f64 {
    data.get(name)
        .unwrap_or_else(|| panic!("{name}"))
        .parse()
        .unwrap()
}

/// The points of a table from its first position, spacing and values.
pub fn points(
    data: &BTreeMap<String, String>,
    family: &str,
    value: &str,
    index: &str,
) -> Vec<(f64, f64)> {
    let of = |name: &str| number(data, &format!("{family}_{name}[{index}]"));
    let (least, greatest, step) = (of("MIN"), of("MAX"), of("STEP"));
    let k = ((greatest - least) / step).round() as usize;
    (0..=k)
        .map(|n| {
            let name = value.replace('N', &n.to_string());
            (
                least + step * n as f64,
                number(data, &format!("{family}[{name}]")),
            )
        })
        .collect()
}

fn set_up() -> EncoderTable {
    EncoderTable {
        machine_axis: "X1".to_owned(),
        encoder: 0,
        max_points: 200,
        reference: 0.0,
    }
}

/// Motion of an axis by a value of its leadscrew table. 6FC5397-1BP40-3BA1, 03/2013, K3 4.4.2.1 p. 238: "A positive compensation value
/// causes the corresponding machine axis to move in the negative direction."
fn moved_by_leadscrew_mm(value_mm: f64) -> f64 {
    -value_mm
}

/// Motion of the output axis by a value of a cross-axis table. 6FC5397-1BP10-4BA0, 03/2009, K3 5.4.3 p. 372: "This compensation is
/// sent to the position control loop as an additional setpoint. A positive compensation value causes the corresponding machine axis to
/// move in the negative direction."
pub fn moved_by_cross_mm(value_mm: f64) -> f64 {
    -value_mm
}

#[test]
fn eq1_moved_as_page_238_says_the_leadscrew_table_brings_the_slide_to_the_command() {
    // What one table for both directions can do: the common part, referenced at 0.
    let error = |at_mm: f64, _: bool| common_mm(at_mm) - common_mm(0.0);
    let errors = measured(1.0).mean().relative_to(0.0);
    let file = encoder_table(&errors, &set_up()).unwrap();
    assert!(file.text.starts_with("%_N_AX_EEC_INI\nCHANDATA(1)\n"));
    assert!(file.text.ends_with("M17\n"));
    assert!(file.text.contains("sign proven by: ") && file.text.contains("p. 238"));
    assert!(file.text.contains("0.010 at one node"), "{}", file.text);
    let table = points(&assignments(&file.text), "$AA_ENC_COMP", "0,N,X1", "0,X1");
    assert_eq!(table.len(), slide::POINTS);
    left(error, |command_mm, up| {
        // The value is looked up where the encoder stands.
        let mut encoder_mm = command_mm;
        for _ in 0..20 {
            encoder_mm = command_mm + moved_by_leadscrew_mm(look_up(&table, encoder_mm));
        }
        encoder_mm + error(encoder_mm, up)
    })
    .assert_corrected("SINUMERIK $AA_ENC_COMP", 1e-6);
}

#[test]
fn moved_as_page_372_says_two_tables_for_the_directions_of_one_axis_correct_its_lost_motion_too() {
    let file = direction_tables(&measured(1.0), &one_axis()).unwrap();
    assert!(file.text.contains("sign proven by: ") && file.text.contains("p. 372"));
    let data = assignments(&file.text);
    let table = |direction: f64| {
        let t = (0..2)
            .find(|t| {
                number(&data, &format!("$AN_CEC_DIRECTION[{t}]"))
                    .total_cmp(&direction)
                    .is_eq()
            })
            .unwrap();
        points(&data, "$AN_CEC", &format!("{t},N"), &t.to_string())
    };
    let (up, down) = (table(1.0), table(-1.0));
    // Its input is the setpoint.
    left(error_mm, |command_mm, is_up| {
        let value_mm = look_up(if is_up { &up } else { &down }, command_mm);
        let motor_mm = command_mm + moved_by_cross_mm(value_mm);
        motor_mm + error_mm(motor_mm, is_up)
    })
    .assert_corrected("SINUMERIK $AN_CEC per direction", 1e-6);
}

fn one_axis() -> CrossTable {
    CrossTable {
        table: 0,
        max_tables: 8,
        max_points: 200,
        input_axis: "X1".to_owned(),
        output_axis: "X1".to_owned(),
        max_sum: 1.0,
    }
}

/// An error of `direction` along Y.
fn along_y(direction: Axis, at: Vec<f64>, error: Vec<f64>) -> CrossErrors {
    let parts = vec![ErrorComponent::motion(direction, Axis::Y)];
    CrossErrors::new(Axis::Y, direction, at, error, parts).unwrap()
}

#[test]
fn val_sinumerik_k3_page_243_the_arm_that_sags_is_lifted() {
    // "The further the machining head moves in the negative Y1 axis direction, the more the cross-arm sags in the negative Z1 axis
    // direction": 10 um down 400 mm out. Lifted means moved in the positive direction, by page 372 a negative value.
    let at: Vec<f64> = (0..=8).map(|k| f64::from(k) * 50.0 - 400.0).collect();
    let sag: Vec<f64> = at.iter().map(|y| -0.010 * (y / 400.0).powi(2)).collect();
    let names = CrossTable {
        input_axis: "Y1".to_owned(),
        output_axis: "Z1".to_owned(),
        ..one_axis()
    };
    let file = cross_table(&along_y(Axis::Z, at, sag), &names).unwrap();
    let data = assignments(&file.text);
    assert_eq!(data["$AN_CEC[0,0]"], "-0.010000");
    assert!(moved_by_cross_mm(number(&data, "$AN_CEC[0,0]")) > 0.0);
    assert_eq!(data["$AN_CEC[0,8]"], "0.000000");
}

#[test]
fn val_sinumerik_802d_page_222_example_has_the_lines_of_the_manual() {
    // 6FC5397-1CP10-5BA0, 11.3 p. 222. The printed end, 400 mm, is not 350 points of 6.73 mm from -400 mm: it is not compared.
    let at: Vec<f64> = (0..350).map(|k| f64::from(k) * 6.73 - 400.0).collect();
    let mut e = vec![0.0; 350];
    e[1..3].copy_from_slice(&[0.010, 0.012]);
    let names = CrossTable {
        max_points: 350,
        input_axis: "AX2".to_owned(),
        output_axis: "AX1".to_owned(),
        ..one_axis()
    };
    let data = assignments(&cross_table(&along_y(Axis::X, at, e), &names).unwrap().text);
    for (name, printed) in [
        ("$AN_CEC[0,0]", 0.0),
        ("$AN_CEC[0,1]", 0.01),
        ("$AN_CEC[0,2]", 0.012),
        ("$AN_CEC[0,349]", 0.0),
        ("$AN_CEC_STEP[0]", 6.73),
        ("$AN_CEC_MIN[0]", -400.0),
        ("$AN_CEC_DIRECTION[0]", 0.0),
        ("$AN_CEC_MULT_BY_TABLE[0]", 0.0),
        ("$AN_CEC_IS_MODULO[0]", 0.0),
    ] {
        assert!((number(&data, name) - printed).abs() < 1e-9, "{name}");
    }
    assert_eq!(data["$AN_CEC_INPUT_AXIS[0]"], "(AX2)");
    assert_eq!(data["$AN_CEC_OUTPUT_AXIS[0]"], "(AX1)");
}

#[test]
fn val_sinumerik_k3_page_264_example_has_the_points_of_the_manual() {
    // 11 points of X for each direction, printed from -585 to -5.
    let at = vec![
        -585.0, -527.0, -469.0, -411.0, -353.0, -295.0, -237.0, -179.0, -121.0, -63.0, -5.0,
    ];
    let errors = AxisErrors::new(Axis::X, at, vec![0.001; 11], vec![-0.001; 11]).unwrap();
    let set_up = CrossTable {
        max_points: 11,
        ..one_axis()
    };
    let data = assignments(&direction_tables(&errors, &set_up).unwrap().text);
    for (table, direction) in [(0, 1.0), (1, -1.0)] {
        for (name, printed) in [
            ("STEP", 58.0),
            ("MIN", -585.0),
            ("MAX", -5.0),
            ("DIRECTION", direction),
        ] {
            let seen = number(&data, &format!("$AN_CEC_{name}[{table}]"));
            assert!((seen - printed).abs() < 1e-9, "{name}[{table}] {seen}");
        }
        assert!(data.contains_key(&format!("$AN_CEC[{table},10]")));
        assert!(!data.contains_key(&format!("$AN_CEC[{table},11]")));
    }
}

#[test]
fn val_sinumerik_k3_page_242_example_has_the_lines_of_the_manual() {
    // 801 points from -200 to 600 mm; of the values the manual prints the first three and the last.
    let at: Vec<f64> = (0..=800).map(|k| f64::from(k) - 200.0).collect();
    let mut e = vec![0.0; 801];
    e[..3].copy_from_slice(&[0.003, 0.010, 0.012]);
    let errors = AxisErrors::new(Axis::X, at, e.clone(), e).unwrap();
    let set_up = EncoderTable {
        max_points: 801,
        ..set_up()
    };
    let data = assignments(&encoder_table(&errors, &set_up).unwrap().text);
    let printed = [
        ("$AA_ENC_COMP[0,0,X1]", 0.003),
        ("$AA_ENC_COMP[0,1,X1]", 0.01),
        ("$AA_ENC_COMP[0,2,X1]", 0.012),
        ("$AA_ENC_COMP[0,800,X1]", 0.0),
        ("$AA_ENC_COMP_STEP[0,X1]", 1.0),
        ("$AA_ENC_COMP_MIN[0,X1]", -200.0),
        ("$AA_ENC_COMP_MAX[0,X1]", 600.0),
        ("$AA_ENC_COMP_IS_MODULO[0,X1]", 0.0),
    ];
    for (name, value) in printed {
        assert!((number(&data, name) - value).abs() < 1e-12, "{name}");
    }
    assert_eq!(data.len(), 805);
}

/// Drift of a fixed place's reading.
pub fn drift(sign: f64) -> AxisDrift {
    AxisDrift {
        p0_mm: -220.0,
        k0_mm: sign * 0.0123,
        slope_mm_per_mm: sign * 4.1e-5,
        offset_identifiable: true,
        slope_identifiable: true,
        ..AxisDrift::default()
    }
}

pub fn thermal(drift: AxisDrift) -> ThermalModel {
    let mut axes = PerAxis::default();
    axes[Axis::X] = Some(drift);
    ThermalModel {
        at: Stamp::from_nanos(1),
        axes,
        valid_from: Stamp::from_nanos(1),
        valid_until: Stamp::from_nanos(900_000_000_001),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    }
}

pub fn heat() -> Temperature {
    Temperature {
        machine_axis: "X1".to_owned(),
        max_slope: 1e-3,
        other_axes: OtherAxes::Refuse,
        sign: Some(Sign::Minus),
    }
}

#[test]
fn eq1_eq2_the_temperature_line_brings_the_tool_back_to_the_block_whichever_way_a_control_moves() {
    // A place that read p when cold reads p + d(p) now: told to go to p, the tool stands d(p) short of it.
    let drift_mm = |at_mm: f64| 0.0123 + 4.1e-5 * (at_mm + 220.0);
    for (sign, way) in [(Sign::Minus, -1.0), (Sign::Plus, 1.0)] {
        let set_up = Temperature {
            sign: Some(sign),
            ..heat()
        };
        let file = temperature(&thermal(drift(1.0)), Axis::X, &set_up).unwrap();
        let said = format!("sign UNPROVEN by any manual seen, given by --sign {sign}");
        assert!(file.text.contains(&said), "{}", file.text);
        let data = assignments(&file.text);
        let of = |name: &str| number(&data, &format!("$SA_TEMP_COMP_{name}[X1]"));
        let value_mm = |at_mm: f64| of("ABS_VALUE") + of("SLOPE") * (at_mm - of("REF_POSITION"));
        let left = left(
            |at_mm, _| -drift_mm(at_mm),
            |command_mm, _| {
                let told_mm = command_mm + way * value_mm(command_mm);
                told_mm - drift_mm(told_mm)
            },
        );
        left.assert_corrected("SINUMERIK temperature", 1e-6);
    }
}

#[test]
fn a_shift_without_slope_says_so() {
    let shift = AxisDrift {
        slope_identifiable: false,
        slope_mm_per_mm: 0.0,
        ..drift(1.0)
    };
    let file = temperature(&thermal(shift), Axis::X, &heat()).unwrap();
    assert!(file.text.contains("$SA_TEMP_COMP_SLOPE[X1]=0.000000000"));
    assert!(file.text.contains("a pure shift"));
}
