//! The frames of a machine as a reader of tf has them: Cyclone DDS listens, the test composes.

use std::collections::BTreeMap;
use std::time::Duration;

use abbe_msgs::tf2_msgs::msg::TFMessage;
use abbe_msgs::topics;
use abbe_tests::cyclone::{Cyclone, named_end};
use abbe_tests::program::{Process, domain};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use machine::{Kinematics, MachineFile};
use metrology::{Axis, PerAxis};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde_json::Value;

use crate::wire::{numbers, seconds};

const NAMESPACE: &str = "/mill_3";
/// Joint states of the talkative cell, and tf with them, per second.
const RATE_HZ: f64 = 50.0;

fn named(topic: &str) -> String {
    format!("{NAMESPACE}/{topic}")
}

/// A node of the machine in its namespace.
fn node(scenario: &Scenario, domain: u16, name: &str) -> Process {
    let file = scenario.argument(&format!("{name}.yaml"));
    let namespace = format!("__ns:={NAMESPACE}");
    Process::node(domain, name, &["-r", &namespace, "--params-file", &file])
}

/// Pose of every frame in its parent, m.
#[derive(Default)]
struct Tree(BTreeMap<String, (String, Isometry3<f64>)>);

impl Tree {
    fn take(&mut self, message: &Value) {
        for entry in message["transforms"].as_array().unwrap() {
            let part = |kind: &str, name: &str| entry["transform"][kind][name].as_f64().unwrap();
            let place = ["x", "y", "z"].map(|name| part("translation", name));
            let [i, j, k, w] = ["x", "y", "z", "w"].map(|name| part("rotation", name));
            let turn = Quaternion::new(w, i, j, k);
            assert!((turn.norm() - 1.0).abs() < 1e-12, "{entry}");
            let pose = Isometry3::from_parts(
                Translation3::from(place),
                UnitQuaternion::new_unchecked(turn),
            );
            let text = |value: &Value| value.as_str().unwrap().to_owned();
            let parent = text(&entry["header"]["frame_id"]);
            self.0
                .insert(text(&entry["child_frame_id"]), (parent, pose));
        }
    }

    fn base_from(&self, frame: &str) -> Isometry3<f64> {
        match self.0.get(frame) {
            Some((parent, pose)) => self.base_from(parent) * pose,
            None => {
                assert_eq!(frame, "mill_3/base_link", "a frame without a parent");
                Isometry3::identity()
            }
        }
    }
}

#[test]
fn cyclone_reads_moving_frames_and_who_comes_late_the_fixed_ones() {
    let Some(python) = interpreter("cyclone reads tf and tf_static") else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("first_run"), domain(7));
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 100.0",
    );
    let start = "start_mm: {X: 12.0, Y: -34.0, Z: 240.0}\n    start_deg: {A: -35.0, C: 80.0}";
    scenario.replace("fake_cnc.yaml", "start_mm: {Z: 240.0}", start);
    let nodes = ["fake_cnc", "machine_frames"].map(|name| node(&scenario, domain, name));
    // Fixed frames are told within a second of the start: the peer comes when that is long past.
    std::thread::sleep(Duration::from_secs(4));
    let [fixed, moving, joints, states] = [
        topics::TF_STATIC.name,
        topics::TF.name,
        topics::JOINT_STATES.name,
        topics::AXES_STATE.name,
    ]
    .map(named);
    let readers = [
        named_end::<TFMessage>(&fixed, true, true, 1),
        named_end::<TFMessage>(&moving, true, false, 100),
        named_end::<abbe_msgs::sensor_msgs::msg::JointState>(&joints, false, false, 100),
        named_end::<abbe_msgs::msg::AxisState>(&states, true, false, 100),
    ];
    let mut cyclone = Cyclone::start(&python, domain, &readers, &[]);
    cyclone.matched_after_s(&moving);
    let told = cyclone.samples_within(&moving, Duration::from_secs(3));
    let latched = cyclone.samples_within(&fixed, Duration::ZERO);
    assert_eq!(latched.len(), 1, "fixed frames are told once");
    assert!(told.len() as f64 > 2.0 * RATE_HZ, "{} of tf", told.len());
    let joints = cyclone.samples_within(&joints, Duration::ZERO);
    let state = &cyclone.samples_within(&states, Duration::ZERO)[0];
    assert_eq!(state["header"]["frame_id"], "mill_3");
    let compared = compare(&scenario, &latched[0], &told, &joints);
    eprintln!("{} of tf, {compared} compared", told.len());
    assert!(compared > 50, "{compared} of {}", told.len());
    cyclone.stop();
    for node in nodes {
        node.stop();
    }
}

/// What was heard of tf against the machine's kinematics at the joint states of the same instant; how many.
fn compare(scenario: &Scenario, latched: &Value, told: &[Value], joints: &[Value]) -> usize {
    let text = std::fs::read_to_string(scenario.path("machine.yaml")).unwrap();
    let kinematics = Kinematics::new(&MachineFile::parse(&text, "machine.yaml").unwrap()).unwrap();
    let mut tree = Tree::default();
    tree.take(latched);
    let mut compared = 0;
    for message in told {
        tree.take(message);
        let stamp = &message["transforms"][0]["header"]["stamp"];
        let same = joints
            .iter()
            .find(|joint| joint["header"]["stamp"] == *stamp);
        let Some(joint) = same else { continue };
        let read = numbers(&joint["position"]);
        assert!((read[1] + 0.034).abs() < 1e-4 && (read[4] - 80_f64.to_radians()).abs() < 1e-4);
        let [x, y, z, a, c] = [0, 1, 2, 3, 4].map(|idx| read[idx]);
        let mut positions = PerAxis([x * 1e3, y * 1e3, z * 1e3, a, 0.0, 0.0]);
        positions[Axis::C] = c;
        let mut expected = kinematics.workpiece_from_probe(&positions);
        expected.translation.vector /= 1e3;
        let [workpiece, probe] = ["workpiece", "probe_tip"].map(|name| format!("mill_3/{name}"));
        let found = tree.base_from(&workpiece).inverse() * tree.base_from(&probe);
        let apart = found.inverse() * expected;
        assert!(
            apart.translation.vector.norm() < 1e-12,
            "{} s: {apart}",
            seconds(stamp)
        );
        assert!(
            apart.rotation.imag().norm() < 1e-12,
            "{} s: {apart}",
            seconds(stamp)
        );
        compared += 1;
    }
    compared
}
