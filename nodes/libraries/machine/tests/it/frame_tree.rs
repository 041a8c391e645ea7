//! The frames of a machine against its kinematics, and against places worked out by hand.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::f64::consts::{FRAC_PI_2, PI};

use machine::file::{BeamEntry, GridPlacement, GridPlane, LengthReferenceEntry, TableEntry};
use machine::frames::{BASE, MACHINE, PROBE_TIP, SPINDLE_NOSE, TABLE, WORKPIECE};
use machine::{FrameTree, Kinematics, MachineFile};
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BENCH: &str = include_str!("../data/bench.yaml");
const FIVE_AXIS: &str = include_str!("../../../../../launch_configs/five_axis/machine.yaml");
const FIRST_RUN: &str = include_str!("../../../../../launch_configs/first_run/machine.yaml");
const THREE_AXIS: &str = include_str!("../../../../../launch_configs/grid_xy/machine.yaml");
const BY_LINUXCNC: &str =
    include_str!("../../../../../launch_configs/linuxcnc_latency/machine.yaml");

fn parsed(text: &str) -> MachineFile {
    MachineFile::parse(text, "machine.yaml").unwrap()
}

fn with_chain(chain: &str) -> MachineFile {
    parsed(&BENCH.replace("[w C' A' Y' b X Z t]", chain))
}

/// Pose of a frame in the bed, composed link by link as a reader of tf does it.
fn base_from(tree: &FrameTree, name: &str, positions: &PerAxis<f64>) -> Isometry3<f64> {
    let mut pose = Isometry3::identity();
    let mut name = name;
    while name != BASE {
        let frame = tree.frames().iter().find(|frame| frame.name() == name);
        let frame = frame.unwrap_or_else(|| panic!("no frame {name}"));
        pose = frame.parent_from_frame(positions) * pose;
        name = frame.parent();
    }
    pose
}

fn from_to(tree: &FrameTree, names: [&str; 2], positions: &PerAxis<f64>) -> Isometry3<f64> {
    let [to, from] = names.map(|name| base_from(tree, name, positions));
    to.inverse() * from
}

fn random_pose(rng: &mut Pcg64Mcg) -> PerAxis<f64> {
    PerAxis::from_fn(|axis| {
        let range = if axis.is_linear() { 500.0 } else { PI };
        rng.random_range(-range..range)
    })
}

fn assert_composes(file: &MachineFile, rng: &mut Pcg64Mcg) {
    let (tree, kinematics) = (
        FrameTree::new(file).unwrap(),
        Kinematics::new(file).unwrap(),
    );
    for _ in 0..200 {
        let positions = random_pose(rng);
        let found = from_to(&tree, [WORKPIECE, PROBE_TIP], &positions);
        let expected = kinematics.workpiece_from_probe(&positions);
        let apart_mm = (found.translation.vector - expected.translation.vector).norm();
        assert!(apart_mm < 1e-9, "{}: {apart_mm} mm", file.chain);
        let turned = found.rotation.inverse() * expected.rotation;
        assert!(turned.imag().norm() < 1e-12, "{}: {turned}", file.chain);
        let ball_mm = from_to(&tree, [MACHINE, PROBE_TIP], &positions).translation;
        let expected_mm = kinematics.ball_in_machine_mm(&positions);
        assert!(
            (ball_mm.vector - expected_mm).norm() < 1e-9,
            "{}",
            file.chain
        );
        let direction = Vector3::new(0.6, -0.48, 0.64);
        let found = from_to(&tree, [WORKPIECE, MACHINE], &positions).rotation * direction;
        let expected = kinematics.direction_in_workpiece(&positions, &direction);
        assert!((found - expected).norm() < 1e-12, "{}", file.chain);
    }
}

#[test]
fn prop_frames_compose_to_the_machines_kinematics() {
    let mut rng = Pcg64Mcg::seed_from_u64(103_105);
    for text in [FIVE_AXIS, FIRST_RUN, THREE_AXIS, BY_LINUXCNC] {
        assert_composes(&parsed(text), &mut rng);
    }
    for chain in [
        "[w Y' b X Z C A t]",
        "[w C' Y' b X Z A t]",
        "[w A' C' X' Y' Z' b t]",
        "[w Y' C' b A X Z t]",
    ] {
        assert_composes(&with_chain(chain), &mut rng);
    }
}

#[test]
fn the_frames_of_a_trunnion_machine_are_a_tree_below_its_bed() {
    let tree = FrameTree::new(&parsed(FIRST_RUN)).unwrap();
    let found: Vec<_> = tree
        .frames()
        .iter()
        .map(|frame| {
            let axes: String = frame.axes().iter().map(Axis::letter).collect();
            format!("{} < {} {axes}", frame.name(), frame.parent())
        })
        .collect();
    assert_eq!(
        found,
        [
            "machine < base_link Y",
            "x_slide < base_link X",
            "z_slide < x_slide Z",
            "spindle_nose < z_slide ",
            "probe_tip < spindle_nose ",
            "y_slide < base_link Y",
            "a_rotary < y_slide A",
            "c_rotary < a_rotary C",
            "workpiece < c_rotary ",
            "block/block_1 < workpiece ",
            "block/block_2 < workpiece ",
            "grid/table < workpiece ",
            "grid_head/table < probe_tip ",
        ]
    );
    let axes: AxisSet = [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C]
        .into_iter()
        .collect();
    assert_eq!(tree.axes(), axes);
    let fixed = FrameTree::new(&parsed(BY_LINUXCNC)).unwrap();
    let machine = fixed.frames().iter().find(|frame| frame.name() == MACHINE);
    assert!(
        machine.unwrap().axes().is_empty(),
        "nothing moves its table"
    );
}

/// The table of `[w C' A' Y' b X Z t]`, A's line 50 mm above the zero, at Y = 10, A = 90 deg: A turns the table
/// right-handed about +X, so that what was above A's line points to -Y, and Y' has gone the other way.
#[test]
fn a_quarter_turn_of_the_trunnion_is_where_a_hand_finds_it() {
    let file = parsed(FIRST_RUN);
    let tree = FrameTree::new(&file).unwrap();
    let positions = PerAxis([1.0, 10.0, 100.0, FRAC_PI_2, 0.0, 0.0]);
    let near = |name: &str, expected: [f64; 3]| {
        let found = base_from(&tree, name, &positions).translation.vector;
        assert!(
            (found - Vector3::from(expected)).norm() < 1e-9,
            "{name}: {found}"
        );
    };
    near("y_slide", [0.0, -10.0, 0.0]);
    near("a_rotary", [0.0, -10.0, 50.0]);
    near("c_rotary", [0.0, 40.0, 50.0]);
    near(WORKPIECE, [0.0, 40.0, 50.0]);
    // 220, 180, 200 is 150 above A's line and 180 behind it.
    near("block/block_2", [220.0, -160.0, 230.0]);
    near(PROBE_TIP, [1.0, 0.0, 100.0]);
    near(SPINDLE_NOSE, [1.0, 0.0, 250.0]);
    near(MACHINE, [0.0, -10.0, 0.0]);
    let up = base_from(&tree, WORKPIECE, &positions).rotation * Vector3::z();
    assert!((up + Vector3::y()).norm() < 1e-12, "{up}");
}

#[test]
fn a_head_over_the_middle_of_its_plate_is_at_the_plates_origin_and_reads_along_its_axes() {
    let file = parsed(THREE_AXIS);
    let tree = FrameTree::new(&file).unwrap();
    let placements = &file.grid_encoder.as_ref().unwrap().placements;
    assert!(!placements.is_empty());
    for placement in placements {
        let names = [
            format!("grid/{}", placement.id),
            format!("grid_head/{}", placement.id),
        ];
        let names = [names[0].as_str(), names[1].as_str()];
        let middle_mm = placement.axes_at_centre_mm();
        let [u, v, _] = placement.plane.axes();
        let mut positions = PerAxis([middle_mm.x, middle_mm.y, middle_mm.z, 0.0, 0.0, 0.0]);
        let head = from_to(&tree, names, &positions);
        assert!(head.translation.vector.norm() < 1e-9, "{}", placement.id);
        positions[u] += 12.0;
        positions[v] -= 7.0;
        let head = from_to(&tree, names, &positions);
        let expected = Vector3::new(12.0, -7.0, 0.0);
        assert!((head.translation.vector - expected).norm() < 1e-9, "{head}");
    }
}

fn beam(id: &str, from_mm: [f64; 3], to_mm: [f64; 3], tool_offset_mm: [f64; 3]) -> BeamEntry {
    BeamEntry {
        id: id.to_owned(),
        from_mm,
        to_mm,
        tool_offset_mm,
    }
}

/// A three-axis machine with a standing plate, two beams and a table.
fn furnished() -> MachineFile {
    let mut file = parsed(THREE_AXIS);
    let grid = file.grid_encoder.as_mut().unwrap();
    grid.placements = vec![GridPlacement {
        id: "wall".to_owned(),
        plane: GridPlane::Zx,
        centre_mm: [1.0, 2.0, 3.0],
        tool_offset_mm: [4.0, 5.0, 6.0],
    }];
    file.length_reference = Some(LengthReferenceEntry {
        resolution_um: 0.01,
        beams: vec![
            beam(
                "slant",
                [-100.0, -50.0, 20.0],
                [80.0, 70.0, 140.0],
                [0.0, 9.0, 0.0],
            ),
            beam("back", [50.0, 0.0, 0.0], [-50.0, 0.0, 0.0], [0.0; 3]),
        ],
    });
    file.table = Some(TableEntry {
        top_z_mm: -30.0,
        radius_mm: 200.0,
        nose_radius_mm: 40.0,
    });
    file.check("machine.yaml").unwrap();
    file
}

#[test]
fn every_frame_is_right_handed_and_a_beams_x_goes_from_its_beginning_to_its_end() {
    let tree = FrameTree::new(&furnished()).unwrap();
    let positions = PerAxis([0.0; 6]);
    for frame in tree.frames() {
        let turn = frame.parent_from_frame(&positions).rotation;
        let turn = turn.to_rotation_matrix().into_inner();
        assert!((turn.determinant() - 1.0).abs() < 1e-12, "{}", frame.name());
        let unit = turn.transpose() * turn;
        assert!(
            (unit - Matrix3::identity()).norm() < 1e-12,
            "{}",
            frame.name()
        );
    }
    let length_mm = (180.0_f64.powi(2) + 120.0_f64.powi(2) * 2.0).sqrt();
    let end = Point3::new(length_mm, 0.0, 0.0);
    let end = from_to(&tree, [WORKPIECE, "beam/slant"], &positions) * end;
    assert!(
        (end - Point3::new(80.0, 79.0, 140.0)).norm() < 1e-9,
        "{end}"
    );
    let begin = PerAxis([-100.0, -50.0, 20.0, 0.0, 0.0, 0.0]);
    let apart = from_to(&tree, ["beam/slant", "reflector/slant"], &begin);
    assert!(apart.translation.vector.norm() < 1e-9 && apart.rotation.angle() < 1e-7);
    let back = from_to(&tree, [WORKPIECE, "beam/back"], &positions).rotation * Vector3::x();
    assert!((back + Vector3::x()).norm() < 1e-12, "{back}");
    let top = from_to(&tree, [WORKPIECE, TABLE], &positions)
        .translation
        .vector;
    assert!((top - Vector3::new(0.0, 0.0, -30.0)).norm() < 1e-12);
    let normal = from_to(&tree, [WORKPIECE, "grid/wall"], &positions).rotation * Vector3::z();
    assert!(
        (normal - Vector3::y()).norm() < 1e-12,
        "the plane Z X has Y up: {normal}"
    );
}
