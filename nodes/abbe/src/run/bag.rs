//! The bag of a run: its context and its channels.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use metrology::stamp::{Host, Stamp};
use node_runtime::Node;
use node_runtime::node::TopicPort;
use node_runtime::parameter::{Parameter, Value};
use node_runtime::text_file::{self, Comments};
use recorder::{
    Channel, Directory, MessageOrder, RecordedRun, Recorder, RecorderConfig, RecorderError,
    Recording, RunContext, RunNode, WhenFull,
};

use crate::scenario::Scenario;

/// Simulated time passes quickly: a chunk may span this much of it.
const SIMULATED_FLUSH_S: f64 = 60.0;
const REAL_FLUSH_S: f64 = 1.0;

/// Begins the bag of `scenario` with everything that a replay needs; `composed`: the nodes of a run in simulated time,
/// in their order.
///
/// # Errors
/// When the folder exists or cannot be written, or the context holds what must not be in a bag.
pub fn begin(
    path: &Path,
    scenario: &Scenario,
    parameters: BTreeMap<String, String>,
    start_nanos: u64,
    composed: Option<Vec<RunNode>>,
) -> Result<Recorder> {
    let simulated = composed.is_some();
    let config = RecorderConfig {
        flush_period_s: if simulated {
            SIMULATED_FLUSH_S
        } else {
            REAL_FLUSH_S
        },
        when_full: if simulated {
            WhenFull::Wait
        } else {
            WhenFull::CountLoss
        },
        ..scenario.file.recording.config()
    };
    let name = path
        .file_name()
        .context("bag without a name")?
        .to_string_lossy()
        .into_owned();
    let directory = Directory::create(path)?;
    let begin = || -> Result<_> {
        let mut recording = Recording::begin(directory, &name, config.clone())?;
        recording.add_context(&RunContext {
            order: if simulated {
                MessageOrder::Total
            } else {
                MessageOrder::Arrival
            },
            nodes: composed.unwrap_or_default(),
            ..context(scenario, parameters, start_nanos)?
        })?;
        Ok(recording)
    };
    let recording = begin().inspect_err(|_| {
        // What was begun is no bag; the folder is new.
        let _ = std::fs::remove_dir_all(path);
    })?;
    Ok(Recorder::start(recording, &config)?)
}

/// Why a run failed, and what is wrong with its bag although every message is in it; `failure`: why its plan did not run
/// to its end.
pub fn ended(
    failure: Option<String>,
    of_bag: Option<RecorderError>,
) -> (Option<String>, Option<String>) {
    match of_bag {
        None => (failure, None),
        Some(error @ RecorderError::Undescribed { .. }) => (failure, Some(error.to_string())),
        Some(error) => {
            // The last count of what was lost is the right one.
            let own = failure.filter(|reason| !reason.starts_with(super::NOT_RECORDED));
            let told = format!("{}: {error}", super::NOT_RECORDED);
            let both = own.map_or_else(|| told.clone(), |own| format!("{own}; the bag: {error}"));
            (Some(both), None)
        }
    }
}

fn context(
    scenario: &Scenario,
    parameters: BTreeMap<String, String>,
    start_time_nanos: u64,
) -> Result<RunContext> {
    let mut programs = BTreeMap::new();
    for entry in std::fs::read_dir(&scenario.folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "ngc") {
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let text = text_file::read(&path, Comments::Gcode).context("program")?;
            programs.insert(name, text);
        }
    }
    let read = |name: &str| {
        let path = scenario.folder.join(name);
        path.exists().then(|| text_file::yaml(&path)).transpose()
    };
    Ok(RunContext {
        start_time_nanos,
        scenario_name: scenario.name.clone(),
        seed: None,
        commit: env!("ABBE_COMMIT").to_owned(),
        machine_file: read("machine.yaml")?,
        scenario_file: read("scenario.yaml")?,
        programs,
        parameters,
        ..RunContext::default()
    })
}

/// What is known at the end of a run: when its nodes were asked to stop.
pub fn end(asked_to_stop: Stamp<Host>) -> BTreeMap<String, String> {
    let nanos = asked_to_stop.nanos().to_string();
    BTreeMap::from([(RecordedRun::STOP_KEY.to_owned(), nanos)])
}

/// Resolved parameters of a node as YAML text.
///
/// # Errors
/// When they cannot be written as YAML.
pub fn parameters(node: &dyn Node) -> Result<String> {
    listed(node.name(), node.parameters())
}

/// Parameters of the node `name` as YAML text.
///
/// # Errors
/// When they cannot be written as YAML.
pub fn listed(name: &str, parameters: &[Parameter]) -> Result<String> {
    let flat: BTreeMap<&str, serde_json::Value> = parameters
        .iter()
        .map(|p| (p.name.as_str(), json(p)))
        .collect();
    serde_saphyr::to_string(&flat).with_context(|| format!("parameters of {name}"))
}

fn json(parameter: &Parameter) -> serde_json::Value {
    match &parameter.value {
        Value::Bool(value) => (*value).into(),
        Value::Integer(value) => (*value).into(),
        Value::Double(value) => (*value).into(),
        Value::String(value) => value.as_str().into(),
        Value::BoolArray(values) => values.clone().into(),
        Value::IntegerArray(values) => values.clone().into(),
        Value::DoubleArray(values) => values.clone().into(),
        Value::StringArray(values) => values.clone().into(),
    }
}

/// A topic as the bag holds it; `topic` is its resolved name.
pub fn channel(topic: String, port: &TopicPort) -> Channel {
    Channel {
        topic,
        type_name: port.type_name.to_owned(),
        type_hash: port.type_hash.to_owned(),
        definition: port.definition.to_owned(),
        qos_yaml: port.qos.offered_qos_profiles(),
    }
}

/// `name` as it stands on the graph without a namespace.
pub fn full_name(name: &str) -> String {
    if name.starts_with('/') {
        name.to_owned()
    } else {
        format!("/{name}")
    }
}
