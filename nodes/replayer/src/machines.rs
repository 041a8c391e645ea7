//! Whether a bag has messages of one machine alone.
//!
//! A machine's topics stand in its namespace (`/mill_3/axes/state`). Instruments may have another one, as long as no
//! topic of ours is in two: then nobody knows which messages belong together.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use recorder::TopicInfo;

use crate::known::{entry_in_any_namespace, namespace};

/// Topics of every machine, which each host of a cell has.
const OF_HOSTS: &str = "host_clock/";

/// A topic of ours that a bag has in several namespaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeveralMachines {
    /// The topic without namespace.
    pub topic: String,
    /// Its namespaces; the root is `/`.
    pub namespaces: Vec<String>,
}

impl fmt::Display for SeveralMachines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, namespaces } = self;
        let first = namespaces.iter().find(|name| *name != "/");
        let first = first.map_or("/mill_1", String::as_str);
        write!(
            f,
            "holds {topic} in the namespaces {}: the messages are of several machines, and their figures would be mixed: give each \
             machine a bag of its own, by `abbe record -o BAG '{first}/*'`, or by `ros2 bag convert` with its topics",
            namespaces.join(", ")
        )
    }
}

impl std::error::Error for SeveralMachines {}

/// The namespaces of topics of ours that have messages, each once by name, without the root; instruments may have their own.
#[must_use]
pub fn namespaces(topics: &[TopicInfo]) -> Vec<&str> {
    let all = topics.iter().filter_map(|info| Some(ours(info)?.0));
    let all: BTreeSet<&str> = all.filter(|name| !name.is_empty()).collect();
    all.into_iter().collect()
}

/// Namespace and name of a topic of ours that has messages; `None`: it is not ours.
fn ours(info: &TopicInfo) -> Option<(&str, &str)> {
    let entry = entry_in_any_namespace(&info.topic)?;
    // A robot beside the machine has joint states and temperatures too.
    let is_ours = info.message_count > 0
        && entry.description.type_name.starts_with("abbe_msgs/")
        && info.type_name == entry.description.type_name
        && !entry.name.starts_with(OF_HOSTS);
    let before = namespace(&info.topic, entry).filter(|_| is_ours)?;
    Some((before, info.topic[before.len()..].trim_start_matches('/')))
}

/// Refuses topics of which one of ours has messages in several namespaces.
///
/// # Errors
/// With the first such topic and its namespaces.
pub fn check(topics: &[TopicInfo]) -> Result<(), SeveralMachines> {
    let mut known: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (before, rest) in topics.iter().filter_map(ours) {
        known.entry(rest).or_default().push(before);
    }
    let Some((topic, namespaces)) = known.into_iter().find(|(_, all)| all.len() > 1) else {
        return Ok(());
    };
    let named = |name: &str| match name {
        "" => "/".to_owned(),
        other => other.to_owned(),
    };
    Err(SeveralMachines {
        topic: topic.to_owned(),
        namespaces: namespaces.into_iter().map(named).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn infos(topics: &[(&str, &str, u64)]) -> Vec<TopicInfo> {
        let info = |(topic, name, n): &(&str, &str, u64)| TopicInfo {
            topic: (*topic).to_owned(),
            type_name: (*name).to_owned(),
            message_count: *n,
            type_hash: String::new(),
            definition_encoding: String::new(),
            definition: String::new(),
            message_encoding: "cdr".to_owned(),
            qos_yaml: String::new(),
        };
        topics.iter().map(info).collect()
    }

    /// Topics with their types and numbers of messages.
    fn checked(topics: &[(&str, &str, u64)]) -> Result<(), SeveralMachines> {
        check(&infos(topics))
    }

    #[test]
    fn the_namespaces_of_our_topics_are_listed_without_the_root() {
        for (topics, wanted) in [
            (vec![("/axes/state", STATE, 9)], vec![]),
            (vec![("/mill_3/axes/state", STATE, 9)], vec!["/mill_3"]),
            (
                vec![("/m/axes/state", STATE, 9), ("/k/grid/position", GRID, 1)],
                vec!["/k", "/m"],
            ),
            (vec![("/mill_3/axes/state", STATE, 0)], vec![]),
            (vec![("/robot/axes/state", "other/msg/State", 9)], vec![]),
        ] {
            assert_eq!(namespaces(&infos(&topics)), wanted, "{topics:?}");
        }
    }

    const STATE: &str = "abbe_msgs/msg/AxisState";
    const GRID: &str = "abbe_msgs/msg/GridSample";

    #[test]
    fn a_topic_in_two_namespaces_is_refused_with_both() {
        for (topics, words) in [
            (
                [
                    ("/mill_3/axes/state", STATE, 9),
                    ("/mill_4/axes/state", STATE, 1),
                ],
                "holds axes/state in the namespaces /mill_3, /mill_4",
            ),
            (
                [("/axes/state", STATE, 9), ("/mill_4/axes/state", STATE, 1)],
                "in the namespaces /, /mill_4",
            ),
            (
                [
                    ("/hall/a/grid/position", GRID, 9),
                    ("/hall/b/grid/position", GRID, 1),
                ],
                "holds grid/position in the namespaces /hall/a, /hall/b",
            ),
        ] {
            let refused = checked(&topics).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
            assert!(refused.contains("abbe record -o BAG '/"), "{refused}");
        }
    }

    #[test]
    fn one_machine_with_instruments_hosts_and_robots_beside_it_is_taken() {
        for topics in [
            vec![
                ("/mill_3/axes/state", STATE, 9),
                ("/laser/grid/position", GRID, 9),
            ],
            vec![
                ("/mill_3/axes/state", STATE, 9),
                ("/mill_4/axes/state", STATE, 0),
            ],
            vec![
                ("/mill_3/axes/state", STATE, 9),
                ("/robot/axes/state", "robot/msg/State", 9),
            ],
            vec![
                ("/joint_states", "sensor_msgs/msg/JointState", 9),
                ("/robot/joint_states", "sensor_msgs/msg/JointState", 9),
            ],
            vec![
                ("/host_a/host_clock/answer", "abbe_msgs/msg/ClockAnswer", 9),
                ("/host_b/host_clock/answer", "abbe_msgs/msg/ClockAnswer", 9),
            ],
            vec![],
        ] {
            assert_eq!(checked(&topics), Ok(()), "{topics:?}");
        }
    }
}
