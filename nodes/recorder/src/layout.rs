//! The directory as rosbag2 lays it out: names, and the contents of `metadata.yaml`, version 9.
//!
//! Field by field as `rosbag2_storage/yaml.hpp` of ROS 2 Jazzy writes it. Compression inside the
//! chunks is MCAP's own matter, so `compression_format` and `compression_mode` stay empty.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::channel::QosProfile;

/// Version of `metadata.yaml` that is written.
pub(crate) const METADATA_VERSION: u32 = 9;
/// Name of the description beside the files.
pub(crate) const METADATA_FILE: &str = "metadata.yaml";
/// What rosbag2 writes as the start of a bag without messages.
pub(crate) const NO_STARTING_TIME_NANOS: u64 = i64::MAX as u64;

/// Name of the `index`-th file of recording `name`.
#[must_use]
pub fn split_file_name(name: &str, index: usize) -> String {
    format!("{name}_{index}.mcap")
}

/// `{ nanoseconds: n }`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Nanoseconds {
    /// The time, ns.
    pub nanoseconds: u64,
}

/// `{ nanoseconds_since_epoch: n }`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SinceEpoch {
    /// The instant, ns.
    pub nanoseconds_since_epoch: u64,
}

/// A topic's description.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicDescription {
    /// Topic.
    pub name: String,
    /// `package/msg/Name`.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Always `cdr`.
    pub serialization_format: String,
    /// QoS of its publishers.
    pub offered_qos_profiles: Vec<QosProfile>,
    /// RIHS01 hash or empty.
    pub type_description_hash: String,
}

/// A topic and its number of messages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TopicEntry {
    /// Its description.
    pub topic_metadata: TopicDescription,
    /// Messages in all files.
    pub message_count: u64,
}

/// One file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Name inside the directory.
    pub path: String,
    /// Earliest log time.
    pub starting_time: SinceEpoch,
    /// Latest less earliest log time.
    pub duration: Nanoseconds,
    /// Messages in it.
    pub message_count: u64,
}

/// `rosbag2_bagfile_information`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BagMetadata {
    /// 9.
    pub version: u32,
    /// `mcap`.
    pub storage_identifier: String,
    /// Latest less earliest log time.
    pub duration: Nanoseconds,
    /// Earliest log time.
    pub starting_time: SinceEpoch,
    /// Messages in all files.
    pub message_count: u64,
    /// Topics.
    pub topics_with_message_count: Vec<TopicEntry>,
    /// Empty: chunks are compressed inside the file.
    pub compression_format: String,
    /// Empty: chunks are compressed inside the file.
    pub compression_mode: String,
    /// Files in order.
    pub relative_file_paths: Vec<String>,
    /// The same files with times and counts.
    pub files: Vec<FileEntry>,
    /// Keys and values of the recording's owner; `~` when there are none.
    pub custom_data: Option<BTreeMap<String, String>>,
    /// `jazzy`, whose layout this is.
    pub ros_distro: String,
}

/// The root of `metadata.yaml`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct MetadataFile {
    pub rosbag2_bagfile_information: BagMetadata,
}

/// Earliest and latest log time, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct TimeSpan {
    bounds_nanos: Option<(u64, u64)>,
}

impl TimeSpan {
    pub(crate) fn include(&mut self, log_time_nanos: u64) {
        self.bounds_nanos = Some(match self.bounds_nanos {
            None => (log_time_nanos, log_time_nanos),
            Some((first, last)) => (first.min(log_time_nanos), last.max(log_time_nanos)),
        });
    }

    pub(crate) fn join(&mut self, other: Self) {
        if let Some((first, last)) = other.bounds_nanos {
            self.include(first);
            self.include(last);
        }
    }

    pub(crate) fn bounds_nanos(self) -> Option<(u64, u64)> {
        self.bounds_nanos
    }

    pub(crate) fn starting_time(self) -> SinceEpoch {
        SinceEpoch {
            nanoseconds_since_epoch: self.bounds_nanos.map_or(NO_STARTING_TIME_NANOS, |b| b.0),
        }
    }

    pub(crate) fn duration(self) -> Nanoseconds {
        Nanoseconds {
            nanoseconds: self.bounds_nanos.map_or(0, |(first, last)| last - first),
        }
    }
}

impl BagMetadata {
    pub(crate) fn new(files: Vec<FileEntry>, topics: Vec<TopicEntry>, span: TimeSpan) -> Self {
        Self {
            version: METADATA_VERSION,
            storage_identifier: "mcap".to_owned(),
            duration: span.duration(),
            starting_time: span.starting_time(),
            message_count: files.iter().map(|file| file.message_count).sum(),
            topics_with_message_count: topics,
            compression_format: String::new(),
            compression_mode: String::new(),
            relative_file_paths: files.iter().map(|file| file.path.clone()).collect(),
            files,
            custom_data: None,
            ros_distro: "jazzy".to_owned(),
        }
    }

    /// Text of `metadata.yaml`.
    ///
    /// # Errors
    /// The writer's reason.
    pub fn to_yaml(&self) -> Result<String, Box<serde_saphyr::SerializeError>> {
        let file = MetadataFile {
            rosbag2_bagfile_information: self.clone(),
        };
        serde_saphyr::to_string(&file).map_err(Box::new)
    }

    /// Text of what rosbag2 puts into the file itself, under the metadata name `rosbag2`.
    ///
    /// # Errors
    /// The writer's reason.
    pub fn to_inner_yaml(&self) -> Result<String, Box<serde_saphyr::SerializeError>> {
        serde_saphyr::to_string(self).map_err(Box::new)
    }

    /// Reads `metadata.yaml` of version 9.
    ///
    /// # Errors
    /// The reader's reason.
    pub fn from_yaml(text: &str) -> Result<Self, Box<serde_saphyr::Error>> {
        serde_saphyr::from_str::<MetadataFile>(text)
            .map(|file| file.rosbag2_bagfile_information)
            .map_err(Box::new)
    }
}

/// Only the names of the files, from `metadata.yaml` of any version.
pub(crate) fn file_names_of(text: &str) -> Option<Vec<String>> {
    #[derive(Deserialize)]
    struct Names {
        relative_file_paths: Vec<String>,
    }
    #[derive(Deserialize)]
    struct Root {
        rosbag2_bagfile_information: Names,
    }
    let root: Root = serde_saphyr::from_str(text).ok()?;
    let names = root.rosbag2_bagfile_information.relative_file_paths;
    // Old versions write the directory too; a name must not lead out of it.
    let last_part = |name: &String| name.rsplit('/').next().map(str::to_owned);
    Some(names.iter().filter_map(last_part).collect())
}

/// How rosbag2 has compressed what it wrote (`file`, `message`), by `metadata.yaml` of any version; none where MCAP's own
/// chunks are all the compression that there is.
pub(crate) fn compression_of(text: &str) -> Option<String> {
    #[derive(Deserialize)]
    struct Mode {
        #[serde(default)]
        compression_mode: String,
    }
    #[derive(Deserialize)]
    struct Root {
        rosbag2_bagfile_information: Mode,
    }
    let root: Root = serde_saphyr::from_str(text).ok()?;
    let mode = root.rosbag2_bagfile_information.compression_mode;
    let mode = mode.to_lowercase();
    (!mode.is_empty() && mode != "none").then_some(mode)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::{Durability, Reliability};

    #[test]
    fn metadata_survives_its_own_text() {
        let mut span = TimeSpan::default();
        span.include(5_000_000_007);
        span.include(1_000_000_000);
        let files = vec![FileEntry {
            path: split_file_name("run", 0),
            starting_time: span.starting_time(),
            duration: span.duration(),
            message_count: 2,
        }];
        let topics = vec![TopicEntry {
            topic_metadata: TopicDescription {
                name: "/latency".into(),
                type_name: "abbe_msgs/msg/ProbeLatency".into(),
                serialization_format: "cdr".into(),
                offered_qos_profiles: vec![QosProfile::keep_last(
                    1,
                    Reliability::Reliable,
                    Durability::TransientLocal,
                )],
                type_description_hash: String::new(),
            },
            message_count: 2,
        }];
        let metadata = BagMetadata::new(files, topics, span);
        let text = metadata.to_yaml().unwrap();
        assert_eq!(BagMetadata::from_yaml(&text).unwrap(), metadata, "{text}");
        assert_eq!(metadata.duration.nanoseconds, 4_000_000_007);
        assert_eq!(file_names_of(&text).unwrap(), ["run_0.mcap"]);
    }

    #[test]
    fn val_rosbag2_of_lyrical_describes_a_bag_in_the_same_terms() {
        let text = include_str!("../tests/data/lyrical_metadata.yaml");
        let metadata = BagMetadata::from_yaml(text).unwrap();
        assert_eq!(metadata.version, METADATA_VERSION);
        assert_eq!(metadata.ros_distro, "lyrical");
        assert_eq!(metadata.message_count, 1_164);
        let names = file_names_of(text).unwrap();
        assert_eq!(names, metadata.relative_file_paths);
        assert_eq!(names[0], "0_converted_2026_11_30-17_25_41.mcap");
        assert_eq!(compression_of(text), None);
        let point = &metadata.topics_with_message_count[0].topic_metadata;
        let depth = point.offered_qos_profiles[0].depth;
        assert_eq!((point.name.as_str(), depth), ("/probe/point", 200));
    }

    #[test]
    fn a_name_that_leads_out_of_the_directory_is_cut() {
        let text = "rosbag2_bagfile_information:\n  version: 4\n  relative_file_paths:\n  - ../../secret/run_0.mcap\n";
        assert_eq!(file_names_of(text).unwrap(), ["run_0.mcap"]);
    }

    #[test]
    fn an_empty_recording_starts_at_the_end_of_time_as_in_rosbag2() {
        let metadata = BagMetadata::new(Vec::new(), Vec::new(), TimeSpan::default());
        assert_eq!(
            metadata.starting_time.nanoseconds_since_epoch,
            9_223_372_036_854_775_807
        );
        assert_eq!(metadata.duration.nanoseconds, 0);
    }
}
