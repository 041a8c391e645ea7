//! What a verification says where more is left than its uncertainties explain.

use machine::SphereDesign;
use machine::poses::{ReachLimits, verification_poses};
use metrology::fit::chi_square_p;
use metrology::sample::{ProbedFeature, TestKind};
use metrology::{Axis, PerAxis};
use nalgebra::{Rotation3, Vector3};
use rotary_axes::expectation::Reason;
use rotary_axes::verification::verify;
use rotary_axes::{Allowance, Known, SphereVisit, estimate};

use crate::bench::{BALL_MM, Wrong, degrees, file, visits};
use crate::coverage::RULES;
use crate::faults::{Rig, good_poses};

/// Calibrates, then verifies with spheres that `change` moved, and says what was said of the residual.
fn verified(wrong_then: &Wrong, change: impl Fn(&mut ProbedFeature)) -> Rig {
    let poses = good_poses(16);
    let twice: Vec<PerAxis<f64>> = poses.iter().chain(&poses).copied().collect();
    let others = verification_poses(&file(), "ball", 8, &poses, &ReachLimits::default()).unwrap();
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &Wrong::drawn(3), &twice, |_, _| true);
    rig.test(
        TestKind::RotaryVerification,
        wrong_then,
        &others,
        |_, feature| {
            change(feature);
            true
        },
    );
    rig
}

fn beyond(rig: &Rig) -> Vec<String> {
    let all = rig.said().into_iter();
    all.filter(|line| line.starts_with("beyond_expected"))
        .collect()
}

/// The three numbers behind X, Y and Z of a shift in a sentence, µm.
fn shift_um(line: &str) -> Vector3<f64> {
    let of = |letter: &str| -> f64 {
        let behind = line.split_once(&format!("{letter} ")).unwrap().1;
        let word = behind.split([',', ' ']).next().unwrap();
        word.parse().unwrap()
    };
    Vector3::new(of(" by X"), of(", Y"), of(", Z"))
}

#[test]
fn a_residual_that_noise_explains_is_not_remarked() {
    let rig = verified(&Wrong::drawn(3), |_| {});
    assert!(beyond(&rig).is_empty(), "{:?}", beyond(&rig));
    rig.expect(&[
        "verified: run 2",
        "expected",
        "by scatter, model and allowances",
    ]);
}

#[test]
fn a_shift_along_the_machines_axes_is_told_with_its_size_and_as_heat() {
    // What heat of spindle and screws did to `five_axis` in 20 min, three times over.
    let moved_um = Vector3::new(-4.5, 4.8, 3.0);
    let rig = verified(&Wrong::drawn(3), |feature| {
        feature.centre_mm += moved_um / 1e3
    });
    let [line] = &beyond(&rig)[..] else {
        panic!("{:?}", rig.said());
    };
    assert!(
        line.contains("along the machine's axes") && line.contains("warm up"),
        "{line}"
    );
    // Eight centres of 0.5 µm, and as much again of the model: 0.3 µm.
    assert!((shift_um(line) - moved_um).amax() < 1.2, "{line}");
}

#[test]
fn a_sphere_that_moved_is_told_along_the_workpieces_axes() {
    let moved_um = Vector3::new(6.0, -4.0, 2.0);
    let rig = verified(&Wrong::drawn(3), |feature| {
        // The table carries it: p = Rx(A) Rz(C) w.
        let a = Rotation3::from_axis_angle(&Vector3::x_axis(), feature.rotary_rad[Axis::A]);
        let c = Rotation3::from_axis_angle(&Vector3::z_axis(), feature.rotary_rad[Axis::C]);
        feature.centre_mm += a * (c * moved_um) / 1e3;
    });
    let [line] = &beyond(&rig)[..] else {
        panic!("{:?}", rig.said());
    };
    assert!(
        line.contains("along the workpiece's axes") && line.contains("fasten"),
        "{line}"
    );
    assert!((shift_um(line) - moved_um).amax() < 1.2, "{line}");
}

#[test]
fn an_error_that_depends_on_the_pose_is_no_shift() {
    let wrong = Wrong {
        run_out_c: 0.008,
        ..Wrong::drawn(3)
    };
    let rig = verified(&wrong, |_| {});
    let [line] = &beyond(&rig)[..] else {
        panic!("{:?}", rig.said());
    };
    assert!(!line.contains("along the workpiece's axes"), "{line}");
    // The bench's node has no allowance: that is the first thing to do.
    assert!(line.contains("no allowance is stated"), "{line}");
}

/// Made by tests/validation/rotary_expected.py.
const REFERENCE: &str = include_str!("../numpy/expected.txt");

/// Those of the script.
const ALLOWANCE: Allowance = Allowance {
    setup_um: 0.3,
    linear_scale_um_per_m: 1.0,
    linear_squareness_urad: 1.5,
    linear_error_um: 0.5,
    linear_error_length_mm: 150.0,
    motion_um: 0.5,
    motion_urad: 2.0,
};

fn numbers(name: &str) -> Vec<f64> {
    let line = REFERENCE
        .lines()
        .find_map(|line| line.strip_prefix(&format!("{name} ")));
    let words = line.unwrap().split_whitespace();
    words.map(|n| n.parse().unwrap()).collect()
}

fn near(found: &[f64], expected: &[f64]) {
    for (found, expected) in found.iter().zip(expected) {
        // The fitted place is a micrometre beside the nominal one, and finite differences are not exact.
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }
}

#[test]
fn val_numpy_what_is_expected_at_other_poses() {
    let known = Known {
        allowance: Some(&ALLOWANCE),
        linear: None,
    };
    let design = SphereDesign::new(&file()).unwrap();
    let all: Vec<PerAxis<f64>> = [-60.0, -30.0, 0.0, 25.0]
        .into_iter()
        .flat_map(|a| [0.0, 90.0, 180.0, -90.0].map(|c| degrees(a, c)))
        .collect();
    let others = [
        (-45.0, 45.0),
        (-15.0, -135.0),
        (10.0, 135.0),
        (-50.0, -60.0),
        (-20.0, 20.0),
        (5.0, 100.0),
    ]
    .map(|(a, c)| degrees(a, c));
    let spheres = [("ball".to_owned(), BALL_MM)];
    let wrong = Wrong::default();
    let seen = visits(&wrong, &BALL_MM, &all, 1, (0.0005, 4));
    let found = estimate(&design, &seen, &spheres, &RULES).unwrap();
    assert!((found.enlargement - 1.0).abs() < 1e-12 && found.unknowns.len() == 8);
    let mut checked = visits(&wrong, &BALL_MM, &others, 1, (0.0005, 5));
    let judged = |known, checked: &[SphereVisit]| {
        verify(&design, &found, known, checked, &spheres, true).unwrap()
    };
    let noise = judged(Known::default(), &checked);
    near(&noise.judged.standard_uncertainty_mm, &numbers("noise"));
    let whole = judged(known, &checked);
    near(&whole.judged.standard_uncertainty_mm, &numbers("whole"));
    near(&[noise.allowed_mm], &[noise.expected_mm]);
    assert!(whole.allowed_mm > 1.1 * noise.allowed_mm);
    // Readings that leave 1 µm along X of the machine at each pose.
    for (visit, judged) in checked.iter_mut().zip(&whole.visits) {
        visit.centre_mm += Vector3::new(0.001, 0.0, 0.0) - judged.after_mm;
    }
    let shifted = judged(known, &checked);
    let expected_p = chi_square_p(numbers("chi_square")[0], 18);
    assert!(
        (shifted.judged.p / expected_p - 1.0).abs() < 1e-2,
        "{} {expected_p}",
        shifted.judged.p
    );
    let Reason::MachineShift(shift_mm) = shifted.judged.reason else {
        panic!("{:?}", shifted.judged);
    };
    assert!(
        (shift_mm - Vector3::new(0.001, 0.0, 0.0)).amax() < 1e-9,
        "{shift_mm}"
    );
}
