//! From parameters to a bag that is being written.

use std::path::Path;

use anyhow::{Context, Result};
use node_runtime::HostTime;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::Selection;
use recorder::{Directory, NodeConfig, Recorder, Recording, RunContext};

use crate::capture::Capture;

/// The topics that the parameters pick.
pub(crate) fn selection(config: &NodeConfig) -> Selection {
    Selection::Matching(config.topics.clone()).without(config.exclude.clone())
}

/// What every bag holds beside messages.
pub(crate) fn context(machine_file: Option<String>) -> RunContext {
    RunContext {
        machine_file,
        ..RunContext::default()
    }
}

/// Records the network into a new bag; `machine` is the text of the machine file, `name` the listener's own name on
/// the graph.
///
/// # Errors
/// When the bag is there already or cannot be written, or there is no network.
pub fn record(config: &NodeConfig, machine: Option<String>, name: &str) -> Result<Capture> {
    record_by(config, machine, name, HostTime::default())
}

/// The same, with receive stamps by the clock `time`.
pub(crate) fn record_by(
    config: &NodeConfig,
    machine: Option<String>,
    name: &str,
    time: HostTime,
) -> Result<Capture> {
    let path = Path::new(&config.bag);
    let file = path
        .file_name()
        .with_context(|| format!("bag = \"{}\": must be a folder's name", config.bag))?;
    let directory = Directory::create(path)?;
    let mut recording =
        Recording::begin(directory, &file.to_string_lossy(), config.writing.clone())?;
    if machine.is_some() {
        recording.add_context(&context(machine))?;
    }
    let recorder = Recorder::start(recording, &config.writing)?;
    let names = NodeNames::new(name, &[])?;
    Capture::start(
        &Environment::read()?,
        &names,
        selection(config),
        recorder,
        time,
        |_| (),
    )
}
