//! What tf is told, when, and what is said of positions that lack something.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;

use machine::{Kinematics, MachineFile};
use machine_frames::{
    Diagnostic, Input, MachineFramesConfig, MachineFramesError, MachineFramesStage, Output,
};
use metrology::sample::{FrameTransform, JointSample};
use metrology::{Axis, AxisSet, Host, PerAxis, Stage, Stamp};
use nalgebra::Isometry3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const FIVE_AXIS: &str = include_str!("../../../launch_configs/five_axis/machine.yaml");
const THREE_AXIS: &str = include_str!("../../../launch_configs/grid_xy/machine.yaml");

fn machine(text: &str) -> MachineFile {
    MachineFile::parse(text, "machine.yaml").unwrap()
}

fn stage(text: &str, config: &MachineFramesConfig) -> MachineFramesStage {
    MachineFramesStage::new(config, &machine(text), |name| format!("mill_3/{name}")).unwrap()
}

fn at(ms: i64) -> Stamp<Host> {
    Stamp::from_nanos(ms * 1_000_000)
}

fn joints(ms: i64, axes: AxisSet, position: PerAxis<f64>) -> Input {
    Input::Joints(JointSample {
        at: at(ms),
        axes,
        position,
        velocity: None,
    })
}

fn step(stage: &mut MachineFramesStage, ms: i64, input: Input) -> Vec<Output> {
    let mut out = Vec::new();
    stage.step(at(ms), input, &mut out).unwrap();
    out
}

fn moving(out: &[Output]) -> Option<&[FrameTransform]> {
    out.iter().find_map(|output| match output {
        Output::Moving(poses) => Some(poses.as_slice()),
        _ => None,
    })
}

/// A reader of tf: the newest pose of every frame.
#[derive(Default)]
struct Reader(BTreeMap<String, FrameTransform>);

impl Reader {
    fn take(&mut self, out: &[Output]) {
        for output in out {
            let (Output::Fixed(poses) | Output::Moving(poses)) = output else {
                continue;
            };
            for pose in poses {
                self.0.insert(pose.child.to_string(), pose.clone());
            }
        }
    }

    fn base_from(&self, frame: &str) -> Isometry3<f64> {
        match self.0.get(frame) {
            Some(pose) => self.base_from(&pose.parent) * pose.parent_from_child,
            None => {
                assert_eq!(frame, "mill_3/base_link", "the only frame without a parent");
                Isometry3::identity()
            }
        }
    }
}

#[test]
fn prop_what_tf_is_told_composes_to_the_machines_kinematics() {
    let mut rng = Pcg64Mcg::seed_from_u64(841);
    for text in [FIVE_AXIS, THREE_AXIS] {
        let file = machine(text);
        let kinematics = Kinematics::new(&file).unwrap();
        let mut stage = stage(text, &MachineFramesConfig::default());
        let mut reader = Reader::default();
        for k in 1..=100 {
            let position = PerAxis::from_fn(|axis| {
                let range = if axis.is_linear() { 300.0 } else { 3.0 };
                rng.random_range(-range..range)
            });
            let sample = joints(20 * k, file.axis_set(), position);
            reader.take(&step(&mut stage, 20 * k, sample));
            let probe = reader.base_from("mill_3/probe_tip");
            let found = reader.base_from("mill_3/workpiece").inverse() * probe;
            let apart = found.inverse() * kinematics.workpiece_from_probe(&position);
            assert!(apart.translation.vector.norm() < 1e-9, "{apart}");
            assert!(apart.rotation.imag().norm() < 1e-12, "{apart}");
        }
    }
}

#[test]
fn fixed_frames_are_told_once_and_moving_ones_with_every_position() {
    let mut stage = stage(FIVE_AXIS, &MachineFramesConfig::default());
    let axes = machine(FIVE_AXIS).axis_set();
    let first = step(&mut stage, 1000, Input::Tick);
    let [Output::Fixed(fixed)] = first.as_slice() else {
        panic!("{first:?}");
    };
    assert!(fixed.iter().any(|pose| *pose.child == *"mill_3/probe_tip"));
    assert!(fixed.iter().all(|pose| pose.at == at(1000)));
    for ms in [1020, 1040, 1060] {
        let out = step(&mut stage, ms + 1, joints(ms, axes, PerAxis([0.0; 6])));
        let poses = moving(&out).unwrap();
        assert_eq!(out.len(), 1, "{out:?}");
        assert_eq!(poses.len(), 6);
        assert!(
            poses.iter().all(|pose| pose.at == at(ms)),
            "by the positions' stamp"
        );
        let is_fixed = |pose: &FrameTransform| fixed.iter().any(|f| f.child == pose.child);
        assert!(!poses.iter().any(is_fixed));
    }
    let again = step(&mut stage, 1062, joints(1060, axes, PerAxis([0.0; 6])));
    assert_eq!(again, [], "tf takes one pose of an instant");
    let back = step(&mut stage, 1063, joints(500, axes, PerAxis([0.0; 6])));
    assert!(
        moving(&back).is_some(),
        "a bag that is played again begins anew"
    );
}

#[test]
fn a_greatest_rate_is_kept() {
    let config = MachineFramesConfig {
        rate_hz: 10.0,
        ..MachineFramesConfig::default()
    };
    let mut stage = stage(THREE_AXIS, &config);
    let told = (0..100).filter(|k| {
        let sample = joints(20 * k, AxisSet::XYZ, PerAxis([0.0; 6]));
        moving(&step(&mut stage, 20 * k, sample)).is_some()
    });
    assert_eq!(told.count(), 20, "2 s at 10 Hz out of 50 Hz");
}

#[test]
fn what_an_untold_axis_moves_is_not_told_and_that_is_said_once() {
    let mut stage = stage(FIVE_AXIS, &MachineFramesConfig::default());
    let lacking: AxisSet = [Axis::Z, Axis::C].into_iter().collect();
    let axes = machine(FIVE_AXIS).axis_set();
    let told: AxisSet = axes
        .iter()
        .filter(|axis| !lacking.contains(*axis))
        .collect();
    let out = step(&mut stage, 20, joints(20, told, PerAxis([0.0; 6])));
    let said = Output::Diagnostic(Diagnostic::Lacking { axes: lacking });
    assert!(out.contains(&said), "{out:?}");
    let names: Vec<_> = moving(&out).unwrap().iter().map(|p| &*p.child).collect();
    let expected = [
        "mill_3/machine",
        "mill_3/x_slide",
        "mill_3/y_slide",
        "mill_3/a_rotary",
    ];
    assert_eq!(names, expected);
    let out = step(&mut stage, 40, joints(40, told, PerAxis([0.0; 6])));
    assert_eq!(out.len(), 1, "{out:?}");
    let out = step(&mut stage, 60, joints(60, axes, PerAxis([0.0; 6])));
    assert!(out.contains(&Output::Diagnostic(Diagnostic::Complete)));
    let none = step(
        &mut stage,
        80,
        joints(80, AxisSet::EMPTY, PerAxis([0.0; 6])),
    );
    assert!(moving(&none).is_none());
}

#[test]
fn silence_is_said_once_and_ends_with_the_next_position() {
    let mut stage = stage(THREE_AXIS, &MachineFramesConfig::default());
    step(&mut stage, 0, joints(0, AxisSet::XYZ, PerAxis([0.0; 6])));
    assert_eq!(step(&mut stage, 4_999, Input::Tick), []);
    let out = step(&mut stage, 5_000, Input::Tick);
    assert_eq!(out, [Output::Diagnostic(Diagnostic::Silent { for_s: 5.0 })]);
    assert_eq!(step(&mut stage, 6_000, Input::Tick), []);
    let out = step(
        &mut stage,
        6_500,
        joints(6_500, AxisSet::XYZ, PerAxis([0.0; 6])),
    );
    assert_eq!(out[0], Output::Diagnostic(Diagnostic::Heard));
}

#[test]
fn a_parameter_out_of_range_is_refused_with_its_limits() {
    let config = MachineFramesConfig {
        rate_hz: -1.0,
        ..MachineFramesConfig::default()
    };
    let refused = MachineFramesStage::new(&config, &machine(THREE_AXIS), str::to_owned);
    let error = refused.unwrap_err();
    assert!(matches!(error, MachineFramesError::Parameter(_)));
    assert_eq!(
        error.to_string(),
        "rate_hz = -1 Hz: must be from 0 to 1000 Hz"
    );
}
