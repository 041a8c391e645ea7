//! Kinematics and probe angles against closed forms.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::f64::consts::{FRAC_PI_2, PI};

use machine::orientation::RotaryPosition;
use machine::{Kinematics, MachineFile, Orientation, OrientationError, TableSense};
use metrology::{Axis, PerAxis};
use nalgebra::{Matrix3, Vector3};

const BENCH: &str = include_str!("../data/bench.yaml");
const HEAD: &str = "[w Y' b X Z C A t]";
const MIXED: &str = "[w C' Y' b X Z A t]";

fn machine(chain: &str, travel_a_deg: &str) -> MachineFile {
    let text = BENCH.replace("[w C' A' Y' b X Z t]", chain).replace(
        "travel_deg: [-120.0, 30.0]",
        &format!("travel_deg: {travel_a_deg}"),
    );
    MachineFile::parse(&text, "bench.yaml").unwrap()
}

fn pose(x: f64, y: f64, z: f64, a_rad: f64, c_rad: f64) -> PerAxis<f64> {
    PerAxis([x, y, z, a_rad, 0.0, c_rad])
}

fn rx(a: f64) -> Matrix3<f64> {
    let (s, c) = a.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

fn rz(c: f64) -> Matrix3<f64> {
    let (s, c) = c.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

fn at(a_rad: f64, c_rad: f64) -> RotaryPosition {
    RotaryPosition { a_rad, c_rad }
}

#[test]
fn eq1_a_table_table_machine_has_the_transposed_matrix_product() {
    let kinematics = Kinematics::new(&machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]")).unwrap();
    let (a, c) = (-0.7, 2.1);
    let p = Vector3::new(12.0, -34.0, 56.0);
    let (origin_a, origin_c) = (Vector3::new(0.0, 0.0, 50.0), Vector3::zeros());
    // Machine from workpiece: about C's line first, about A's line after it.
    let turned = rx(a).transpose() * (p - origin_a) + origin_a;
    let expected = rz(c).transpose() * (turned - origin_c) + origin_c;
    let found = kinematics.ball_in_workpiece_mm(&pose(p.x, p.y, p.z, a, c));
    assert!((found - expected).norm() < 1e-12, "{found}");
    assert!((kinematics.ball_in_machine_mm(&pose(p.x, p.y, p.z, a, c)) - p).norm() < 1e-12);
    let axis = kinematics.probe_axis_in_workpiece(&pose(p.x, p.y, p.z, a, c));
    let closed = Vector3::new(a.sin() * c.sin(), a.sin() * c.cos(), a.cos());
    assert!((axis - closed).norm() < 1e-15);
}

#[test]
fn without_rotation_workpiece_and_machine_frame_read_the_same() {
    for chain in [
        "[w C' A' Y' b X Z t]",
        HEAD,
        MIXED,
        "[w A' C' X' Y' Z' b t]",
    ] {
        let kinematics = Kinematics::new(&machine(chain, "[-120.0, 120.0]")).unwrap();
        let positions = pose(1.0, 2.0, 3.0, 0.0, 0.0);
        let p = Vector3::new(1.0, 2.0, 3.0);
        assert!(
            (kinematics.ball_in_workpiece_mm(&positions) - p).norm() < 1e-15,
            "{chain}"
        );
        assert!(
            (kinematics.ball_in_machine_mm(&positions) - p).norm() < 1e-15,
            "{chain}"
        );
        let surface = kinematics.surface_in_machine_mm(&positions, &Vector3::x(), 3.0);
        assert!((surface - Vector3::new(4.0, 2.0, 3.0)).norm() < 1e-15);
    }
}

#[test]
fn a_turned_head_swings_the_ball_about_its_pivot() {
    // A's line passes 50 mm above the ball; a quarter turn moves the ball to its height.
    let kinematics = Kinematics::new(&machine(HEAD, "[-120.0, 120.0]")).unwrap();
    let ball = kinematics.ball_in_machine_mm(&pose(0.0, 0.0, 0.0, FRAC_PI_2, 0.0));
    assert!(
        (ball - Vector3::new(0.0, 50.0, 50.0)).norm() < 1e-12,
        "{ball}"
    );
}

#[test]
fn a_point_fixed_to_the_table_keeps_its_workpiece_coordinates() {
    // Follow a table point by hand through the machine, then ask for it in the workpiece frame.
    let kinematics = Kinematics::new(&machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]")).unwrap();
    let on_table = Vector3::new(40.0, -25.0, 10.0);
    let up = Vector3::new(0.0, 0.0, 50.0);
    for (a, c) in [(0.0, 0.0), (-1.0, 0.4), (0.3, -2.0), (-PI / 2.0, PI)] {
        let in_machine = rx(a) * (rz(c) * on_table - up) + up;
        let positions = pose(in_machine.x, in_machine.y, in_machine.z, a, c);
        let found = kinematics.ball_in_workpiece_mm(&positions);
        assert!((found - on_table).norm() < 1e-12);
        let normal = rx(a) * rz(c) * Vector3::x();
        let surface = kinematics.surface_in_workpiece_mm(&positions, &normal, 3.0);
        let expected: Vector3<f64> = on_table + Vector3::x() * 3.0;
        assert!((surface - expected).norm() < 1e-12);
    }
}

#[test]
fn iso_841_tables_turn_the_other_way() {
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]");
    let iso = Kinematics::new(&file)
        .unwrap()
        .with_table_sense(TableSense::Tool);
    let (a, c) = (0.4_f64, 1.1_f64);
    let axis = iso.probe_axis_in_workpiece(&pose(0.0, 0.0, 0.0, a, c));
    let head = Vector3::new(a.sin() * c.sin(), -a.sin() * c.cos(), a.cos());
    assert!((axis - head).norm() < 1e-15);
}

#[test]
fn eq2_inverts_the_kinematics_of_every_form() {
    for chain in ["[w C' A' Y' b X Z t]", HEAD, MIXED] {
        for sense in [TableSense::Table, TableSense::Tool] {
            let file = machine(chain, "[-120.0, 120.0]");
            let kinematics = Kinematics::new(&file).unwrap().with_table_sense(sense);
            let orientation = Orientation::new(&file, sense).unwrap();
            for k in 0..400 {
                let a = -2.0 + 0.01 * f64::from(k);
                let c = -6.0 + 0.03 * f64::from(k);
                let d = kinematics.probe_axis_in_workpiece(&pose(0.0, 0.0, 0.0, a, c));
                assert!((orientation.probe_axis(at(a, c)) - d).norm() < 1e-12);
                let found = orientation.solve(&(d * 7.0), at(a, c)).unwrap().position;
                assert!(
                    (found.a_rad - a).abs() < 1e-9 && (found.c_rad - c).abs() < 1e-6
                        || a.abs() < 1e-9,
                    "{chain} {a} {c} {found:?}"
                );
                let other = orientation.solve(&d, at(-a, c + PI)).unwrap().position;
                let again = kinematics.probe_axis_in_workpiece(&pose(
                    0.0,
                    0.0,
                    0.0,
                    other.a_rad,
                    other.c_rad,
                ));
                assert!((again - d).amax() < 1e-12, "{chain}");
            }
        }
    }
}

#[test]
fn of_two_solutions_the_travel_leaves_one() {
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]");
    let orientation = Orientation::new(&file, TableSense::Table).unwrap();
    let tilted = Vector3::new(0.0, 60_f64.to_radians().sin(), 60_f64.to_radians().cos());
    // A = +60 with C = 0 is outside the travel, A = -60 with C = 180 is inside.
    let found = orientation.solve(&tilted, at(0.0, 0.1)).unwrap().position;
    assert!((found.a_rad.to_degrees() + 60.0).abs() < 1e-9);
    assert!((found.c_rad.abs().to_degrees() - 180.0).abs() < 1e-9);
    let below = Vector3::new(1.0, 0.0, -2.0);
    assert!(matches!(
        orientation.solve(&below, at(0.0, 0.0)),
        Err(OrientationError::OutsideTravel { .. })
    ));
}

#[test]
fn the_nearest_full_turn_of_c_is_taken() {
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 120.0]");
    let orientation = Orientation::new(&file, TableSense::Table).unwrap();
    let d = orientation.probe_axis(at(-0.5, 6.0));
    let found = orientation.solve(&d, at(-0.5, 5.9)).unwrap().position;
    assert!((found.c_rad - 6.0).abs() < 1e-12);
    let found = orientation.solve(&d, at(-0.5, -0.3)).unwrap().position;
    assert!((found.c_rad - (6.0 - 2.0 * PI)).abs() < 1e-12);
}

#[test]
fn a_tilt_that_the_arc_cosine_loses_is_kept() {
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]");
    let orientation = Orientation::new(&file, TableSense::Table).unwrap();
    let d = Vector3::<f64>::new(0.0, 1e-9, 1.0);
    assert!(d.normalize().z.acos() < 1e-12, "the trap");
    let found = orientation.solve(&d, at(0.0, 0.0)).unwrap();
    assert!((found.position.a_rad.to_degrees() - 5.729_577_95e-8).abs() < 1e-15);
    assert!(!found.singular && found.sine_of_tilt < 1.1e-9);
}

#[test]
fn straight_up_keeps_c_whatever_the_sign_of_zero() {
    assert!((0.0_f64.atan2(-0.0) - PI).abs() < 1e-15, "the trap");
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]");
    let orientation = Orientation::new(&file, TableSense::Table).unwrap();
    for zero in [0.0, -0.0] {
        let found = orientation
            .solve(&Vector3::new(zero, -zero, 2.0), at(-0.2, 1.234))
            .unwrap();
        assert_eq!(found.position, at(0.0, 1.234));
        assert!(found.singular);
    }
}

#[test]
fn straight_down_is_refused_unless_the_travel_has_it() {
    let down = -Vector3::z();
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]");
    let error = Orientation::new(&file, TableSense::Table)
        .unwrap()
        .solve(&down, at(0.0, 0.5))
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "no solution inside the travel: A = -180.000 deg or its opposite, travel of A [-120.000, 30.000] deg, of C [-360.000, 360.000] deg"
    );
    let file = machine("[w C' A' Y' b X Z t]", "[-190.0, 30.0]");
    let found = Orientation::new(&file, TableSense::Table)
        .unwrap()
        .solve(&down, at(0.0, 0.5))
        .unwrap();
    assert!((found.position.a_rad + PI).abs() < 1e-12 && found.singular);
    assert!((found.position.c_rad - 0.5).abs() < 1e-15);
}

#[test]
fn what_is_no_direction_or_no_such_machine_is_refused() {
    let file = machine("[w C' A' Y' b X Z t]", "[-120.0, 30.0]");
    let orientation = Orientation::new(&file, TableSense::Table).unwrap();
    let solve = |x: f64, z: f64| orientation.solve(&Vector3::new(x, 0.0, z), at(0.0, 0.0));
    assert_eq!(
        solve(0.0, 0.0),
        Err(OrientationError::NoDirection { length: 0.0 })
    );
    assert_eq!(solve(f64::NAN, 1.0), Err(OrientationError::NotFinite));
    assert!(matches!(
        solve(1e200, f64::MAX),
        Err(OrientationError::NoDirection { .. })
    ));
    let other = machine("[w A' C' Y' b X Z t]", "[-120.0, 30.0]");
    assert!(matches!(
        Orientation::new(&other, TableSense::Table),
        Err(OrientationError::OtherForm { .. })
    ));
    let positions = pose(0.0, 0.0, 0.0, 0.1, 0.2);
    assert_eq!(RotaryPosition::of(&positions), at(positions[Axis::A], 0.2));
}
