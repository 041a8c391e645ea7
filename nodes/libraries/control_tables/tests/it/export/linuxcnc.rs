//! LinuxCNC 2.9: `usrmotLoadComp` reads, `compute_screw_comp` interpolates, the trim is added to the motor's command.

use control_tables::AxisErrors;
use control_tables::linuxcnc::{FileType, compensation_file};
use metrology::Axis;

use crate::export::slide::{error_mm, left, look_up, measured};

/// Trims of both directions as motion gets them.
struct Joint {
    up: Vec<(f64, f64)>,
    down: Vec<(f64, f64)>,
}

impl Joint {
    fn load(text: &str, file_type: u8) -> Self {
        let mut joint = Self {
            up: Vec::new(),
            down: Vec::new(),
        };
        for line in text.lines() {
            let words = line.split_whitespace().take(3);
            let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
            let [nominal, forward, reverse] = numbers[..] else {
                break;
            };
            let trim = |number: f64| {
                if file_type == 0 {
                    nominal - number
                } else {
                    number
                }
            };
            joint.up.push((nominal, trim(forward)));
            joint.down.push((nominal, trim(reverse)));
        }
        joint
    }

    fn motor_mm(&self, command_mm: f64, up: bool) -> f64 {
        command_mm + look_up(if up { &self.up } else { &self.down }, command_mm)
    }
}

const BOTH: [FileType; 2] = [FileType::ActualPosition, FileType::Offset];

#[test]
fn eq1_to_eq3_both_types_bring_the_slide_to_the_command_and_double_the_error_when_turned_round() {
    for file_type in BOTH {
        let what = format!("LinuxCNC type {}", file_type.number());
        for sign in [1.0, -1.0] {
            let file = compensation_file(&measured(sign), file_type).unwrap();
            let joint = Joint::load(&file.text, file_type.number());
            assert_eq!(joint.up.len(), 31, "the notes do not hide a point");
            let left = left(error_mm, |command_mm, up| {
                let motor_mm = joint.motor_mm(command_mm, up);
                motor_mm + error_mm(motor_mm, up)
            });
            if sign > 0.0 {
                left.assert_corrected(&what, 1e-6);
            } else {
                left.assert_doubled(&what);
            }
        }
    }
}

#[test]
fn val_linuxcnc_documentation_examples_come_out_as_printed() {
    // INI Configuration, COMP_FILE_TYPE: the two examples.
    let at = vec![-1.0, 0.0, 1.0];
    let type_0 = "-1.000 -1.005 -0.995\n0.000 0.002 -0.003\n1.000 1.003 0.998\n";
    let errors = AxisErrors::new(
        Axis::X,
        at.clone(),
        vec![-0.005, 0.002, 0.003],
        vec![0.005, -0.003, -0.002],
    );
    let file = compensation_file(&errors.unwrap(), FileType::ActualPosition).unwrap();
    assert_eq!(numbers(&file.text), numbers(type_0));
    let type_1 = "-1.000 0.005 -0.005\n0.000 0.002 -0.003\n1.000 0.003 -0.004\n";
    let errors = AxisErrors::new(
        Axis::X,
        at,
        vec![-0.005, -0.002, -0.003],
        vec![0.005, 0.003, 0.004],
    );
    let file = compensation_file(&errors.unwrap(), FileType::Offset).unwrap();
    assert_eq!(numbers(&file.text), numbers(type_1));
}

/// Micrometres of every line before the notes.
fn numbers(text: &str) -> Vec<i64> {
    let lines = text.lines().take_while(|line| !line.starts_with('#'));
    lines
        .flat_map(str::split_whitespace)
        .map(|word| (word.parse::<f64>().unwrap() * 1e6).round() as i64)
        .collect()
}

#[test]
fn a_rotary_axis_is_written_in_degrees() {
    let turn = std::f64::consts::FRAC_PI_2;
    let errors = AxisErrors::new(Axis::C, vec![0.0, turn], vec![0.0, 1e-4], vec![0.0, 1e-4]);
    let file = compensation_file(&errors.unwrap(), FileType::Offset).unwrap();
    let second = file.text.lines().nth(1).unwrap();
    assert_eq!(second, "90.000000 -0.005730 -0.005730");
    assert_eq!(file.name, "c.comp");
}
