//! Extreme numbers in programs: refused with their place, and whatever is taken leaves everything finite and possible.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use fake_cnc::config::Settings;
use fake_cnc::rs274::{bounds, read};
use fake_cnc::{Cnc, Config, Input, Output, Plant, PlantFile};
use machine::MachineFile;
use metrology::stamp::Span;
use metrology::{Host, PerAxis, Stage, Stamp};
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../../launch_configs/first_run/plant.yaml");

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").unwrap()
}

fn refusal(machine: &MachineFile, text: &str) -> String {
    let settings = Settings::new(&Config::default(), machine).unwrap();
    read(text, settings.envelope(), &PerAxis::default())
        .map(|_| ())
        .unwrap_err()
        .to_string()
}

#[test]
fn a_spindle_speed_beyond_the_machine_is_refused_with_its_place() {
    let machine = machine();
    assert_eq!(
        refusal(&machine, "G21 S1000000000 M3\nG4 P120\nM2"),
        "line 1, column 5: spindle speed S1000000000 is beyond the machine's 12000 1/min (spindle.max_speed_rpm of the \
         machine file)"
    );
    assert_eq!(
        refusal(&machine, "G21\n S80000 M3\nM2"),
        "line 2, column 2: spindle speed S80000 is beyond the machine's 12000 1/min (spindle.max_speed_rpm of the \
         machine file)"
    );
    assert!(refusal(&machine, "S12000.1\nM2").contains("line 1, column 1"));
    let zeros = "0".repeat(300);
    let message = refusal(&machine, &format!("G21 S1{zeros} M3\nM2"));
    assert_eq!(
        message,
        "line 1, column 6: number of word S is no finite number that this control can hold: \
         \"10000000000000000000...\", limit 1000000000000"
    );
    let settings = Settings::new(&Config::default(), &machine).unwrap();
    for text in ["S12000 M3\nM2", "S0\nM3\nM2", "M5\nM2"] {
        read(text, settings.envelope(), &PerAxis::default()).unwrap();
    }
    let without = MachineFile {
        spindle: None,
        ..machine
    };
    assert_eq!(
        refusal(&without, "S8000 M3\nM2"),
        "line 1, column 1: spindle speed S8000: the machine file has no spindle; add spindle: {max_speed_rpm: ...} to it"
    );
    let settings = Settings::new(&Config::default(), &without).unwrap();
    read("S0 M3\nM5\nM2", settings.envelope(), &PerAxis::default()).unwrap();
}

/// Programs with a number beyond its bound, and the error; empty: the number is within.
const BOUNDS: [(&str, &str); 15] = [
    (
        "N1000000000 G0 X1\nM2",
        "line 1, column 1: word N = 1000000000: must be from 0 to 999999999",
    ),
    (
        "G1 F9999999 X1\nM2",
        "line 1, column 4: word F = 9999999: must be from 0 to 1000000",
    ),
    (
        "F50000 G1 X1\nM2",
        "line 1, column 8: G1 at 50000 mm/min: the axes together reach 32015.6 mm/min at most",
    ),
    (
        "F20000 G1 A1\nM2",
        "line 1, column 8: G1 at 20000 deg/min: the axes together reach 16099.7 deg/min at most",
    ),
    ("G20 F1500 G1 X1\nM2", ""),
    (
        "G20\nF1500 G1 X1\nM2",
        "line 2, column 7: G1 at 38100 mm/min: the axes together reach 32015.6 mm/min at most",
    ),
    (
        "G4 P86401\nM2",
        "line 1, column 4: word P = 86401: must be from 0 to 86400 s, a day, of a dwell",
    ),
    (
        "G4 P-1\nM2",
        "line 1, column 4: word P = -1: must be from 0 to 86400 s, a day, of a dwell",
    ),
    (
        "P2000000 G04\nM2",
        "line 1, column 1: word P = 2000000: must be from 0 to 86400 s, a day, of a dwell",
    ),
    (
        "G0 X5000000\nM2",
        "line 1, column 4: word X = 5000000: must be from -1000000 to 1000000",
    ),
    (
        "F100 G2 X1 I9000000\nM2",
        "line 1, column 12: word I = 9000000: must be from -1000000 to 1000000",
    ),
    (
        "F100 G2 I1 P10001\nM2",
        "line 1, column 12: word P = 10001: must be a whole number of turns from 1 to 10000",
    ),
    (
        "G43 H-1\nM2",
        "line 1, column 5: word H = -1: must be a whole number from 0 to 1000000",
    ),
    (
        "G10 L2.5 P1 X1\nM2",
        "line 1, column 5: word L = 2.5: must be a whole number from 0 to 1000000",
    ),
    (
        "G64 P-1\nM2",
        "line 1, column 5: word P = -1: must be from 0 to 1000000",
    ),
];

#[test]
fn every_word_has_a_bound_that_is_told_with_place_and_value() {
    let machine = machine();
    for (text, message) in BOUNDS {
        if message.is_empty() {
            let settings = Settings::new(&Config::default(), &machine).unwrap();
            read(text, settings.envelope(), &PerAxis::default()).unwrap();
        } else {
            assert_eq!(refusal(&machine, text), message);
        }
    }
}

#[test]
fn programs_and_lines_have_a_length() {
    let machine = machine();
    let long = format!("G0 X1 ({})\nM2", "x".repeat(1000));
    assert_eq!(
        refusal(&machine, &long),
        "line 1: longer than 1000 characters"
    );
    let lines = "\n".repeat(bounds::LINES as usize) + "M2";
    assert_eq!(
        refusal(&machine, &lines),
        "line 1000001: more than 1000000 lines"
    );
    // Many steps on few lines.
    let zeros = format!("{}\n", "(zero: grid)".repeat(83)).repeat(12_049);
    assert_eq!(
        refusal(&machine, &format!("{zeros}M2")),
        "line 12049: more than 1000000 steps"
    );
    let features = format!("{}\n", "(feature:a)".repeat(90)).repeat(11_112);
    assert_eq!(
        refusal(&machine, &format!("{features}M2")),
        "line 11112: more than 1000000 feature comments"
    );
}

/// A number as a typing error, a unit error or malice makes it.
fn number(random: &mut Pcg64Mcg) -> String {
    let small = random.random_range(-50.0..50.0_f64);
    match random.random_range(0..10) {
        0..=4 => format!("{small:.3}"),
        5 => format!("{:.0}", 10f64.powi(random.random_range(2..9))),
        6 => format!("-{}", "9".repeat(random.random_range(1..330))),
        7 => format!("0.{}1", "0".repeat(random.random_range(0..320))),
        8 => "0".to_owned(),
        _ => format!("{:.0}", small * 100.0),
    }
}

fn program(random: &mut Pcg64Mcg) -> String {
    const WORDS: [&str; 27] = [
        "G0",
        "G1",
        "G2",
        "G3",
        "G4",
        "G10 L2 P1",
        "G10 L2 P2",
        "G17",
        "G18",
        "G19",
        "G20",
        "G21",
        "G38.3",
        "G43.1",
        "G49",
        "G52",
        "G53 G0",
        "G54",
        "G55",
        "G90",
        "G91",
        "G90.1",
        "G91.1",
        "G92",
        "M3",
        "G61.1",
        "G92.3",
    ];
    const LETTERS: [&str; 13] = [
        "X", "Y", "Z", "A", "C", "I", "J", "K", "R", "P", "F", "S", "H",
    ];
    let mut text = String::from("G1 F3000\n");
    for _ in 0..random.random_range(1..6) {
        text += WORDS.choose(random).unwrap();
        for _ in 0..random.random_range(0..4) {
            let letter = LETTERS.choose(random).unwrap();
            text += &format!(" {letter}{}", number(random));
        }
        text += "\n";
    }
    text + "M2"
}

/// Whether every number that the control puts out is one that a machine of this kind can have.
fn check(output: &Output, machine: &MachineFile) -> Result<(), String> {
    let wrong = |what: &str, value: f64| Err(format!("{what} = {value}"));
    match output {
        Output::State(state) => {
            for axis in machine.axis_set().iter() {
                let value = state.commanded[axis];
                let [least, greatest] =
                    machine
                        .axes
                        .get(&axis)
                        .map_or([0.0; 2], |entry| match entry {
                            machine::file::AxisEntry::Linear(linear) => linear.travel_mm,
                            machine::file::AxisEntry::Rotary(rotary) => {
                                rotary.travel_deg.map(f64::to_radians)
                            }
                        });
                if !(least - 1e-6..=greatest + 1e-6).contains(&value) {
                    return wrong("commanded", value);
                }
                let motor = state.motor[axis];
                if (motor - value).abs() >= 2.0 || !motor.is_finite() {
                    return wrong("motor", motor);
                }
                if !state.velocity[axis].is_finite() {
                    return wrong("velocity", state.velocity[axis]);
                }
            }
            Ok(())
        }
        Output::Temperature(sample) if !(0.0..150.0).contains(&sample.temperature_degc) => {
            wrong("temperature", sample.temperature_degc)
        }
        Output::Trigger(trigger) if !trigger.feed_mm_s.is_finite() => {
            wrong("feed", trigger.feed_mm_s)
        }
        _ => Ok(()),
    }
}

/// Lets time pass in ticks of 50 ms.
fn pass(cnc: &mut Cnc, now: &mut Stamp<Host>, seconds: f64, out: &mut Vec<Output>) {
    let end = *now + Span::from_secs_f64(seconds);
    while *now < end {
        *now += Span::from_nanos(50_000_000);
        cnc.step(*now, Input::Tick, out).unwrap();
    }
}

#[test]
fn prop_no_program_makes_a_position_a_temperature_or_a_time_that_no_machine_has() {
    let machine = machine();
    let plant = Plant::new(&machine, &PlantFile::from_yaml(PLANT).unwrap()).unwrap();
    let config = Config {
        background_rate_hz: 100.0,
        ..Config::default()
    };
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let mut fresh = Cnc::new(&config, &machine, plant).unwrap();
    let mut now = Stamp::from_nanos(0);
    let mut out = Vec::new();
    fresh.step(now, Input::Tick, &mut out).unwrap();
    let mut cnc = fresh.clone();
    let (mut accepted, mut refused) = (0, 0);
    for case in 0..3000_u64 {
        let text = program(&mut random);
        out.clear();
        let goal = case + 1;
        cnc.step(
            now,
            Input::RunProgram {
                goal,
                text: text.clone(),
                name: String::new(),
            },
            &mut out,
        )
        .unwrap();
        let was_refused = out.iter().any(
            |output| matches!(output, Output::Finished { message, .. } if message.contains("line")),
        );
        if was_refused {
            refused += 1;
            continue;
        }
        accepted += 1;
        pass(&mut cnc, &mut now, 1.5, &mut out);
        cnc.step(now, Input::CancelProgram { goal }, &mut out)
            .unwrap();
        pass(&mut cnc, &mut now, 2.0, &mut out);
        for output in &out {
            if let Err(wrong) = check(output, &machine) {
                panic!("{wrong}: {text}");
            }
        }
        let registers = cnc.registers();
        let origin = registers.in_use().origin;
        assert!(
            origin
                .0
                .iter()
                .chain(&registers.shift.0)
                .all(|value| value.abs() < 1e9)
        );
        assert!(cnc.idle(), "{text}");
        if case % 10 == 0 {
            cnc = fresh.clone();
            now = Stamp::from_nanos(0);
        }
    }
    assert!(accepted > 100 && refused > 1000, "{accepted} {refused}");
}

#[test]
fn a_spindle_that_would_melt_the_plant_is_refused_with_both_files_numbers() {
    let plant = PlantFile::from_yaml(PLANT).unwrap();
    let at = |max_speed_rpm| MachineFile {
        spindle: Some(machine::file::SpindleEntry { max_speed_rpm }),
        ..machine()
    };
    assert!(Plant::new(&at(30_000.0), &plant).is_ok());
    let error = Plant::new(&at(400_000.0), &plant).unwrap_err().to_string();
    assert!(
        error.contains("spindle.max_speed_rpm = 400000 1/min, spindle_front settles at")
            && error.contains("must be at most 300"),
        "{error}"
    );
    let absurd = PLANT.replacen("motor_exponent: 1.2", "motor_exponent: 9.0", 1);
    let error = Plant::new(&machine(), &PlantFile::from_yaml(&absurd).unwrap()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "heat.spindle.motor_exponent = 9: must be from 1e-6 to 5"
    );
}
