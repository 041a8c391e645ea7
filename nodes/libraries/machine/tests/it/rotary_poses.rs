//! Poses at which a sphere is probed: where it is read there, what it tells, and the programs.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::num::NonZeroU32;

use machine::cycle::{RotaryOrder, rotary};
use machine::poses::{
    ReachLimits, SphereDesign, WANTED_MERIT, calibration_poses, merit, verification_poses,
};
use machine::{CycleError, MachineFile};
use metrology::sample::TestKind;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{Rotation3, Vector3};

const BENCH: &str = include_str!("../data/bench.yaml");

fn bench() -> MachineFile {
    MachineFile::parse(BENCH, "bench.yaml").unwrap()
}

fn head() -> MachineFile {
    let text = BENCH
        .replace("[w C' A' Y' b X Z t]", "[w b X Y Z C A t]")
        .replace("A: [0.0, 0.0, 50.0]", "A: [0.0, 0.0, 180.0]")
        .replace("travel_deg: [-120.0, 30.0]", "travel_deg: [-50.0, 50.0]");
    MachineFile::parse(&text, "head.yaml").unwrap()
}

fn pose(a_deg: f64, c_deg: f64) -> PerAxis<f64> {
    let mut pose = PerAxis::default();
    (pose[Axis::A], pose[Axis::C]) = (a_deg.to_radians(), c_deg.to_radians());
    pose
}

/// Bench's sphere.
const BALL_MM: Vector3<f64> = Vector3::new(60.0, -40.0, 90.0);

/// Rx(A) about the line (Y 0, Z 50), after Rz(C) about the line (X 0, Y 0).
fn turned(place_mm: Vector3<f64>, a_deg: f64, c_deg: f64) -> Vector3<f64> {
    let line = Vector3::new(0.0, 0.0, 50.0);
    let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), a_deg.to_radians());
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), c_deg.to_radians());
    tilt * (turn * place_mm - line) + line
}

fn component(name: &str) -> ErrorComponent {
    name.parse().unwrap()
}

#[test]
fn eq1_a_sphere_is_read_where_the_table_has_carried_it() {
    let design = SphereDesign::new(&bench()).unwrap();
    for (a, c) in [(0.0, 0.0), (-60.0, 30.0), (25.0, -200.0)] {
        let row = design.row(&BALL_MM, &pose(a, c));
        assert!((row.centre_mm - turned(BALL_MM, a, c)).norm() < 1e-9);
        let positions = row.positions.xyz();
        assert!(
            (positions - row.centre_mm).norm() < 1e-9,
            "axes read the ball's centre"
        );
    }
}

#[test]
fn eq1_a_turning_head_brings_the_ball_to_the_sphere() {
    let design = SphereDesign::new(&head()).unwrap();
    let row = design.row(&BALL_MM, &pose(30.0, 75.0));
    let ball = design.kinematics().ball_in_workpiece_mm(&row.positions);
    assert!((ball - BALL_MM).norm() < 1e-9);
    assert!(
        (row.centre_mm - BALL_MM).norm() < 1e-9,
        "the table does not move"
    );
    // Pivot 180 above the ball: tilted by 30 deg the ball swings by 180 sin 30 sideways.
    let swing = (row.positions.xyz() - BALL_MM).xy().norm();
    assert!((swing - 90.0).abs() < 1e-9, "{swing}");
}

#[test]
fn eq2_a_displaced_table_axis_is_read_as_one_minus_r() {
    let design = SphereDesign::new(&bench()).unwrap();
    for (a, c) in [(0.0, 90.0), (-50.0, 140.0), (20.0, -75.0)] {
        let row = design.row(&BALL_MM, &pose(a, c));
        let at = |name| design.effect(&row, component(name));
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), a.to_radians());
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), c.to_radians());
        let (x, y) = (Vector3::x(), Vector3::y());
        assert!((at("EX0C") - tilt * (x - turn * x)).norm() < 1e-12);
        assert!((at("EY0A") - (y - tilt * y)).norm() < 1e-12);
        // The line of C tilted about X by w: its direction is (0, -w, 1); done with the matrix itself.
        let w = 1e-6;
        let lean = Rotation3::from_axis_angle(&Vector3::x_axis(), w);
        let about = nalgebra::Unit::new_normalize(lean * Vector3::z());
        let tilted = Rotation3::from_axis_angle(&about, c.to_radians());
        let line = Vector3::new(0.0, 0.0, 50.0);
        let read = tilt * (tilted * BALL_MM - line) + line;
        assert!((at("EA0C") - (read - row.centre_mm) / w).norm() < 1e-3);
    }
}

#[test]
fn poses_without_tilt_do_not_tell_where_a_lies() {
    let design = SphereDesign::new(&bench()).unwrap();
    let flat: Vec<_> = (0..12).map(|k| pose(0.0, f64::from(k) * 30.0)).collect();
    let told = merit(&design, &[(BALL_MM, flat)]);
    assert!(told.merit.abs() < 1e-12 && told.rank < 8);
    for (component, u) in &told.standard_uncertainty {
        let of_a = component.of == Axis::A;
        assert_eq!(u.is_none(), of_a, "{component}: {u:?}");
    }
}

#[test]
fn eq3_the_merit_grows_with_the_square_root_of_the_poses() {
    let design = SphereDesign::new(&bench()).unwrap();
    let once = calibration_poses(&bench(), "ball", 10, &ReachLimits::default()).unwrap();
    let twice: Vec<_> = once.iter().chain(&once).copied().collect();
    let (one, two) = (
        merit(&design, &[(BALL_MM, once)]),
        merit(&design, &[(BALL_MM, twice)]),
    );
    assert!((two.merit / one.merit - 2.0_f64.sqrt()).abs() < 1e-9);
    for ((_, u), (_, v)) in one
        .standard_uncertainty
        .iter()
        .zip(&two.standard_uncertainty)
    {
        assert!((u.unwrap() / v.unwrap() - 2.0_f64.sqrt()).abs() < 1e-9);
    }
}

#[test]
fn planned_poses_tell_more_than_a_plain_grid_of_as_many() {
    let file = bench();
    let design = SphereDesign::new(&file).unwrap();
    let planned = calibration_poses(&file, "ball", 12, &ReachLimits::default()).unwrap();
    let plain: Vec<_> = [-30.0, 0.0, 30.0]
        .into_iter()
        .flat_map(|a| (0..4).map(move |k| pose(a, f64::from(k) * 90.0)))
        .collect();
    let (planned, plain) = (
        merit(&design, &[(BALL_MM, planned)]),
        merit(&design, &[(BALL_MM, plain)]),
    );
    assert!(
        planned.merit > WANTED_MERIT && planned.merit > plain.merit,
        "{} {}",
        planned.merit,
        plain.merit
    );
}

#[test]
fn verification_poses_are_none_of_those_used() {
    let file = bench();
    let limits = ReachLimits::default();
    let used = calibration_poses(&file, "ball", 12, &limits).unwrap();
    let others = verification_poses(&file, "ball", 6, &used, &limits).unwrap();
    assert_eq!(others.len(), 6);
    for other in &others {
        for known in &used {
            let apart = (other[Axis::A] - known[Axis::A]).hypot(other[Axis::C] - known[Axis::C]);
            assert!(apart > 0.2, "{other:?} {known:?}");
        }
    }
}

#[test]
fn a_table_top_keeps_poses_clear_of_it() {
    let free = calibration_poses(&bench(), "ball", 8, &ReachLimits::default()).unwrap();
    let low = BENCH.replace(
        "artefacts:",
        "table: {top_z_mm: 72.0, radius_mm: 340.0, nose_radius_mm: 60.0}\nartefacts:",
    );
    let file = MachineFile::parse(&low, "low.yaml").unwrap();
    let clear = calibration_poses(&file, "ball", 8, &ReachLimits::default()).unwrap();
    let steepest =
        |poses: &[PerAxis<f64>]| poses.iter().map(|p| p[Axis::A].abs()).fold(0.0, f64::max);
    assert!(
        steepest(&clear) < steepest(&free),
        "{} {}",
        steepest(&clear),
        steepest(&free)
    );
}

fn order(poses_rad: &[PerAxis<f64>]) -> RotaryOrder<'_> {
    RotaryOrder {
        sphere: "ball",
        poses_rad,
        points: 6,
        repeats: NonZeroU32::new(2).unwrap(),
        verification: false,
    }
}

#[test]
fn a_program_turns_then_touches_a_hemisphere_at_each_pose() {
    let poses = [pose(-45.0, 20.0), pose(15.0, -100.0)];
    let cycle = rotary(&bench(), &order(&poses)).unwrap();
    assert_eq!(cycle.kind, TestKind::Rotary);
    assert_eq!(cycle.touches.len(), 2 * 2 * 6);
    let turns: Vec<_> = cycle
        .program
        .lines()
        .filter(|line| line.starts_with("G0 A"))
        .collect();
    assert_eq!(
        turns,
        [
            "G0 A0 C0",
            "G0 A-45 C20",
            "G0 A15 C-100",
            "G0 A15 C-100",
            "G0 A-45 C20"
        ]
    );
    for (k, touch) in cycle.touches.iter().enumerate() {
        assert_eq!(touch.feature_id, format!("ball.{}", k % 6 + 1));
        assert!(touch.approach.z < 1e-12, "never from below");
        let centre = match k / 6 {
            0 | 3 => turned(BALL_MM, -45.0, 20.0),
            _ => turned(BALL_MM, 15.0, -100.0),
        };
        assert!((touch.contact_mm - centre + touch.approach * 12.5).norm() < 1e-9);
    }
}

#[test]
fn a_head_touches_along_its_own_axis_with_the_pivot_in_its_words() {
    let file = head();
    let poses = [pose(40.0, 0.0)];
    let cycle = rotary(&file, &order(&poses)).unwrap();
    let design = SphereDesign::new(&file).unwrap();
    let tool = design.tool_in_machine(&poses[0]);
    assert!((cycle.touches[0].approach + tool).norm() < 1e-12);
    let first = cycle
        .program
        .lines()
        .find(|line| line.starts_with("G38.2"))
        .unwrap();
    let words: Vec<f64> = first
        .split(' ')
        .filter_map(|word| word.get(1..).filter(|_| word.starts_with(['X', 'Y', 'Z'])))
        .map(|number| number.parse().unwrap())
        .collect();
    let mut positions = poses[0];
    for (axis, word) in Axis::LINEAR.into_iter().zip(words) {
        positions[axis] = word;
    }
    // 12.5 + 3 along the tool's axis, less the overtravel of 3.
    let ball = design.kinematics().ball_in_workpiece_mm(&positions);
    assert!((ball - BALL_MM - tool * 12.5).norm() < 1e-4, "{ball}");
}

#[test]
fn bad_poses_are_refused_by_name() {
    let said = |file: &MachineFile, poses: &[PerAxis<f64>]| {
        rotary(file, &order(poses)).unwrap_err().to_string()
    };
    let file = bench();
    assert!(said(&file, &[]).contains("pose in the request"));
    assert_eq!(
        said(&file, &[pose(0.0, 0.0), pose(31.0, 0.0)]),
        "poses[1]: axis A would go to 31.0000 deg, travel is [-120, 30] deg"
    );
    assert_eq!(
        said(&file, &[pose(f64::NAN, 0.0)]),
        "poses[0]: the position of axis A is not finite"
    );
    let leaning = said(&file, &[pose(-90.0, 0.0)]);
    assert!(
        leaning.contains("poses[0] (A -90.000, C 0.000 deg)"),
        "{leaning}"
    );
    let unknown = rotary(
        &file,
        &RotaryOrder {
            sphere: "bull",
            ..order(&[pose(0.0, 0.0)])
        },
    );
    assert!(unknown.unwrap_err().to_string().contains("sphere \"bull\""));
    let few = rotary(
        &file,
        &RotaryOrder {
            points: 4,
            ..order(&[pose(0.0, 0.0)])
        },
    );
    assert!(matches!(
        few,
        Err(CycleError::TooFewPoints {
            points: 4,
            least: 5,
            ..
        })
    ));
    let limits = ReachLimits::default();
    let few = calibration_poses(&file, "ball", 3, &limits).unwrap_err();
    assert_eq!(
        few.to_string(),
        "3 poses were given: 11 unknowns need at least 4"
    );
    let many = calibration_poses(&file, "ball", 1000, &limits).unwrap_err();
    assert!(many.to_string().contains("1000 poses are wanted"), "{many}");
    let three = MachineFile::parse(
        &BENCH.replace("[w C' A' Y' b X Z t]", "[w C' Y' A' b X Z t]"),
        "x",
    )
    .unwrap();
    let moved = SphereDesign::new(&three).unwrap_err().to_string();
    assert!(
        moved.contains("linear axis Y is moved by a rotary axis"),
        "{moved}"
    );
}
