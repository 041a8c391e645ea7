//! The table of topics: names that ROS 2 takes, a README that tells the truth.

use abbe_msgs::topics::{self, Origin};
use abbe_msgs::{Action, Durability, Message, Qos, Reliability, Service, msg, std_srvs};

const README: &str = include_str!("../../README.md");

/// Rows of the README's table whose heading row begins with `first`, cell by cell.
fn rows(first: &str) -> Vec<Vec<String>> {
    README
        .lines()
        .skip_while(|line| !line.starts_with(&format!("| {first} |")))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            line.trim_matches('|')
                .split('|')
                .map(|cell| cell.trim().trim_matches('`').to_owned())
                .collect()
        })
        .collect()
}

#[test]
fn arch_readme_lists_every_topic_as_it_is() {
    let told: Vec<Vec<String>> = topics::all()
        .iter()
        .map(|entry| {
            let member = match (entry.is_family, entry.name) {
                (false, _) => "",
                (true, "temperature/") => "<sensor>",
                (true, _) => "<value>",
            };
            let reliability = match entry.qos.reliability {
                Reliability::Reliable => "reliable",
                Reliability::BestEffort => "best effort",
            };
            let durability = match entry.qos.durability {
                Durability::Volatile => "volatile",
                Durability::TransientLocal => "transient local",
            };
            let origin = match entry.origin {
                Origin::Raw => "raw",
                Origin::Computed => "computed",
                Origin::Housekeeping => "housekeeping",
            };
            vec![
                format!("{}{member}", entry.name),
                entry.description.type_name.to_owned(),
                format!("{reliability}, {durability}, {}", entry.qos.depth),
                origin.to_owned(),
            ]
        })
        .collect();
    assert_eq!(rows("topic"), told);
}

#[test]
fn arch_readme_lists_services_and_actions() {
    fn row(name: &str, type_name: &str) -> Vec<String> {
        vec![name.to_owned(), type_name.to_owned()]
    }
    let told = [
        row(
            topics::SET_COMPENSATION.name,
            std_srvs::srv::SetBool::TYPE_NAME,
        ),
        row(
            topics::PAUSE_PROGRAM.name,
            std_srvs::srv::Trigger::TYPE_NAME,
        ),
        row(
            topics::RESUME_PROGRAM.name,
            std_srvs::srv::Trigger::TYPE_NAME,
        ),
        row(topics::STEP_PROGRAM.name, std_srvs::srv::Trigger::TYPE_NAME),
        row(topics::HOME.name, std_srvs::srv::Trigger::TYPE_NAME),
        row(
            topics::PAUSE_PLAYING.name,
            std_srvs::srv::Trigger::TYPE_NAME,
        ),
        row(
            topics::RESUME_PLAYING.name,
            std_srvs::srv::Trigger::TYPE_NAME,
        ),
        row(topics::STEP_PLAYING.name, std_srvs::srv::Trigger::TYPE_NAME),
        row(
            topics::SAVE_RECORDING.name,
            std_srvs::srv::Trigger::TYPE_NAME,
        ),
        row(
            topics::RUN_PROGRAM.name,
            abbe_msgs::action::RunProgram::TYPE_NAME,
        ),
        row(
            topics::RUN_CYCLE.name,
            abbe_msgs::action::RunCycle::TYPE_NAME,
        ),
    ];
    assert_eq!(rows("service or action"), told);
}

#[test]
fn names_are_unique_and_taken_by_ros() {
    let mut names: Vec<_> = topics::all().iter().map(|entry| entry.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), topics::all().len());
    for name in names {
        let path = name.strip_prefix('/').unwrap_or(name);
        for token in path.trim_end_matches('/').split('/') {
            let starts_well = token.starts_with(|c: char| c.is_ascii_lowercase());
            let holds_only = token.chars().all(|c| c.is_ascii_lowercase() || c == '_');
            assert!(starts_well && holds_only && !token.contains("__"), "{name}");
        }
    }
}

/// A stall of 5 s at the servo rate loses nothing.
#[test]
fn topics_of_the_servo_rate_are_deep() {
    for entry in topics::all() {
        // The transport's reader holds 64 samples whatever smaller depth is asked for.
        assert!(entry.qos.depth > 0);
        if ["axes/state", "compensation", "grid/position"].contains(&entry.name) {
            assert!(entry.qos.depth >= 5 * 1000, "{}", entry.name);
            assert_eq!(entry.qos.reliability, Reliability::Reliable);
        }
    }
}

#[test]
fn a_sensor_has_its_own_topic() {
    let name = topics::TEMPERATURE.of("spindle_front").unwrap();
    assert_eq!(name, "temperature/spindle_front");
    assert_eq!(topics::TEMPERATURE.member_of(&name), Some("spindle_front"));
    let in_namespace = "/cell/temperature/bed";
    assert_eq!(topics::TEMPERATURE.member_of(in_namespace), Some("bed"));
    for other in [
        "temperature/",
        "atemperature/bed",
        "temperature/a/b",
        "axes/state",
    ] {
        assert_eq!(topics::TEMPERATURE.member_of(other), None, "{other}");
    }
}

#[test]
fn a_sensor_whose_name_is_none_is_refused() {
    for name in [
        "",
        "2nd",
        "spindle front",
        "a__b",
        "a/b",
        "spindle-front",
        "µ",
    ] {
        assert_eq!(
            topics::TEMPERATURE.of(name).unwrap_err().to_string(),
            format!(
                "topic \"temperature/{name}\": \"{name}\" must begin with a letter or underscore \
                 and hold only letters, digits and single underscores"
            )
        );
    }
}

#[test]
fn qos_is_told_as_rosbag2_tells_it() {
    assert_eq!(
        Qos::LATCHED.offered_qos_profiles(),
        "- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false
"
    );
}

#[test]
fn entries_describe_the_type_of_their_topic() {
    let entry = topics::all()
        .iter()
        .find(|entry| entry.name == topics::AXES_STATE.name)
        .unwrap();
    assert_eq!(entry.description, msg::AxisState::DESCRIPTION);
    assert_eq!(entry.qos, topics::AXES_STATE.qos);
}
