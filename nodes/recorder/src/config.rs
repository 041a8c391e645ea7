//! Parameters of the recorder.

use metrology::parameter::check_parameters_below;
use metrology::{check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::RecorderError;

/// Compression of the chunks inside a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChunkCompression {
    /// Fastest to write, largest.
    None,
    /// Between the two.
    Lz4,
    /// Smallest.
    #[default]
    Zstd,
}

impl ChunkCompression {
    pub(crate) fn of_mcap(self) -> Option<mcap::Compression> {
        match self {
            Self::None => None,
            Self::Lz4 => Some(mcap::Compression::Lz4),
            Self::Zstd => Some(mcap::Compression::Zstd),
        }
    }

    /// Fastest zstd, as rosbag2's preset `zstd_fast`; 0 is the default of LZ4, its fastest.
    pub(crate) fn level(self) -> u32 {
        match self {
            Self::None | Self::Lz4 => 0,
            Self::Zstd => 1,
        }
    }
}

/// What a full queue does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhenFull {
    /// The sender waits: a composed run in simulated time loses nothing.
    Wait,
    /// The message is lost, and counted: a live machine does not wait.
    #[default]
    CountLoss,
}

/// Parameters of the recorder; every one is operational and has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecorderConfig {
    /// Inside the chunks: none, lz4 or zstd (level 1).
    pub compression: ChunkCompression,
    /// A chunk is written when its records reach this size, before compression.
    #[schemars(range(min = SMALLEST_BYTES, max = LARGEST_WRITTEN_CHUNK_BYTES))]
    pub chunk_size_bytes: u64,
    /// A chunk is written when its messages span this much log time, or when nothing came for so long.
    #[schemars(range(min = SHORTEST_PERIOD_S, max = LONGEST_PERIOD_S))]
    pub flush_period_s: f64,
    /// metadata.yaml is refreshed when this much log time has passed.
    #[schemars(range(min = SHORTEST_PERIOD_S, max = LONGEST_PERIOD_S))]
    pub metadata_period_s: f64,
    /// A new file is begun at this size; 0: one file.
    #[schemars(range(min = 0.0, max = 9e18))]
    pub max_file_bytes: u64,
    /// A new file is begun when this one spans so much log time; 0: one file.
    #[schemars(range(min = 0.0, max = LONGEST_SPAN_S))]
    pub max_file_s: f64,
    /// Most bytes that wait for the disk.
    #[schemars(range(min = SMALLEST_BYTES, max = 9e18))]
    pub queue_limit_bytes: u64,
    /// At the limit: count_loss (a live machine does not wait) or wait.
    pub when_full: WhenFull,
}

impl Default for RecorderConfig {
    fn default() -> Self {
        Self {
            compression: ChunkCompression::Zstd,
            chunk_size_bytes: 1 << 20,
            flush_period_s: 1.0,
            metadata_period_s: 10.0,
            max_file_bytes: 0,
            max_file_s: 0.0,
            queue_limit_bytes: 256 << 20,
            when_full: WhenFull::CountLoss,
        }
    }
}

impl RecorderConfig {
    /// Of a bag that nobody reads before it is finished, as one made of a table: chunks by size alone, and hardly a
    /// description before the last. The default writes both by log time, which a log of a week has plenty of.
    #[must_use]
    pub fn read_when_finished() -> Self {
        Self {
            flush_period_s: LONGEST_PERIOD_S,
            metadata_period_s: LONGEST_PERIOD_S,
            ..Self::default()
        }
    }
}

/// Parameters of the recorder as a node of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeConfig {
    /// Folder of the bag, which must not exist, or with ring or bag_per_start of the bags, relative to where the
    /// program was started.
    pub bag: String,
    /// Each start makes a bag of its own below the folder bag, numbered, and leaves those of earlier starts alone;
    /// with ring they always are.
    #[serde(default)]
    pub bag_per_start: bool,
    /// Absolute names of topics to record; * stands for any run of characters.
    #[serde(default = "every_topic")]
    pub topics: Vec<String>,
    /// Topics of these names are left out, whatever topics says.
    #[serde(default)]
    pub exclude: Vec<String>,
    /// Machine file that goes into every bag, relative to the parameter file.
    #[serde(default)]
    pub machine_file: String,
    /// Keep the last minutes in memory, and write them when asked; absent: write everything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ring: Option<RingConfig>,
    /// How the bag is written.
    #[serde(default)]
    pub writing: RecorderConfig,
}

impl NodeConfig {
    /// Refuses an empty list of topics, and a name in `topics` or `exclude` that is no topic's: such names are absolute.
    ///
    /// # Errors
    /// The parameter and the name.
    pub fn check_names(&self) -> Result<(), RecorderError> {
        if self.topics.is_empty() {
            return Err(RecorderError::NoTopics);
        }
        for (key, names) in [("topics", &self.topics), ("exclude", &self.exclude)] {
            let relative = names.iter().position(|name| !name.starts_with(['/', '*']));
            if let Some(index) = relative {
                return Err(RecorderError::RelativeName {
                    key,
                    index,
                    name: names[index].clone(),
                });
            }
        }
        Ok(())
    }
}

/// What is kept in memory, and when it is saved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RingConfig {
    /// Keep so much in memory, and write it when asked; without ring everything is written.
    #[schemars(range(min = SHORTEST_RING_S, max = LONGEST_SPAN_S))]
    pub window_s: f64,
    /// Most bytes that are kept; where they do not last for the window, it is shorter, and that is said.
    #[serde(default = "ring_limit_bytes")]
    #[schemars(range(min = SMALLEST_BYTES, max = LARGEST_RING_BYTES))]
    pub limit_bytes: u64,
    /// Whether an error that begins on /diagnostics saves what is kept.
    #[serde(default)]
    pub save_on_error: bool,
}

fn ring_limit_bytes() -> u64 {
    256 << 20
}

impl RingConfig {
    /// Checks every value once.
    ///
    /// # Errors
    /// A value out of its range, with the range.
    pub fn checked(&self) -> Result<(), RecorderError> {
        Ok(check_parameters_below("ring.", self)?)
    }

    pub(crate) fn window_nanos(&self) -> i64 {
        // Checked above: between 0 and a week.
        (self.window_s * 1e9).round() as i64
    }
}

fn every_topic() -> Vec<String> {
    vec!["*".to_owned()]
}

/// Smallest chunk and queue that make sense: one record of a kilobyte must fit.
const SMALLEST_BYTES: f64 = 1024.0;
/// Largest chunk: a reader holds a whole chunk in memory.
const LARGEST_WRITTEN_CHUNK_BYTES: f64 = 64.0 * 1_048_576.0;
/// Shortest period, s: log times are whole nanoseconds.
const SHORTEST_PERIOD_S: f64 = 1e-9;
/// Shortest ring, s.
const SHORTEST_RING_S: f64 = 1e-3;
/// Longest period, s: an hour of loss is no longer a recording.
const LONGEST_PERIOD_S: f64 = 3600.0;
/// Longest file and ring, s: a week.
const LONGEST_SPAN_S: f64 = 604_800.0;
/// Largest ring: 64 GiB.
const LARGEST_RING_BYTES: f64 = 64.0 * 1_073_741_824.0;

impl RecorderConfig {
    /// Checks every value once.
    ///
    /// # Errors
    /// A value out of its range, with the range.
    pub fn checked(&self) -> Result<(), RecorderError> {
        check_parameters(self)?;
        if self.max_file_s > 0.0 {
            let of_file_s = (SHORTEST_PERIOD_S, LONGEST_SPAN_S);
            check_between("max_file_s", self.max_file_s, of_file_s)?;
        }
        Ok(())
    }

    /// Longest log time of a file; `None`: any.
    pub(crate) fn max_file_nanos(&self) -> Option<u64> {
        (self.max_file_s > 0.0).then(|| nanos_of(self.max_file_s))
    }

    pub(crate) fn flush_period_nanos(&self) -> u64 {
        nanos_of(self.flush_period_s)
    }

    pub(crate) fn metadata_period_nanos(&self) -> u64 {
        nanos_of(self.metadata_period_s)
    }
}

fn nanos_of(period_s: f64) -> u64 {
    // Checked above: between 0 and a week, so neither sign nor size is lost.
    (period_s * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_pass_their_own_check() {
        RecorderConfig::default().checked().unwrap();
    }

    #[test]
    fn a_relative_name_of_a_topic_is_refused_with_its_place() {
        let config = |topics: &str, exclude: &str| NodeConfig {
            bag: "bag".to_owned(),
            bag_per_start: false,
            topics: vec!["/a".to_owned(), topics.to_owned()],
            exclude: vec![exclude.to_owned()],
            machine_file: String::new(),
            ring: None,
            writing: RecorderConfig::default(),
        };
        config("*b", "/c*").check_names().unwrap();
        let words = config("b", "/c").check_names().unwrap_err().to_string();
        assert!(
            words.starts_with("topics[1] = \"b\": names of topics are absolute"),
            "{words}"
        );
        let words = config("*", "c").check_names().unwrap_err().to_string();
        assert!(words.starts_with("exclude[0] = \"c\""), "{words}");
        let mut none = config("*", "/c");
        none.topics.clear();
        let words = none.check_names().unwrap_err().to_string();
        assert!(words.starts_with("topics = []: "), "{words}");
    }

    #[test]
    fn a_period_that_is_not_a_time_is_refused_by_name() {
        for value_s in [0.0, -1.0, f64::NAN, f64::INFINITY, 3601.0] {
            let config = RecorderConfig {
                flush_period_s: value_s,
                ..RecorderConfig::default()
            };
            let text = config.checked().unwrap_err().to_string();
            assert!(text.starts_with("flush_period_s"), "{text}");
        }
    }

    #[test]
    fn a_chunk_larger_than_a_reader_holds_is_refused() {
        let config = RecorderConfig {
            chunk_size_bytes: (64 << 20) + 1,
            ..RecorderConfig::default()
        };
        let text = config.checked().unwrap_err().to_string();
        assert_eq!(
            text,
            "chunk_size_bytes = 67108865 bytes: must be from 1024 to 67108864 bytes"
        );
    }

    #[test]
    fn an_unknown_key_is_refused_by_name() {
        let text = serde_saphyr::from_str::<RecorderConfig>("chunk_size: 4096\n")
            .unwrap_err()
            .to_string();
        assert!(text.contains("chunk_size"), "{text}");
    }
}
