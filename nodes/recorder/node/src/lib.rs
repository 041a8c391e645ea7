//! ROS shell of recorder: it listens to the network itself, for its topics are found while it runs.

use std::path::Path;

use anyhow::{Context, Result};
use metrology::stamp::Span;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::Selection;
use node_runtime::{Node, Setup, Wiring};
use recorder::{Directory, NodeConfig, PARAMETERS, Recorder, Recording};

mod capture;
mod watch;

pub use capture::{Capture, Captured};
use watch::{Input, Output, Watch};

/// Time between two looks at the counts.
const TICK: Span = Span::from_nanos(500_000_000);

/// Builds the node; recording begins at once.
///
/// # Errors
/// When a parameter is wrong, the bag is there already or cannot be written, or there is no network.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: NodeConfig = setup.config()?;
    let parameters = setup.resolved(&config, PARAMETERS)?;
    let capture = record(&config, &format!("{}_tap", setup.name()))?;
    Ok(Wiring::new(setup.name(), parameters, Watch::new(capture))
        .every(TICK, || Input::Tick)
        .diagnose(|output| match output {
            Output::Condition(diagnostic) => Some(diagnostic.clone()),
            Output::Stopped => None,
        })
        .shutdown(
            || Input::Shutdown,
            |output| matches!(output, Output::Stopped),
        )
        .node())
}

/// Records the network into a new bag; `name` is the listener's own name on the graph.
///
/// # Errors
/// When the bag is there already or cannot be written, or there is no network.
pub fn record(config: &NodeConfig, name: &str) -> Result<Capture> {
    let path = Path::new(&config.bag);
    let file = path
        .file_name()
        .with_context(|| format!("bag = \"{}\": must be a folder's name", config.bag))?;
    let directory = Directory::create(path)?;
    let recording = Recording::begin(directory, &file.to_string_lossy(), config.writing.clone())?;
    let recorder = Recorder::start(recording, &config.writing)?;
    let selection = Selection::Matching(config.topics.clone());
    let names = NodeNames::new(name, &[])?;
    Capture::start(&Environment::read()?, &names, selection, recorder, |_| ())
}
