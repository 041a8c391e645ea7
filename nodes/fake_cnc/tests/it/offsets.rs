//! Coordinates of programs: work systems, G92, G52, rotation, tool length, against LinuxCNC's interpreter and by hand.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use fake_cnc::ProgramError;
use fake_cnc::path::{AxisLimits, Segment, target};
use fake_cnc::rs274::program::{Action, Motion, Program};
use fake_cnc::rs274::registers::{Change, WorkSystem};
use fake_cnc::rs274::{Envelope, Registers, read, read_in};
use metrology::{Axis, PerAxis};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const OFFSETS: &str = include_str!("../data/linuxcnc_offsets.tsv");
/// Four decimals of an inch in each of three offsets, turned.
const ROUNDING_MM: f64 = 0.01;

fn envelope() -> Envelope {
    Envelope {
        axes: [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C]
            .into_iter()
            .collect(),
        travel: PerAxis::from_fn(|_| [-1e5, 1e5]),
        speed: PerAxis::from_fn(|_| f64::INFINITY),
        spindle_limit_rpm: Some(12_000.0),
        tool_lengths_mm: vec![12.9794, 80.0],
    }
}

fn check(text: &str) -> Result<Program, ProgramError> {
    read(text, &envelope(), &PerAxis::default())
}

fn refusal(text: &str) -> String {
    check(text).unwrap_err().to_string()
}

fn motions(program: &Program) -> Vec<Motion> {
    let motion = |action: &Action| match action {
        Action::Move(motion) | Action::Touch(motion, _) => Some(*motion),
        _ => None,
    };
    program
        .steps
        .iter()
        .filter_map(|step| motion(&step.action))
        .collect()
}

/// Where each motion ends in machine coordinates; a touch ends at its target.
fn ends(text: &str) -> Vec<PerAxis<f64>> {
    let mut at = PerAxis::default();
    motions(&check(text).unwrap())
        .iter()
        .map(|motion| {
            at = target(motion, &at);
            at
        })
        .collect()
}

/// State after the whole program.
fn registers(found: Registers, text: &str) -> Registers {
    let program = read_in(text, &envelope(), &PerAxis::default(), &found).unwrap();
    let mut registers = found;
    for step in &program.steps {
        if let Action::Set(change) = &step.action {
            registers.apply(change);
        }
    }
    registers
}

fn compare(name: &str, text: &str, calls: &str) -> usize {
    let program = check(text).unwrap_or_else(|error| panic!("{name}: {error}"));
    let motions = motions(&program);
    let calls: Vec<&str> = calls.split("; ").filter(|call| !call.is_empty()).collect();
    assert_eq!(motions.len(), calls.len(), "{name}: {text}");
    let mut at = PerAxis::default();
    for (motion, call) in motions.iter().zip(&calls) {
        let (end, centre) = call.split_once(" centre ").unwrap_or((call, ""));
        let numbers = |text: &str| -> Vec<f64> {
            text.split_whitespace()
                .filter_map(|number| number.parse().ok())
                .collect()
        };
        let from = at;
        at = target(motion, &from);
        for (axis, theirs) in Axis::ALL.into_iter().zip(numbers(end)) {
            let ours = if axis.is_linear() {
                at[axis]
            } else {
                at[axis].to_degrees()
            };
            assert!(
                (ours - theirs).abs() < ROUNDING_MM,
                "{name}: {axis}: {ours}, LinuxCNC: {theirs}: {text}"
            );
        }
        if let Some(arc) = motion.arc {
            let [first, second, _] = arc.plane.axes();
            let theirs = numbers(centre);
            for (axis, ours) in [first, second].into_iter().zip(arc.centre_from_start_mm) {
                let (ours, theirs) = (from[axis] + ours, theirs[axis.index()]);
                assert!(
                    (ours - theirs).abs() < ROUNDING_MM,
                    "{name}: {ours} {theirs}"
                );
            }
        }
        if call.starts_with("touch") {
            // The stand-alone interpreter lets every touch succeed 0.01 inch early.
            let way = at.xyz() - from.xyz();
            let stop = at.xyz() - way.normalize() * 0.254;
            at.0[..3].copy_from_slice(stop.as_slice());
        }
    }
    calls.len()
}

#[test]
fn val_linuxcnc_leads_to_the_same_places_of_the_machine() {
    let (mut accepted, mut refused, mut moved) = (0, 0, 0);
    for row in OFFSETS.lines().filter(|row| !row.starts_with('#')) {
        let columns: Vec<&str> = row.split('\t').collect();
        let [name, text, verdict, rest] = columns[..] else {
            panic!("{row}");
        };
        let text = text.replace('|', "\n");
        if verdict == "accepts" {
            moved += compare(name, &text, rest);
            accepted += 1;
        } else {
            assert!(check(&text).is_err(), "{name}: accepted, LinuxCNC: {rest}");
            refused += 1;
        }
    }
    assert!(accepted >= 230 && refused >= 20 && moved >= 700);
}

/// An end in X, Y, Z, mm.
fn close(end: &PerAxis<f64>, wanted: [f64; 3]) {
    let off = (end.xyz() - nalgebra::Vector3::from(wanted)).norm();
    assert!(off < 1e-9, "{end:?} {wanted:?}");
}

#[test]
fn g92_by_hand() {
    // LinuxCNC's own example: at X4, G92 X7 makes the offset -3.
    let all = ends("G0 X4\nG92 X7\nG0 X0\nM2");
    close(&all[1], [-3.0, 0.0, 0.0]);
    let state = registers(Registers::default(), "G0 X4\nG92 X7\nM2");
    assert!((state.shift[Axis::X] + 3.0).abs() < 1e-12);
    // A second one adds to the first: the point keeps its place in the machine.
    let all = ends("G0 X4\nG92 X7\nG92 X1\nG0 X2\nM2");
    close(&all[1], [5.0, 0.0, 0.0]);
    // In a system that is turned by 90 degrees the program's X is the machine's Y.
    let all = ends("G10 L2 P1 X10 Y20 R90\nG0 X1 Y2\nG92 X0 Y0\nG0 X5\nM2");
    close(&all[0], [8.0, 21.0, 0.0]);
    close(&all[1], [8.0, 26.0, 0.0]);
    // G92.2 suspends, G92.3 takes up again, G92.1 forgets.
    let all = ends("G0 X4\nG92 X0\nG92.2\nG0 X1\nG92.3\nX1\nG92.1\nX1 Y1\nG92.3\nX1 Y2\nM2");
    close(&all[1], [1.0, 0.0, 0.0]);
    close(&all[2], [5.0, 0.0, 0.0]);
    close(&all[3], [1.0, 1.0, 0.0]);
    close(&all[4], [1.0, 2.0, 0.0]);
    // G52 shares the storage: it replaces G92, axis by axis.
    let all = ends("G0 X4\nG92 X0\nG52 Y1\nG0 X0 Y0\nG52 X0 Y0\nX0 Y0\nM2");
    close(&all[1], [4.0, 1.0, 0.0]);
    close(&all[2], [0.0, 0.0, 0.0]);
}

#[test]
fn m2_resets_what_linuxcnc_resets_and_nothing_else() {
    let mut state = registers(
        Registers::default(),
        "G20 G18 G91 G90.1 G61.1\nG10 L2 P3 X1 R5\nG56\nG92 X1\nG43.1 Z2\nM2",
    );
    let before = state;
    assert_eq!(state.system, 2);
    state.end_program();
    let mut wanted = before;
    wanted.system = 0;
    wanted.modes.plane = fake_cnc::rs274::program::Plane::Xy;
    wanted.modes.is_incremental = false;
    assert_eq!(state, wanted);
    assert!(state.modes.is_inch && state.modes.has_absolute_centres);
    assert!(state.shift[Axis::X] != 0.0 && state.tool[Axis::Z] != 0.0);
}

#[test]
fn a_state_is_taken_up_by_the_next_program() {
    let found = registers(
        Registers::default(),
        "G10 L2 P1 X10\nG10 L2 P2 X100\nG55 G20 G91\nM2",
    );
    let text = "G0 X1\nG90 X1\nG54 X1\nM2";
    let program = read_in(text, &envelope(), &PerAxis::default(), &found).unwrap();
    let mut at = PerAxis::default();
    let each: Vec<f64> = motions(&program)
        .iter()
        .map(|motion| {
            at = target(motion, &at);
            at[Axis::X]
        })
        .collect();
    assert!((each[0] - 25.4).abs() < 1e-12);
    assert!((each[1] - 125.4).abs() < 1e-12);
    assert!((each[2] - 35.4).abs() < 1e-12);
}

#[test]
fn offsets_are_refused_with_place_and_remedy() {
    let cases = [
        (
            "G93\nM2",
            "line 1, column 1: G93 is not executed by this control: feeds are per minute (G94)",
        ),
        (
            "G95 M2",
            "line 1, column 1: G95 is not executed by this control: feeds are per minute (G94)",
        ),
        (
            "G41 D1\nM2",
            "line 1, column 1: G41 is not executed by this control: cutter compensation is always off (G40)",
        ),
        (
            "G43.2 H1\nM2",
            "line 1, column 1: G43.2 is not executed by this control: give the whole offset by G43.1",
        ),
        (
            "G43\nM2",
            "line 1, column 1: G43 needs H, the number of a tool; this control has no tool changer",
        ),
        (
            "G43 H3\nM2",
            "line 1, column 5: H3: the control knows the tools H0 to H2 (tool_lengths_mm of its parameters)",
        ),
        (
            "G43 H1.5\nM2",
            "line 1, column 5: word H = 1.5: must be a whole number from 0 to 1000000",
        ),
        (
            "G10 L20 P1 X0\nM2",
            "line 1, column 5: G10 L20 is not executed by this control: set work systems by G10 L2, tool lengths by the parameter tool_lengths_mm",
        ),
        (
            "G10 L2 P1.5 X0\nM2",
            "line 1, column 8: word P = 1.5: must be a whole number from 0 to 9, the number of a work system",
        ),
        (
            "F10 G38.2 X5\nG92 X0\nM2",
            "line 2, column 1: G92 starts from where a touch ended, which is not known before the program runs; move to a known point first",
        ),
        (
            "G10 L2 P1 X1900000\nM2",
            "line 1, column 11: word X = 1900000: must be from -1000000 to 1000000",
        ),
        (
            "G10 L2 P1 X99999\nG0 X2\nM2",
            "line 2, column 4: axis X would go to 100001 mm, limit 100000 mm",
        ),
    ];
    for (text, message) in cases {
        assert_eq!(refusal(text), message);
    }
    // What a touch did not move is known.
    assert!(check("F10 G38.2 Z-5\nG92 X0 Y0\nG0 X1\nM2").is_ok());
    assert!(check("G10 L2 P1 R5\nF10 G38.2 X5\nG92 Y0\nM2").is_err());
}

#[test]
fn one_coordinate_of_a_turned_system_after_a_touch_leaves_the_other_where_it_is() {
    let program = check("G10 L2 P1 X3 Y-2 R30\nG0 X1 Y2\nF10 G38.3 X9\nG0 X4\nM2").unwrap();
    let all = motions(&program);
    let frame = registers(Registers::default(), "G10 L2 P1 X3 Y-2 R30\nM2").frame();
    let start = target(&all[0], &PerAxis::default());
    let far = target(&all[1], &start);
    for share in [0.0, 0.3, 1.0] {
        let touched = PerAxis::from_fn(|axis| start[axis] + share * (far[axis] - start[axis]));
        let end = frame.program(&target(&all[2], &touched));
        assert!((end[Axis::X] - 4.0).abs() < 1e-12, "{end:?}");
        assert!((end[Axis::Y] - 2.0).abs() < 1e-12, "{end:?}");
    }
    // Both are travel-checked for every place where the touch may have ended.
    let mut narrow = envelope();
    narrow.travel[Axis::Y] = [-50.0, 8.0];
    let text = "G10 L2 P1 R45\nG0 X0 Y0\nF10 G38.3 Y10\nG0 X5\nM2";
    let error = read(text, &narrow, &PerAxis::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("line 4, column 4: axis Y would go to 10.6"),
        "{error}"
    );
}

fn limits() -> AxisLimits {
    AxisLimits {
        axes: envelope().axes,
        speed: PerAxis([333.0, 250.0, 250.0, 2.09, 1.0, 4.19]),
        acceleration: PerAxis([3000.0, 2500.0, 2000.0, 17.4, 1.0, 34.9]),
        period_s: 0.001,
    }
}

#[test]
fn an_arc_in_a_turned_vertical_plane_is_the_unturned_one_turned() {
    let arc = "G18 F1000 G0 X2 Y3 Z1\nG3 X12 Z1 I5 K0 Y7\nM2";
    let plain = motions(&check(arc).unwrap());
    let turned = motions(&check(&format!("G10 L2 P1 X-4 R37\n{arc}")).unwrap());
    let frame = registers(Registers::default(), "G10 L2 P1 X-4 R37\nM2").frame();
    let piece = |motions: &[Motion]| {
        let start = target(&motions[0], &PerAxis::default());
        Segment::new(&motions[1], &start, &limits()).unwrap()
    };
    let (plain, turned) = (piece(&plain), piece(&turned));
    assert!((plain.length - turned.length).abs() < 1e-9);
    for share in [0.0, 0.1, 0.37, 0.5, 0.99, 1.0] {
        let s = share * plain.length;
        let wanted = frame.machine(&plain.position(s));
        let found = turned.position(s);
        let way = frame.machine_way(&plain.tangent(s));
        let rate = turned.tangent(s);
        for axis in Axis::LINEAR {
            assert!(
                (wanted[axis] - found[axis]).abs() < 1e-9,
                "{axis} at {share}"
            );
            assert!((way[axis] - rate[axis]).abs() < 1e-9, "{axis} at {share}");
            assert!(rate[axis].abs() * turned.speed_limit <= limits().speed[axis] + 1e-9);
        }
    }
}

#[test]
fn what_a_hold_leaves_of_a_motion_is_the_same_curve() {
    for text in [
        "F1000 G1 X30 Y-10 A5\nM2",
        "F1000 G2 X20 Y0 I10 J0 Z4\nM2",
        "G10 L2 P1 R37\nG18 F1000 G3 X12 Z0 I6 K0 Y7\nM2",
    ] {
        let motion = motions(&check(text).unwrap())[0];
        let whole = Segment::new(&motion, &PerAxis::default(), &limits()).unwrap();
        for held in [0.001, 0.25, 0.9] {
            let done = held * whole.length;
            let rest = whole.rest(done, &limits()).unwrap();
            let again = rest.rest(0.5 * rest.length, &limits()).unwrap();
            for share in [0.0, 0.4, 1.0] {
                let s = share * rest.length;
                let (wanted, found) = (whole.position(done + s), rest.position(s));
                assert!((wanted.xyz() - found.xyz()).norm() < 1e-9);
                let (wanted, found) = (whole.tangent(done + s), rest.tangent(s));
                assert!((wanted.xyz() - found.xyz()).norm() < 1e-9);
            }
            let (wanted, found) = (
                rest.position(0.75 * rest.length),
                again.position(0.5 * again.length),
            );
            assert!((wanted.xyz() - found.xyz()).norm() < 1e-9);
        }
        assert!(whole.rest(whole.length, &limits()).is_none());
    }
}

fn runner(cases: u32) -> TestRunner {
    TestRunner::new_with_rng(
        Config {
            cases,
            failure_persistence: None,
            ..Config::default()
        },
        TestRng::from_seed(RngAlgorithm::ChaCha, &[11; 32]),
    )
}

fn point() -> impl Strategy<Value = PerAxis<f64>> {
    proptest::array::uniform6(-500.0..500.0_f64).prop_map(PerAxis)
}

fn state() -> impl Strategy<Value = Registers> {
    (point(), point(), point(), -400.0..400.0_f64).prop_map(|(origin, shift, tool, turn)| {
        let mut registers = Registers::default();
        registers.apply(&Change::System {
            index: 4,
            to: WorkSystem {
                origin,
                rotation_deg: turn,
            },
        });
        registers.apply(&Change::Select(4));
        registers.apply(&Change::Shift {
            to: shift,
            stored: shift,
        });
        registers.apply(&Change::Tool(tool));
        registers
    })
}

#[test]
fn prop_machine_and_program_coordinates_are_each_others_inverse() {
    runner(5000)
        .run(&(state(), point()), |(state, program)| {
            let frame = state.frame();
            let back = frame.program(&frame.machine(&program));
            let way = frame.program_way(&frame.machine_way(&program));
            for axis in Axis::ALL {
                prop_assert!((back[axis] - program[axis]).abs() < 1e-9);
                prop_assert!((way[axis] - program[axis]).abs() < 1e-9);
            }
            // A rotation keeps lengths.
            let turned = frame.machine_way(&program).xyz().norm();
            prop_assert!((turned - program.xyz().norm()).abs() < 1e-9);
            Ok(())
        })
        .unwrap();
}

#[test]
fn prop_g92_gives_the_point_where_the_axes_are_its_coordinates() {
    runner(2000)
        .run(&(state(), point(), point()), |(state, machine, named)| {
            let text = format!(
                "G92 X{:.6} Y{:.6} Z{:.6}\nM2",
                named[Axis::X],
                named[Axis::Y],
                named[Axis::Z]
            );
            let program = read_in(&text, &envelope(), &machine, &state).unwrap();
            let mut after = state;
            for step in &program.steps {
                if let Action::Set(change) = &step.action {
                    after.apply(change);
                }
            }
            let here = after.frame().program(&machine);
            for axis in Axis::LINEAR {
                prop_assert!((here[axis] - named[axis]).abs() < 2e-6);
            }
            // Taking it up again after G92.2 changes nothing.
            prop_assert_eq!(after.shift, after.stored_shift);
            Ok(())
        })
        .unwrap();
}

#[test]
fn prop_a_state_of_zeros_leads_to_the_very_numbers_of_the_text() {
    let numbers = proptest::collection::vec(-900.0..900.0_f64, 3);
    runner(2000)
        .run(&numbers, |numbers| {
            let text = format!("G0 X{} Y{} Z{}\nM2", numbers[0], numbers[1], numbers[2]);
            let end = ends(&text)[0];
            for (axis, number) in Axis::LINEAR.into_iter().zip(&numbers) {
                prop_assert_eq!(end[axis].to_bits(), (number + 0.0).to_bits());
            }
            Ok(())
        })
        .unwrap();
}
