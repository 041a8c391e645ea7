//! Bytes on the wire: against another implementation, and against anything a network may bring.

#![expect(
    clippy::unwrap_used,
    reason = "a test fails by panicking, in its helper functions too"
)]

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};
use abbe_msgs::geometry_msgs::msg::PoseWithCovariance;
use abbe_msgs::rcl_interfaces::msg::{FloatingPointRange, ParameterDescriptor};
use abbe_msgs::sensor_msgs::msg::JointState;
use abbe_msgs::std_msgs::msg::{Empty, Header};
use abbe_msgs::{Message, from_cdr, msg, to_cdr, to_cdr_into};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

fn header() -> Header {
    Header {
        stamp: Time {
            sec: 1_700_000_000,
            nanosec: 123_456_789,
        },
        frame_id: "abc".to_owned(),
    }
}

fn joint_state() -> JointState {
    JointState {
        header: header(),
        name: vec!["X".to_owned(), "Cc".to_owned()],
        position: vec![0.25, -1.5],
        velocity: vec![],
        effort: vec![3.0],
    }
}

fn unhex(hex: &str) -> Vec<u8> {
    (0..hex.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap())
        .collect()
}

/// Bytes from PyPI rosbags 0.11.9, `serialize_cdr` of `Stores.ROS2_JAZZY`, both endiannesses.
fn assert_same_bytes<M: Message>(message: &M, little: &str, big: &str) {
    assert_eq!(to_cdr(message), unhex(little), "{}", M::TYPE_NAME);
    assert_eq!(&from_cdr::<M>(&unhex(little)).unwrap(), message);
    assert_eq!(&from_cdr::<M>(&unhex(big)).unwrap(), message);
}

#[test]
fn val_rosbags_bytes_of_strings_and_sequences_are_equal() {
    assert_same_bytes(
        &joint_state(),
        "0001000000f1536515cd5b070400000061626300020000000200000058000000030000004363000002000000000000000000d03f000000000000f8bf00000000010000000000000000000840",
        "000000006553f100075bcd1500000004616263000000000200000002580000000000000343630000000000023fd0000000000000bff800000000000000000000000000014008000000000000",
    );
}

#[test]
fn val_rosbags_bytes_of_nested_messages_are_equal() {
    let array = DiagnosticArray {
        header: header(),
        status: vec![DiagnosticStatus {
            level: DiagnosticStatus::ERROR,
            name: "n".to_owned(),
            message: String::new(),
            hardware_id: "hw".to_owned(),
            values: vec![KeyValue {
                key: "k".to_owned(),
                value: "v".to_owned(),
            }],
        }],
    };
    assert_same_bytes(
        &array,
        "0001000000f1536515cd5b0704000000616263000100000002000000020000006e0000000100000000000000030000006877000001000000020000006b000000020000007600",
        "000000006553f100075bcd1500000004616263000000000102000000000000026e0000000000000100000000000000036877000000000001000000026b000000000000027600",
    );
}

#[test]
fn val_rosbags_bytes_of_bounded_sequences_are_equal() {
    let descriptor = ParameterDescriptor {
        name: "p".to_owned(),
        r#type: 3,
        description: "\u{b5}".to_owned(),
        read_only: true,
        floating_point_range: vec![FloatingPointRange {
            from_value: 0.5,
            to_value: 2.0,
            step: 0.0,
        }],
        ..ParameterDescriptor::default()
    };
    assert_same_bytes(
        &descriptor,
        "00010000020000007000030003000000c2b5000001000000000100000100000000000000000000000000e03f0000000000000040000000000000000000000000",
        "00000000000000027000030000000003c2b50000000000010001000000000001000000003fe00000000000004000000000000000000000000000000000000000",
    );
}

#[test]
fn val_rosbags_bytes_of_a_message_without_fields_are_equal() {
    assert_same_bytes(&Empty::default(), "0001000000", "0000000000");
}

#[test]
fn val_rosbags_bytes_of_an_array_of_36_are_equal() {
    let mut pose = PoseWithCovariance::default();
    (
        pose.pose.position.x,
        pose.pose.position.y,
        pose.pose.position.z,
    ) = (1.0, 2.0, 3.0);
    for (entry, value) in pose.covariance.iter_mut().zip(0..) {
        *entry = f64::from(value);
    }
    let bytes = to_cdr(&pose);
    assert_eq!(bytes.len(), 348);
    let start = "00010000000000000000f03f00000000000000400000000000000840000000000000000000000000000000000000000000000000000000000000f03f0000000000000000";
    assert_eq!(bytes[..68], unhex(start));
    assert_eq!(bytes[332..], unhex("00000000000041400000000000804140"));
    assert_eq!(from_cdr::<PoseWithCovariance>(&bytes).unwrap(), pose);
}

#[test]
fn a_buffer_is_used_again() {
    let mut bytes = Vec::with_capacity(512);
    let place = bytes.as_ptr();
    for _ in 0..3 {
        to_cdr_into(&joint_state(), &mut bytes);
        assert_eq!(bytes, to_cdr(&joint_state()));
    }
    assert_eq!(bytes.as_ptr(), place);
}

fn refusal<M: Message>(bytes: &[u8]) -> String {
    from_cdr::<M>(bytes).unwrap_err().to_string()
}

#[test]
fn every_truncation_is_refused() {
    let bytes = to_cdr(&joint_state());
    for len in 0..bytes.len() {
        let message = refusal::<JointState>(&bytes[..len]);
        assert!(
            message.starts_with("sensor_msgs/msg/JointState: "),
            "{message}"
        );
    }
    assert_eq!(
        refusal::<JointState>(&bytes[..3]),
        "sensor_msgs/msg/JointState: 3 bytes: the encapsulation header alone has 4"
    );
    assert_eq!(
        refusal::<JointState>(&bytes[..20]),
        "sensor_msgs/msg/JointState: malformed at byte 20 of 20: unexpected end of input"
    );
}

#[test]
fn a_huge_length_is_refused_at_the_end_of_the_bytes() {
    let mut bytes = to_cdr(&joint_state());
    let length_of_name = 20;
    bytes[length_of_name..length_of_name + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let message = refusal::<JointState>(&bytes);
    assert!(
        message.ends_with("of 76: unexpected end of input"),
        "{message}"
    );
    let length_of_frame_id = 12;
    bytes[length_of_frame_id..length_of_frame_id + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let message = refusal::<JointState>(&bytes);
    assert!(
        message.ends_with("at byte 16 of 76: unexpected end of input"),
        "{message}"
    );
}

#[test]
fn other_encodings_and_other_types_are_refused() {
    let mut bytes = to_cdr(&joint_state());
    bytes[1] = 0x03;
    assert_eq!(
        refusal::<JointState>(&bytes),
        "sensor_msgs/msg/JointState: encapsulation 0x0003: must be 0x0000 or 0x0001 (plain CDR)"
    );
    bytes[1] = 0x01;
    assert_eq!(
        refusal::<Header>(&bytes),
        "std_msgs/msg/Header: 56 bytes after the end: at most 3 may pad it"
    );
    bytes.extend([0; 3]);
    assert_eq!(from_cdr::<JointState>(&bytes).unwrap(), joint_state());
    bytes.push(0);
    assert!(from_cdr::<JointState>(&bytes).is_err());
}

#[test]
fn a_bad_boolean_and_a_bad_text_are_refused() {
    let bytes = [0, 1, 0, 0, 2];
    assert_eq!(
        refusal::<abbe_msgs::std_msgs::msg::Bool>(&bytes),
        "std_msgs/msg/Bool: malformed at byte 5 of 5: Expected 0 or 1 as Boolean, got: 2"
    );
    let bytes = [0, 1, 0, 0, 2, 0, 0, 0, 0xff, 0];
    let message = refusal::<abbe_msgs::std_msgs::msg::String>(&bytes);
    assert!(message.contains("UTF-8 error"), "{message}");
}

/// Decodes as several types; whatever decodes must encode to bytes that decode to the same bytes.
fn decode_all(bytes: &[u8]) {
    fn decode<M: Message>(bytes: &[u8]) {
        if let Ok(message) = from_cdr::<M>(bytes) {
            let again = to_cdr(&message);
            assert_eq!(to_cdr(&from_cdr::<M>(&again).unwrap()), again);
        }
    }
    decode::<msg::AxisState>(bytes);
    decode::<msg::ThermalModel>(bytes);
    decode::<msg::TestSegment>(bytes);
    decode::<DiagnosticArray>(bytes);
    decode::<ParameterDescriptor>(bytes);
    decode::<PoseWithCovariance>(bytes);
}

fn fixed_seed(cases: u32) -> TestRunner {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
    TestRunner::new_with_rng(config, rng)
}

#[test]
fn prop_random_bytes_never_panic() {
    let bytes = (0..2_u8, prop::collection::vec(any::<u8>(), 0..400));
    fixed_seed(4000)
        .run(&bytes, |(kind, payload)| {
            let mut bytes = vec![0, kind, 0, 0];
            bytes.extend(payload);
            decode_all(&bytes);
            Ok(())
        })
        .unwrap();
}

#[test]
fn prop_damaged_messages_never_panic() {
    let damage = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4);
    let original = to_cdr(&joint_state());
    fixed_seed(4000)
        .run(&(damage, any::<prop::sample::Index>()), |(damage, end)| {
            let mut bytes = original.clone();
            for (at, value) in damage {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            bytes.truncate(end.index(bytes.len() + 1));
            if let Ok(message) = from_cdr::<JointState>(&bytes) {
                let again = to_cdr(&message);
                prop_assert_eq!(to_cdr(&from_cdr::<JointState>(&again).unwrap()), again);
            }
            decode_all(&bytes);
            Ok(())
        })
        .unwrap();
}
