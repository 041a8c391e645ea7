//! Type hashes against those of ROS 2 Jazzy's own build.

#![expect(
    clippy::unwrap_used,
    reason = "a test fails by panicking, in its helper functions too"
)]

use std::collections::BTreeMap;

use abbe_msgs::tf2_msgs::action::LookupTransform;
use abbe_msgs::{
    Action, DESCRIPTIONS, FeedbackMessage, GetResult, Message, SendGoal, Service, action_msgs,
    description_of, lifecycle_msgs, msg, rcl_interfaces, std_msgs, std_srvs,
    type_description_interfaces,
};

fn jazzy() -> BTreeMap<&'static str, &'static str> {
    include_str!("../data/jazzy_type_hashes.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_once(' ').unwrap())
        .collect()
}

fn service<S: Service>() -> (&'static str, &'static str) {
    (S::TYPE_NAME, S::TYPE_HASH)
}

#[test]
fn val_jazzy_hashes_of_every_standard_message_are_equal() {
    let jazzy = jazzy();
    let standard = DESCRIPTIONS
        .iter()
        .filter(|description| !description.type_name.starts_with("abbe_msgs/"));
    let mut n_compared = 0;
    for description in standard {
        let name = description.type_name;
        assert_eq!(Some(&description.type_hash), jazzy.get(name), "{name}");
        n_compared += 1;
    }
    let n_travelling = jazzy
        .keys()
        .filter(|name| {
            let parts = ["_Request", "_Response", "_Event"];
            name.contains("/msg/") || parts.iter().any(|part| name.ends_with(part))
        })
        .count();
    // The parts of LookupTransform: goal, result, feedback and the feedback message.
    assert_eq!(n_compared, n_travelling + 4);
}

#[test]
fn val_jazzy_hashes_of_services_are_equal() {
    let jazzy = jazzy();
    let services = [
        service::<action_msgs::srv::CancelGoal>(),
        service::<lifecycle_msgs::srv::ChangeState>(),
        service::<lifecycle_msgs::srv::GetAvailableStates>(),
        service::<lifecycle_msgs::srv::GetAvailableTransitions>(),
        service::<lifecycle_msgs::srv::GetState>(),
        service::<rcl_interfaces::srv::DescribeParameters>(),
        service::<rcl_interfaces::srv::GetLoggerLevels>(),
        service::<rcl_interfaces::srv::GetParameterTypes>(),
        service::<rcl_interfaces::srv::GetParameters>(),
        service::<rcl_interfaces::srv::ListParameters>(),
        service::<rcl_interfaces::srv::SetLoggerLevels>(),
        service::<rcl_interfaces::srv::SetParameters>(),
        service::<rcl_interfaces::srv::SetParametersAtomically>(),
        service::<std_srvs::srv::Empty>(),
        service::<std_srvs::srv::SetBool>(),
        service::<std_srvs::srv::Trigger>(),
        service::<type_description_interfaces::srv::GetTypeDescription>(),
        service::<SendGoal<LookupTransform>>(),
        service::<GetResult<LookupTransform>>(),
    ];
    for (name, hash) in services {
        assert_eq!(Some(&hash), jazzy.get(name), "{name}");
    }
}

#[test]
fn val_jazzy_hash_of_an_action_is_equal() {
    let name = LookupTransform::TYPE_NAME;
    assert_eq!(Some(&LookupTransform::TYPE_HASH), jazzy().get(name));
}

#[test]
fn hashes_tell_types_of_equal_fields_apart() {
    assert_ne!(
        std_srvs::srv::TriggerResponse::TYPE_HASH,
        std_srvs::srv::SetBoolResponse::TYPE_HASH
    );
}

#[test]
fn descriptions_are_found_by_type_name() {
    for description in DESCRIPTIONS {
        assert_eq!(description_of(description.type_name), Some(description));
    }
    let feedback = FeedbackMessage::<LookupTransform>::DESCRIPTION;
    assert_eq!(description_of(feedback.type_name), Some(&feedback));
    assert_eq!(description_of("std_msgs/msg/Nothing"), None);
}

#[test]
fn a_schema_holds_every_nested_definition_once() {
    let text = msg::ThermalModel::DEFINITION;
    let names: Vec<_> = text
        .lines()
        .filter_map(|line| line.strip_prefix("MSG: "))
        .collect();
    assert_eq!(
        names,
        [
            "abbe_msgs/AxisDrift",
            "abbe_msgs/DriftGrowth",
            "builtin_interfaces/Time",
            "geometry_msgs/Point",
            "geometry_msgs/Vector3",
            "std_msgs/Header",
        ]
    );
    let separator = "=".repeat(80);
    assert_eq!(
        text.lines().filter(|line| *line == separator).count(),
        names.len()
    );
    assert!(text.starts_with(include_str!("../../msg/ThermalModel.msg")));
    let feedback = FeedbackMessage::<LookupTransform>::DEFINITION;
    assert!(feedback.contains("\ntf2_msgs/action/LookupTransform_Feedback feedback\n"));
    assert!(feedback.contains("\nMSG: tf2_msgs/action/LookupTransform_Feedback\n"));
    assert!(std_msgs::msg::String::DEFINITION.ends_with("string data\n"));
}
