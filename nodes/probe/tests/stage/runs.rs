//! Runs: blocks, shapes, segments.

use metrology::sample::{FeatureKind, TestKind};
use metrology::{Axis, Stage, Stamp};
use nalgebra::Vector3;
use probe::{Input, Output};

use crate::rig::{Rig, known_latency};

#[test]
fn three_faces_make_a_block_with_repeats_averaged() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1"]);
    let drift = [0.012, -0.007, 0.020];
    let corner = Vector3::new(-220.0, -180.0, 20.0) + Vector3::from(drift);
    let faces = [
        ("x", Vector3::x()),
        ("y", Vector3::y()),
        ("z", -Vector3::z()),
    ];
    for (letter, approach) in faces {
        for shift_mm in [-0.001, 0.001] {
            let point = corner + approach * shift_mm;
            rig.touch(&format!("block_1.{letter}"), point, approach, 2.0);
        }
    }
    rig.segment(TestKind::Block, false, &["block_1"]);
    assert!(rig.blocks().is_empty(), "the last touch may come late");
    rig.settle();
    let block = &rig.blocks()[0];
    assert!(block.cold && block.run == 7 && block.block_id == "block_1");
    for axis in Axis::LINEAR {
        let face = block.faces[axis].unwrap();
        assert!(
            (face.position_mm - corner[axis.index()]).abs() < 1e-9,
            "{axis}"
        );
        let u_mm = (0.0003 / 2_f64.sqrt()).hypot(2.0 * 25e-6);
        assert!((face.standard_uncertainty_mm - u_mm).abs() < 1e-12);
        // All faces share what the latency's error makes of them, with the sign of their approach.
        let (latency, approach) = (face.latency, faces[axis.index()].1[axis.index()]);
        assert!((latency.sensitivity_mm_s + 2.0 * approach).abs() < 1e-12);
        assert!((latency.standard_uncertainty_s - 25e-6).abs() < 1e-15);
        let alone_mm = 0.0003 / 2_f64.sqrt();
        assert!((face.independent_uncertainty_mm() - alone_mm).abs() < 1e-12);
        // The position is of the mean instant of its touches.
        let points = rig.points();
        let touched = |k: usize| points[2 * axis.index() + k].received_at.nanos();
        assert!((face.at.nanos() - touched(0).midpoint(touched(1))).abs() <= 1);
    }
    assert_eq!(block.at, rig.points()[5].received_at);
    assert!(rig.diagnostics().is_empty());
}

#[test]
fn a_face_that_was_not_touched_is_unknown_and_named() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1", "block_2"]);
    rig.touch(
        "block_1.x",
        Vector3::new(-220.0, 0.0, 0.0),
        Vector3::x(),
        2.0,
    );
    rig.touch(
        "block_1.y",
        Vector3::new(0.0, -180.0, 0.0),
        Vector3::x(),
        2.0,
    );
    rig.segment(TestKind::Block, false, &[]);
    rig.settle();
    let blocks = rig.blocks();
    assert_eq!(blocks.len(), 2);
    assert!(blocks[0].faces[Axis::X].is_some());
    assert!(blocks[0].faces[Axis::Y].is_none() && blocks[0].faces[Axis::Z].is_none());
    assert!(
        Axis::LINEAR
            .iter()
            .all(|axis| blocks[1].faces[*axis].is_none())
    );
    let said = rig.diagnostics();
    assert_eq!(
        said[0],
        "run 7: touch 2 of face Y of block block_1 came along [1.0000, 0.0000, 0.0000], not along its normal"
    );
    assert_eq!(
        said[2],
        "run 7: face Z of block block_1 was not measured, 0 touches rejected"
    );
    assert_eq!(said.len(), 6);
}

#[test]
fn a_touch_that_comes_after_the_end_of_its_segment_still_counts() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1"]);
    rig.touch(
        "block_1.x",
        Vector3::new(-220.0, 0.0, 0.0),
        Vector3::x(),
        2.0,
    );
    rig.touch(
        "block_1.y",
        Vector3::new(0.0, -180.0, 0.0),
        Vector3::y(),
        2.0,
    );
    rig.segment(TestKind::Block, false, &["block_1"]);
    rig.touch(
        "block_1.z",
        Vector3::new(0.0, 0.0, 20.0),
        -Vector3::z(),
        2.0,
    );
    rig.settle();
    assert!(rig.blocks()[0].faces[Axis::Z].is_some());
    assert!(rig.diagnostics().is_empty());
}

#[test]
fn a_completed_test_waits_for_a_face_whose_touch_is_seconds_late() {
    let faces = ["block_1.x", "block_1.y", "block_1.z"];
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &faces);
    let corner = Vector3::new(-220.0, -180.0, 20.0);
    rig.touch(faces[0], corner, Vector3::x(), 2.0);
    rig.touch(faces[1], corner, Vector3::y(), 2.0);
    rig.segment(TestKind::Block, false, &faces);
    rig.now_ns += 5_000_000_000;
    rig.send(Input::Tick);
    assert!(rig.blocks().is_empty(), "the computer stood still");
    let mut without = rig.stage.clone();
    rig.touch(faces[2], corner, -Vector3::z(), 2.0);
    rig.settle();
    let block = &rig.blocks()[0];
    assert!(Axis::LINEAR.iter().all(|axis| block.faces[*axis].is_some()));

    let at = Stamp::from_nanos(rig.now_ns + 10_000_000_000);
    let mut out = Vec::new();
    without.step(at, Input::Tick, &mut out).unwrap();
    let blocks = { out.iter() }.filter(|output| matches!(output, Output::Block(_)));
    assert_eq!(blocks.count(), 1, "it is evaluated without the touch");
}

#[test]
fn a_sphere_a_ring_and_a_pin_have_their_centres_and_radii() {
    let centre = Vector3::new(60.01, -39.98, 90.005);
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Sphere, true, &["ball"]);
    let normals = [
        Vector3::z(),
        Vector3::x(),
        Vector3::y(),
        -Vector3::x(),
        -Vector3::y(),
    ];
    for (k, normal) in normals.into_iter().enumerate() {
        // Touched along the nominal normal: the ball meets a sphere of 12.502 + 3 mm.
        let from = centre + normal * 15.502;
        rig.touch_ball(&format!("ball.{}", k + 1), from, -normal, 3.0);
    }
    rig.segment(TestKind::Sphere, false, &["ball"]);
    rig.settle();
    let sphere = rig.feature();
    assert_eq!(
        (sphere.kind, sphere.n, sphere.run),
        (FeatureKind::Sphere, 5, 7)
    );
    assert!((sphere.centre_mm - centre).norm() < 1e-8);
    assert!((sphere.radius_mm - 12.502).abs() < 1e-8 && sphere.form_mm < 1e-8);
    let u_mm = (0.0003_f64 / 2.0).hypot(3.0 * 25e-6);
    assert!((sphere.radius_standard_uncertainty_mm - u_mm).abs() < 1e-9);
    assert!((sphere.centre_covariance_mm2[(0, 0)] - 0.0003_f64.powi(2) / 2.0).abs() < 1e-15);

    for (kind, name, sign, offset_mm) in [("ring", "ring", 1.0, -3.0), ("pin", "pin", -1.0, 3.0)] {
        let mut rig = Rig::new(&known_latency());
        rig.segment(TestKind::Bore, true, &[name]);
        for k in 0..6 {
            let angle = f64::from(k) * 1.047_197_551_196_597_6;
            let radial = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let ball = Vector3::new(1.0, 2.0, 40.0) + radial * (20.003 + offset_mm);
            rig.touch_ball(&format!("{name}.{}", k + 1), ball, radial * sign, 3.0);
        }
        rig.segment(TestKind::Bore, false, &[name]);
        rig.settle();
        let round = rig.feature();
        assert!(
            (round.radius_mm - 20.003).abs() < 1e-8,
            "{kind} {}",
            round.radius_mm
        );
        assert!((round.centre_mm - Vector3::new(1.0, 2.0, 40.0)).norm() < 1e-8);
        assert_eq!(round.normal, Vector3::z());
    }
}

const POLE_AND_RING: [Vector3<f64>; 5] = [
    Vector3::new(0.0, 0.0, 1.0),
    Vector3::new(1.0, 0.0, 0.0),
    Vector3::new(0.0, 1.0, 0.0),
    Vector3::new(-1.0, 0.0, 0.0),
    Vector3::new(0.0, -1.0, 0.0),
];

fn touch_ball_all_round(rig: &mut Rig, centre: Vector3<f64>) {
    for (k, normal) in POLE_AND_RING.into_iter().enumerate() {
        let from = centre + normal * 15.5;
        rig.touch_ball(&format!("ball.{}", k + 1), from, -normal, 3.0);
    }
}

#[test]
fn a_sphere_is_evaluated_at_every_pose_of_a_rotary_test() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Rotary, true, &["ball"]);
    let poses = [(-0.5, 1.0), (0.2, -2.0), (0.2, -2.0)];
    for (k, (a, c)) in poses.into_iter().enumerate() {
        (rig.rotary[Axis::A], rig.rotary[Axis::C]) = (a, c);
        touch_ball_all_round(&mut rig, Vector3::new(k as f64, 0.0, 90.0));
    }
    rig.segment(TestKind::Rotary, false, &["ball"]);
    rig.settle();
    let features = rig.features();
    assert_eq!(features.len(), 3, "{:?}", rig.diagnostics());
    for (k, (feature, (a, c))) in features.iter().zip(poses).enumerate() {
        assert!((feature.centre_mm - Vector3::new(k as f64, 0.0, 90.0)).norm() < 1e-8);
        assert!((feature.rotary_rad[Axis::A] - a).abs() < 1e-12);
        assert!((feature.rotary_rad[Axis::C] - c).abs() < 1e-12);
        let axes: Vec<_> = feature.rotary_axes.iter().collect();
        assert_eq!(axes, [Axis::A, Axis::C]);
    }
}

#[test]
fn touches_at_two_poses_are_no_sphere() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Rotary, true, &["ball"]);
    for (k, normal) in POLE_AND_RING.into_iter().enumerate() {
        rig.rotary[Axis::C] = if k < 3 { 0.0 } else { 1e-3 };
        let from = Vector3::new(0.0, 0.0, 90.0) + normal * 15.5;
        rig.touch_ball(&format!("ball.{}", k + 1), from, -normal, 3.0);
    }
    rig.segment(TestKind::Rotary, false, &["ball"]);
    rig.settle();
    assert!(rig.features().is_empty());
    let said = rig.diagnostics();
    let words = "ball was touched with axis C from 0.00000 to 0.05730 deg";
    assert!(said.len() == 1 && said[0].contains(words), "{said:?}");
}

#[test]
fn a_tilted_plane_has_its_normal_and_too_few_points_have_none() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Plane, true, &["top"]);
    let slope = 1e-4;
    for (k, (x, y)) in [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]
        .into_iter()
        .enumerate()
    {
        let point = Vector3::new(x, y, 10.0 + slope * x);
        rig.touch(&format!("top.{}", k + 1), point, -Vector3::z(), 2.0);
    }
    rig.segment(TestKind::Plane, false, &["top"]);
    rig.settle();
    let plane = rig.feature();
    assert!((plane.normal.x + slope).abs() < 1e-9 && plane.normal.z > 0.0);
    assert!((plane.centre_mm.z - 10.0).abs() < 1e-9 && plane.radius_mm.is_nan());

    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Plane, true, &["top", "nothing"]);
    rig.touch("top.1", Vector3::new(0.0, 0.0, 10.0), -Vector3::z(), 2.0);
    rig.segment(TestKind::Plane, false, &["top"]);
    rig.settle();
    assert_eq!(
        rig.diagnostics(),
        [
            "run 7: top not evaluated, 0 points rejected: 1 points were given: a plane needs at least 3",
            "run 7: the machine file has no feature \"nothing\"",
        ]
    );
}

#[test]
fn lost_touches_and_unmatched_segments_are_reported() {
    let mut rig = Rig::new(&known_latency());
    rig.touch("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    rig.sequence = 4;
    rig.touch("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    rig.segment(TestKind::Block, false, &[]);
    rig.settle();
    rig.segment(TestKind::Block, true, &[]);
    rig.segment(TestKind::Block, true, &[]);
    assert_eq!(
        rig.diagnostics(),
        [
            "touches between 1 and 5 did not arrive",
            "run 7 ended, but its begin was not seen; it is not evaluated",
            "run 7 did not end before run 7 began; it is not evaluated",
        ]
    );
}

#[test]
fn snapshot_then_resume_equals_straight_run() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1"]);
    rig.touch(
        "block_1.x",
        Vector3::new(-220.0, 0.0, 0.0),
        Vector3::x(),
        2.0,
    );
    let (stage, now_ns, sequence) = (rig.stage.clone(), rig.now_ns, rig.sequence);
    let finish = |rig: &mut Rig| {
        rig.out.clear();
        rig.touch(
            "block_1.y",
            Vector3::new(0.0, -180.0, 0.0),
            Vector3::y(),
            2.0,
        );
        rig.segment(TestKind::Block, false, &["block_1"]);
        rig.settle();
    };
    finish(&mut rig);
    let mut resumed = Rig::new(&known_latency());
    (resumed.stage, resumed.now_ns, resumed.sequence) = (stage, now_ns, sequence);
    finish(&mut resumed);
    assert_eq!(format!("{:?}", rig.out), format!("{:?}", resumed.out));
    assert_eq!(rig.blocks().len(), 1);
}
