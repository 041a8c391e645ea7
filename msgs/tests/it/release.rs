//! Messages that releases of ROS 2 define differently, against the hash and the bytes of each.

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::lifecycle_msgs::msg::{State, Transition, TransitionEvent};
use abbe_msgs::{Message, Release, from_cdr, lyrical, to_cdr};

const NAME: &str = TransitionEvent::TYPE_NAME;
/// `rosidl_generator_type_description` of Jazzy's build (`data/jazzy_type_hashes.txt`).
const JAZZY_HASH: &str = "RIHS01_d5f8873a2f0146498f812d7885c7327ce27e463d36811d8792f35ee38c0d6c38";
/// `share/lifecycle_msgs/msg/TransitionEvent.json` of Lyrical's build, lifecycle_msgs 2.4.5.
const LYRICAL_HASH: &str =
    "RIHS01_78b19e2be41a797fc009c96bda68944182edabec7852cccd928a40bc06f6f9d7";

fn step() -> (Transition, State, State) {
    let state = |id, label: &str| State {
        id,
        label: label.to_owned(),
    };
    let transition = Transition {
        id: 3,
        label: "activate".to_owned(),
    };
    (transition, state(2, "inactive"), state(13, "activating"))
}

fn jazzy(timestamp: u64) -> TransitionEvent {
    let (transition, start_state, goal_state) = step();
    TransitionEvent {
        timestamp,
        transition,
        start_state,
        goal_state,
    }
}

fn of_lyrical(sec: i32, nanosec: u32) -> lyrical::lifecycle_msgs::msg::TransitionEvent {
    let (transition, start_state, goal_state) = step();
    lyrical::lifecycle_msgs::msg::TransitionEvent {
        stamp: Time { sec, nanosec },
        transition,
        start_state,
        goal_state,
    }
}

const NANOS: u64 = 1_796_000_000_123_456_789;

#[test]
fn val_hashes_of_both_releases_are_those_of_their_builds() {
    let [jazzy, lyrical] = Release::ALL.map(|release| release.description_of(NAME).unwrap());
    assert_eq!(
        (jazzy.type_hash, lyrical.type_hash),
        (JAZZY_HASH, LYRICAL_HASH)
    );
    assert!(jazzy.definition.contains("\nuint64 timestamp\n"));
    assert!(
        lyrical
            .definition
            .contains("\nbuiltin_interfaces/Time stamp\n")
    );
    assert!(
        lyrical
            .definition
            .contains("\nMSG: builtin_interfaces/Time\n")
    );
    let [jazzy, lyrical] = Release::ALL.map(|release| release.parts_of(NAME).unwrap());
    assert_eq!(
        (jazzy.type_hash, lyrical.type_hash),
        (JAZZY_HASH, LYRICAL_HASH)
    );
    assert!(!jazzy.referenced.contains(&"builtin_interfaces/msg/Time"));
    assert!(lyrical.referenced.contains(&"builtin_interfaces/msg/Time"));
}

#[test]
fn all_other_messages_are_the_same_in_every_release() {
    for release in Release::ALL {
        for description in abbe_msgs::DESCRIPTIONS {
            let found = release.description_of(description.type_name);
            let is_same = found == Some(description);
            assert_eq!(
                is_same,
                release == Release::Jazzy || description.type_name != NAME
            );
        }
        assert_eq!(release.description_of("std_msgs/msg/Nothing"), None);
        let of_string = release.conversion("std_msgs/msg/String", JAZZY_HASH);
        assert!(of_string.is_none());
        let own = release.description_of(NAME).unwrap().type_hash;
        for hash in [own, "", "RIHS01_00"] {
            assert!(release.conversion(NAME, hash).is_none(), "{hash}");
        }
    }
}

/// The first 12 bytes: the header of little-endian CDR, then the stamp.
#[test]
fn val_bytes_of_both_releases_begin_with_their_stamp() {
    let older = to_cdr(&jazzy(NANOS));
    assert_eq!(older[..4], [0, 1, 0, 0]);
    assert_eq!(older[4..12], NANOS.to_le_bytes());
    let newer = Release::Lyrical.conversion(NAME, JAZZY_HASH).unwrap()(&older).unwrap();
    assert_eq!(newer[4..8], 1_796_000_000_u32.to_le_bytes());
    assert_eq!(newer[8..12], 123_456_789_u32.to_le_bytes());
    assert_eq!(
        newer[12..],
        older[12..],
        "what is behind the stamp is the same"
    );
    let read: lyrical::lifecycle_msgs::msg::TransitionEvent = from_cdr(&newer).unwrap();
    assert_eq!(read, of_lyrical(1_796_000_000, 123_456_789));
    let back = Release::Jazzy.conversion(NAME, LYRICAL_HASH).unwrap()(&newer).unwrap();
    assert_eq!(back, older);
}

#[test]
fn stamps_without_a_form_and_bytes_without_a_meaning_convert_to_no_wrong_time() {
    let newer = Release::Lyrical.conversion(NAME, JAZZY_HASH).unwrap();
    let older = Release::Jazzy.conversion(NAME, LYRICAL_HASH).unwrap();
    let converted = newer(&to_cdr(&jazzy(u64::MAX))).unwrap();
    let invalid = of_lyrical(-1, u32::MAX);
    assert_eq!(
        from_cdr::<lyrical::lifecycle_msgs::msg::TransitionEvent>(&converted).unwrap(),
        invalid
    );
    let back = older(&converted).unwrap();
    assert_eq!(from_cdr::<TransitionEvent>(&back).unwrap(), jazzy(0));
    let whole = to_cdr(&jazzy(NANOS));
    for len in 0..whole.len() {
        assert!(newer(&whole[..len]).is_err(), "{len}");
        assert!(older(&whole[..len]).is_err(), "{len}");
    }
}
