//! A topic as a file holds it: name, type, definition and the quality of service that was offered.

use serde::{Deserialize, Serialize};

use crate::error::RecorderError;

/// A topic and all that a reader needs to decode it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Full name with its namespace, e.g. `/axes/state`.
    pub topic: String,
    /// `package/msg/Name`.
    pub type_name: String,
    /// RIHS01 hash of the type, or empty where unknown.
    pub type_hash: String,
    /// `ros2msg` text with every nested type, or empty where unknown.
    pub definition: String,
    /// QoS profiles offered by the publishers, a YAML list of [`QosProfile`], or empty.
    pub qos_yaml: String,
}

/// A channel of one recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ChannelId(pub(crate) usize);

impl ChannelId {
    /// Position among the channels, in the order in which they were added.
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

impl Channel {
    /// Checks names, hash and QoS.
    ///
    /// # Errors
    /// The part that is malformed, with the topic.
    pub fn checked(&self) -> Result<Vec<QosProfile>, RecorderError> {
        let topic = self.topic.clone();
        let well_named = topic.len() > 1
            && topic.starts_with('/')
            && !topic.ends_with('/')
            && !topic.contains("//")
            && !topic.contains(|c: char| c.is_whitespace() || c.is_control());
        if !well_named {
            return Err(RecorderError::TopicName { topic });
        }
        let parts: Vec<&str> = self.type_name.split('/').collect();
        let word = |part: &&str| {
            !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        if parts.len() != 3 || !parts.iter().all(word) {
            return Err(RecorderError::TypeName {
                topic,
                type_name: self.type_name.clone(),
            });
        }
        if !self.type_hash.is_empty() && !is_rihs01(&self.type_hash) {
            return Err(RecorderError::TypeHash {
                topic,
                type_hash: self.type_hash.clone(),
            });
        }
        qos_from_yaml(&self.qos_yaml).map_err(|source| RecorderError::Qos { topic, source })
    }
}

fn is_rihs01(hash: &str) -> bool {
    hash.strip_prefix("RIHS01_")
        .is_some_and(|digits| digits.len() == 64 && digits.bytes().all(|b| b.is_ascii_hexdigit()))
}

/// Reads a list of profiles; names as rosbag2 writes them since version 9, or its older numbers.
///
/// # Errors
/// The reader's reason.
pub fn qos_from_yaml(text: &str) -> Result<Vec<QosProfile>, Box<serde_saphyr::Error>> {
    if text.trim().is_empty() {
        return Ok(Vec::new());
    }
    serde_saphyr::from_str(text).map_err(Box::new)
}

/// Writes a list of profiles as rosbag2 does since version 9.
///
/// # Errors
/// The writer's reason.
pub fn qos_to_yaml(profiles: &[QosProfile]) -> Result<String, Box<serde_saphyr::SerializeError>> {
    if profiles.is_empty() {
        return Ok(String::new());
    }
    serde_saphyr::to_string(&profiles).map_err(Box::new)
}

/// What a publisher offers (`rmw_qos_profile_t`).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosProfile {
    /// How many samples are kept.
    pub history: History,
    /// Samples kept with [`History::KeepLast`].
    pub depth: u64,
    /// Whether lost samples are sent again.
    pub reliability: Reliability,
    /// Whether late joiners get earlier samples.
    pub durability: Durability,
    /// Longest time between two samples.
    pub deadline: QosTime,
    /// How long a sample is valid.
    pub lifespan: QosTime,
    /// How a publisher shows that it is alive.
    pub liveliness: Liveliness,
    /// How often it must show it.
    pub liveliness_lease_duration: QosTime,
    /// Topic name without the prefix of ROS.
    pub avoid_ros_namespace_conventions: bool,
}

impl QosProfile {
    /// Reliable or best effort, volatile or latched, keep last `depth`, everything else unlimited.
    #[must_use]
    pub fn keep_last(depth: u64, reliability: Reliability, durability: Durability) -> Self {
        Self {
            history: History::KeepLast,
            depth,
            reliability,
            durability,
            deadline: QosTime::INFINITE,
            lifespan: QosTime::INFINITE,
            liveliness: Liveliness::Automatic,
            liveliness_lease_duration: QosTime::INFINITE,
            avoid_ros_namespace_conventions: false,
        }
    }
}

/// `rmw_time_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosTime {
    /// Seconds.
    pub sec: u64,
    /// Nanoseconds.
    pub nsec: u64,
}

impl QosTime {
    /// `RMW_DURATION_INFINITE`.
    pub const INFINITE: Self = Self {
        sec: 9_223_372_036,
        nsec: 854_775_807,
    };
}

/// `rmw_qos_history_policy_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum History {
    /// The middleware's own.
    #[serde(alias = "0")]
    SystemDefault,
    /// The last `depth`.
    #[serde(alias = "1")]
    KeepLast,
    /// All.
    #[serde(alias = "2")]
    KeepAll,
    /// Not known.
    #[serde(alias = "3")]
    Unknown,
}

/// `rmw_qos_reliability_policy_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reliability {
    /// The middleware's own.
    #[serde(alias = "0")]
    SystemDefault,
    /// Sent again until it arrives.
    #[serde(alias = "1")]
    Reliable,
    /// Sent once.
    #[serde(alias = "2")]
    BestEffort,
    /// Not known.
    #[serde(alias = "3")]
    Unknown,
    /// Whatever the other side offers.
    #[serde(alias = "4")]
    BestAvailable,
}

/// `rmw_qos_durability_policy_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Durability {
    /// The middleware's own.
    #[serde(alias = "0")]
    SystemDefault,
    /// Late joiners get the last samples ("latched").
    #[serde(alias = "1")]
    TransientLocal,
    /// Late joiners get nothing of before.
    #[serde(alias = "2")]
    Volatile,
    /// Not known.
    #[serde(alias = "3")]
    Unknown,
    /// Whatever the other side offers.
    #[serde(alias = "4")]
    BestAvailable,
}

/// `rmw_qos_liveliness_policy_t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Liveliness {
    /// The middleware's own.
    #[serde(alias = "0")]
    SystemDefault,
    /// The middleware shows it.
    #[serde(alias = "1")]
    Automatic,
    /// Deprecated, still met in old bags.
    #[serde(alias = "2")]
    ManualByNode,
    /// The publisher shows it.
    #[serde(alias = "3")]
    ManualByTopic,
    /// Not known.
    #[serde(alias = "4")]
    Unknown,
    /// Whatever the other side offers.
    #[serde(alias = "5")]
    BestAvailable,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel() -> Channel {
        Channel {
            topic: "/axes/state".into(),
            type_name: "abbe_msgs/msg/AxisState".into(),
            type_hash: String::new(),
            definition: String::new(),
            qos_yaml: String::new(),
        }
    }

    #[test]
    fn profiles_survive_their_own_text() {
        let profiles = vec![
            QosProfile::keep_last(20_000, Reliability::Reliable, Durability::Volatile),
            QosProfile::keep_last(1, Reliability::BestEffort, Durability::TransientLocal),
        ];
        let text = qos_to_yaml(&profiles).unwrap();
        assert_eq!(qos_from_yaml(&text).unwrap(), profiles, "{text}");
    }

    #[test]
    fn numbers_of_older_bags_are_read() {
        let text = "- history: 1\n  depth: 5\n  reliability: 2\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false\n";
        let expected =
            QosProfile::keep_last(5, Reliability::BestEffort, Durability::TransientLocal);
        assert_eq!(qos_from_yaml(text).unwrap(), vec![expected]);
    }

    #[test]
    fn each_malformed_part_is_named() {
        type Spoil = fn(&mut Channel);
        let cases: [(Spoil, &str); 5] = [
            (|c| c.topic = "axes state".into(), "not a full topic name"),
            (|c| c.topic = "/a//b".into(), "not a full topic name"),
            (|c| c.type_name = "AxisState".into(), "package/msg/Name"),
            (|c| c.type_hash = "RIHS01_12".into(), "RIHS01_ and 64"),
            (|c| c.qos_yaml = "history: 1".into(), "offered QoS"),
        ];
        for (spoil, words) in cases {
            let mut spoiled = channel();
            spoil(&mut spoiled);
            let text = spoiled.checked().unwrap_err().to_string();
            assert!(text.contains(words), "{text}");
        }
        channel().checked().unwrap();
    }
}
