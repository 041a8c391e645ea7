//! What a bag needs to replay alone: machine file, programs, scenario, parameters, seed, commit.
//!
//! Each text is an attachment; the metadata record `abbe.attachments` holds its sha256,
//! `abbe.run` the seed and the commit, `abbe.parameters.<node>` each resolved parameter by its
//! dotted name. There is no field for the plant's true state, and a YAML text that carries it
//! under a key `plant`, `truth` or `plant_truth` is refused.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::error::RecorderError;
use crate::read::{Attachment, Bag};

/// Name of the metadata record with seed and commit.
const RUN_RECORD: &str = "abbe.run";
/// Name of the metadata record with the hashes.
const HASHES_RECORD: &str = "abbe.attachments";
/// Name of the attachment that holds the machine file.
pub const MACHINE_FILE: &str = "machine.yaml";
/// Name of the metadata record with the nodes, in the order in which they were composed.
pub const NODES_RECORD: &str = "abbe.nodes";
/// Name of the metadata record of each service call.
pub const CALL_RECORD: &str = "abbe.call";
/// Name of the metadata record at the end of a run.
pub const END_RECORD: &str = "abbe.end";
/// Prefix of the metadata records with parameters.
const PARAMETERS_PREFIX: &str = "abbe.parameters.";
/// Keys under which a plant's true state would stand.
const TRUTH_KEYS: [&str; 3] = ["plant", "truth", "plant_truth"];

/// In which order the messages of a bag stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MessageOrder {
    /// As they reached the recorder.
    #[default]
    Arrival,
    /// As they happened: the one order in which a composed run delivered them.
    Total,
}

impl MessageOrder {
    /// Its name in the bag.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Arrival => "arrival",
            Self::Total => "total",
        }
    }
}

/// A node of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunNode {
    /// Its name on the graph.
    pub name: String,
    /// Which node it is.
    pub executable: String,
}

/// The context of one run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunContext {
    /// When the run began, on the clock of the log times, ns.
    pub start_time_nanos: u64,
    /// Name of the scenario, empty where there is none.
    pub scenario_name: String,
    /// Seed of every random stream.
    pub seed: Option<u64>,
    /// Commit of the software.
    pub commit: String,
    /// Text of `machine.yaml`.
    pub machine_file: Option<String>,
    /// Text of the scenario's file.
    pub scenario_file: Option<String>,
    /// Text of each G-code program by file name.
    pub programs: BTreeMap<String, String>,
    /// Resolved parameters of each node as YAML text, by node name.
    pub parameters: BTreeMap<String, String>,
    /// The nodes in the order in which they were composed.
    pub nodes: Vec<RunNode>,
    /// In which order the messages stand.
    pub order: MessageOrder,
}

/// One text on its way into the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attached {
    /// Name in the bag, e.g. `params/probe.yaml`.
    pub name: String,
    /// IANA media type.
    pub media_type: &'static str,
    /// Contents.
    pub text: String,
}

type MetadataRecords = Vec<(String, BTreeMap<String, String>)>;

impl RunContext {
    /// The texts, in a fixed order.
    ///
    /// # Errors
    /// A name with a path in it, two texts of one name, YAML that cannot be read, or the plant's
    /// truth.
    pub fn attachments(&self) -> Result<Vec<Attached>, RecorderError> {
        let mut attached = Vec::new();
        let yaml = |name: String, text: &String| Attached {
            name,
            media_type: "application/yaml",
            text: text.clone(),
        };
        attached.extend(
            self.machine_file
                .iter()
                .map(|t| yaml(MACHINE_FILE.into(), t)),
        );
        attached.extend(
            self.scenario_file
                .iter()
                .map(|t| yaml("scenario.yaml".into(), t)),
        );
        for (node, text) in &self.parameters {
            plain_name(node)?;
            attached.push(yaml(format!("params/{node}.yaml"), text));
        }
        for item in &attached {
            refuse_truth(item)?;
        }
        for (name, text) in &self.programs {
            plain_name(name)?;
            attached.push(Attached {
                name: name.clone(),
                media_type: "text/x-gcode",
                text: text.clone(),
            });
        }
        let mut names = BTreeSet::new();
        for item in &attached {
            if !names.insert(&item.name) {
                return Err(RecorderError::AttachedTwice {
                    name: item.name.clone(),
                });
            }
        }
        Ok(attached)
    }

    pub(crate) fn metadata_records(
        &self,
        attached: &[Attached],
    ) -> Result<MetadataRecords, RecorderError> {
        let mut run = BTreeMap::from([
            ("format".to_owned(), "1".to_owned()),
            (
                "start_time_ns".to_owned(),
                self.start_time_nanos.to_string(),
            ),
            ("scenario".to_owned(), self.scenario_name.clone()),
            ("commit".to_owned(), self.commit.clone()),
            ("order".to_owned(), self.order.name().to_owned()),
        ]);
        if let Some(seed) = self.seed {
            run.insert("seed".to_owned(), seed.to_string());
        }
        let hashes = attached
            .iter()
            .map(|item| (item.name.clone(), sha256_hex(item.text.as_bytes())))
            .collect();
        let mut records = vec![
            (RUN_RECORD.to_owned(), run),
            (HASHES_RECORD.to_owned(), hashes),
        ];
        if !self.nodes.is_empty() {
            let told = |(place, node): (usize, &RunNode)| {
                let value = format!("{} {}", node.name, node.executable);
                (format!("{place:03}"), value)
            };
            let nodes = self.nodes.iter().enumerate().map(told).collect();
            records.push((NODES_RECORD.to_owned(), nodes));
        }
        for (node, text) in &self.parameters {
            let tree = yaml_tree(&format!("params/{node}.yaml"), text)?;
            let mut flat = BTreeMap::new();
            flatten("", &tree, &mut flat);
            records.push((format!("{PARAMETERS_PREFIX}{node}"), flat));
        }
        Ok(records)
    }
}

/// A service call of a composed run. Readers in other languages know no types of services, so calls are metadata.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedCall {
    /// Messages of the bag before it.
    pub after_messages: u64,
    /// When, ns.
    pub time_nanos: u64,
    /// The topic of the service's events.
    pub topic: String,
    /// The serialised event.
    pub event: Vec<u8>,
}

impl RecordedCall {
    /// The metadata record.
    #[must_use]
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let event: String = self
            .event
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        [
            ("after_messages", self.after_messages.to_string()),
            ("time_ns", self.time_nanos.to_string()),
            ("topic", self.topic.clone()),
            ("event", event),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into()
    }

    /// The calls that a bag tells of, in their order.
    #[must_use]
    pub fn all_of(bag: &Bag) -> Vec<Self> {
        let records = bag.metadata_records();
        let calls = records.filter(|(name, _)| *name == CALL_RECORD);
        calls.filter_map(|(_, record)| Self::read(record)).collect()
    }

    fn read(record: &BTreeMap<String, String>) -> Option<Self> {
        let event = record.get("event")?.as_bytes().chunks(2);
        let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
        Some(Self {
            after_messages: record.get("after_messages")?.parse().ok()?,
            time_nanos: record.get("time_ns")?.parse().ok()?,
            topic: record.get("topic")?.clone(),
            event: event.map(byte).collect::<Option<_>>()?,
        })
    }
}

/// What a bag tells of the run that it was recorded from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordedRun {
    /// When the run began, on the clock of the log times, ns.
    pub start_time_nanos: u64,
    /// Name of the scenario, empty where there was none.
    pub scenario_name: String,
    /// Commit of the software.
    pub commit: String,
    /// In which order the messages stand.
    pub order: MessageOrder,
    /// The nodes in the order in which they were composed.
    pub nodes: Vec<RunNode>,
    /// When the nodes were asked to stop, ns; `None`: the bag does not know.
    pub stop_time_nanos: Option<u64>,
}

impl RecordedRun {
    /// Key of the time at which nodes were asked to stop, in [`END_RECORD`].
    pub const STOP_KEY: &'static str = "stop_time_ns";

    /// Reads it out of a bag; `None` where the bag has no such record.
    #[must_use]
    pub fn of(bag: &Bag) -> Option<Self> {
        let run = bag.metadata(RUN_RECORD)?;
        let text = |key: &str| run.get(key).cloned().unwrap_or_default();
        let node = |told: &String| {
            let (name, executable) = told.split_once(' ')?;
            Some(RunNode {
                name: name.to_owned(),
                executable: executable.to_owned(),
            })
        };
        let nodes = bag.metadata(NODES_RECORD);
        let end = bag.metadata(END_RECORD);
        Some(Self {
            start_time_nanos: text("start_time_ns").parse().ok()?,
            scenario_name: text("scenario"),
            commit: text("commit"),
            order: match text("order").as_str() {
                "total" => MessageOrder::Total,
                _ => MessageOrder::Arrival,
            },
            nodes: nodes.map_or_else(Vec::new, |told| told.values().filter_map(node).collect()),
            stop_time_nanos: end.and_then(|end| end.get(Self::STOP_KEY)?.parse().ok()),
        })
    }
}

/// Compares every attachment that the bag lists with the hash recorded beside it; returns their
/// names.
///
/// # Errors
/// An attachment is absent, damaged or different.
pub fn verify_attachments(bag: &Bag) -> Result<Vec<String>, RecorderError> {
    let mut names = Vec::new();
    let Some(hashes) = bag.metadata(HASHES_RECORD) else {
        return Ok(names);
    };
    for name in hashes.keys() {
        bag.attachment(name)?;
        names.push(name.clone());
    }
    Ok(names)
}

/// Compares an attachment, where the bag has it, with the hash recorded beside it, where there is one.
///
/// # Errors
/// It is absent or different.
pub(crate) fn verify(
    bag: &Bag,
    name: &str,
    found: Option<&Attachment>,
) -> Result<(), RecorderError> {
    let hashes = bag.metadata(HASHES_RECORD);
    let Some(recorded) = hashes.and_then(|hashes| hashes.get(name)) else {
        return Ok(());
    };
    let Some(found) = found else {
        return Err(RecorderError::AttachmentAbsent {
            name: name.to_owned(),
            recorded: recorded.clone(),
        });
    };
    let found = sha256_hex(&found.data);
    if found == *recorded {
        return Ok(());
    }
    Err(RecorderError::AttachmentHash {
        name: name.to_owned(),
        found,
        recorded: recorded.clone(),
    })
}

fn plain_name(name: &str) -> Result<(), RecorderError> {
    let plain = !name.is_empty()
        && !name.starts_with('.')
        && !name.contains(|c: char| c == '/' || c == '\\' || c.is_control());
    if plain {
        return Ok(());
    }
    Err(RecorderError::AttachmentName {
        name: name.to_owned(),
    })
}

fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect()
}

fn yaml_tree(attachment: &str, text: &str) -> Result<Value, RecorderError> {
    serde_saphyr::from_str(text).map_err(|source| RecorderError::Yaml {
        attachment: attachment.to_owned(),
        source: Box::new(source),
    })
}

fn refuse_truth(item: &Attached) -> Result<(), RecorderError> {
    let tree = yaml_tree(&item.name, &item.text)?;
    match truth_key(&tree) {
        None => Ok(()),
        Some(key) => Err(RecorderError::PlantTruth {
            attachment: item.name.clone(),
            key,
        }),
    }
}

/// A key that holds a structure of the plant's; a plain value (the name of its file) is none.
fn truth_key(tree: &Value) -> Option<String> {
    match tree {
        Value::Object(map) => map.iter().find_map(|(key, value)| {
            let holds =
                TRUTH_KEYS.contains(&key.as_str()) && (value.is_object() || value.is_array());
            if holds {
                Some(key.clone())
            } else {
                truth_key(value)
            }
        }),
        Value::Array(items) => items.iter().find_map(truth_key),
        _ => None,
    }
}

fn flatten(prefix: &str, tree: &Value, flat: &mut BTreeMap<String, String>) {
    let join = |key: &str| match prefix {
        "" => key.to_owned(),
        _ => format!("{prefix}.{key}"),
    };
    match tree {
        Value::Object(map) => map
            .iter()
            .for_each(|(key, value)| flatten(&join(key), value, flat)),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .for_each(|(index, value)| flatten(&join(&index.to_string()), value, flat)),
        Value::String(text) => {
            flat.insert(prefix.to_owned(), text.clone());
        }
        other => {
            flat.insert(prefix.to_owned(), other.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plants_truth_is_refused_wherever_it_stands() {
        let truths = [
            "plant:\n  latency_ms: 1.7\n",
            "scenario:\n  nodes:\n    - fake_cnc: {truth: {backlash_um: 4.0}}\n",
            "plant_truth: [1.0, 2.0]\n",
        ];
        for text in truths {
            for field in ["machine", "scenario", "parameters"] {
                let mut context = RunContext::default();
                match field {
                    "machine" => context.machine_file = Some(text.into()),
                    "scenario" => context.scenario_file = Some(text.into()),
                    _ => drop(context.parameters.insert("fake_cnc".into(), text.into())),
                }
                let refused = context.attachments();
                assert!(
                    matches!(refused, Err(RecorderError::PlantTruth { .. })),
                    "{field}: {text}"
                );
            }
        }
    }

    #[test]
    fn the_name_of_the_plants_file_is_no_truth() {
        let mut context = RunContext::default();
        let text = "/**:\n  ros__parameters:\n    plant: plant.yaml\n    seed: 7\n";
        context.parameters.insert("fake_cnc".into(), text.into());
        let attached = context.attachments().unwrap();
        assert_eq!(attached[0].name, "params/fake_cnc.yaml");
        let records = context.metadata_records(&attached).unwrap();
        let (name, flat) = &records[2];
        assert_eq!(name, "abbe.parameters.fake_cnc");
        assert_eq!(flat["/**.ros__parameters.seed"], "7");
    }

    #[test]
    fn names_that_lead_elsewhere_and_names_used_twice_are_refused() {
        let mut context = RunContext::default();
        context.programs.insert("../x.ngc".into(), "M2\n".into());
        let refused = context.attachments().unwrap_err().to_string();
        assert!(refused.contains("../x.ngc"), "{refused}");
        let mut context = RunContext {
            machine_file: Some("name: m\n".into()),
            ..RunContext::default()
        };
        context
            .programs
            .insert("machine.yaml".into(), "M2\n".into());
        let refused = context.attachments().unwrap_err().to_string();
        assert_eq!(refused, "machine.yaml is attached twice");
    }
}
