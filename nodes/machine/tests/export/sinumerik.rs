//! SINUMERIK: the leadscrew table alters the actual value, so that the axis moves the other way.

use std::collections::BTreeMap;

use machine::export::AxisErrors;
use machine::export::sinumerik::{
    CrossTable, EncoderTable, OtherAxes, Temperature, direction_tables, encoder_table, temperature,
};
use metrology::sample::{AxisDrift, ThermalModel};
use metrology::stamp::Stamp;
use metrology::{Axis, PerAxis};

use crate::slide::{self, common_mm, error_mm, left, look_up, measured};

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

/// Where the encoder stands: its reading plus the table's value is the command.
fn encoder_mm(table: &[(f64, f64)], command_mm: f64) -> f64 {
    let mut encoder_mm = command_mm;
    for _ in 0..20 {
        encoder_mm = command_mm - look_up(table, encoder_mm);
    }
    encoder_mm
}

#[test]
fn eq1_the_leadscrew_table_brings_the_slide_to_the_command_and_doubles_the_error_when_turned_round()
{
    // What one table for both directions can do: the common part, referenced at 0.
    let error = |at_mm: f64, _: bool| common_mm(at_mm) - common_mm(0.0);
    for sign in [1.0, -1.0] {
        let errors = measured(sign).mean().relative_to(0.0);
        let file = encoder_table(&errors, &set_up()).unwrap();
        assert!(file.text.starts_with("%_N_AX_EEC_INI\nCHANDATA(1)\n"));
        assert!(file.text.ends_with("M17\n"));
        let table = points(&assignments(&file.text), "$AA_ENC_COMP", "0,N,X1", "0,X1");
        assert_eq!(table.len(), slide::POINTS);
        let left = left(error, |command_mm, up| {
            let encoder_mm = encoder_mm(&table, command_mm);
            encoder_mm + error(encoder_mm, up)
        });
        if sign > 0.0 {
            left.assert_corrected("SINUMERIK $AA_ENC_COMP", 1e-6);
        } else {
            left.assert_doubled("SINUMERIK $AA_ENC_COMP");
        }
    }
}

#[test]
fn two_tables_for_the_directions_of_one_axis_correct_its_lost_motion_too() {
    let set_up = CrossTable {
        table: 0,
        max_tables: 8,
        max_points: 200,
        input_axis: "X1".to_owned(),
        output_axis: "X1".to_owned(),
        max_sum: 1.0,
    };
    for sign in [1.0, -1.0] {
        let file = direction_tables(&measured(sign), &set_up).unwrap();
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
        let left = left(error_mm, |command_mm, is_up| {
            let motor_mm = command_mm - look_up(if is_up { &up } else { &down }, command_mm);
            motor_mm + error_mm(motor_mm, is_up)
        });
        if sign > 0.0 {
            left.assert_corrected("SINUMERIK $AN_CEC per direction", 1e-6);
        } else {
            left.assert_doubled("SINUMERIK $AN_CEC per direction");
        }
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
    }
}

#[test]
fn eq1_eq2_the_temperature_line_brings_the_tool_back_to_the_block_and_doubles_the_drift_when_turned_round()
 {
    // A place that read p when cold reads p + d(p) now: told to go to p, the tool stands d(p) short of it.
    let drift_mm = |at_mm: f64| 0.0123 + 4.1e-5 * (at_mm + 220.0);
    for sign in [1.0, -1.0] {
        let file = temperature(&thermal(drift(sign)), Axis::X, &heat()).unwrap();
        let data = assignments(&file.text);
        let of = |name: &str| number(&data, &format!("$SA_TEMP_COMP_{name}[X1]"));
        let value_mm = |at_mm: f64| of("ABS_VALUE") + of("SLOPE") * (at_mm - of("REF_POSITION"));
        let left = left(
            |at_mm, _| -drift_mm(at_mm),
            |command_mm, _| {
                let told_mm = command_mm - value_mm(command_mm);
                told_mm - drift_mm(told_mm)
            },
        );
        if sign > 0.0 {
            left.assert_corrected("SINUMERIK temperature", 1e-6);
        } else {
            left.assert_doubled("SINUMERIK temperature");
        }
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
