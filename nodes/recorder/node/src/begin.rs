//! From parameters to a bag that is being written.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use node_runtime::Setup;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::Selection;
use recorder::{Directory, NodeConfig, Recorder, RecorderError, Recording, RunContext};

use crate::capture::Capture;
use crate::time::Time;

/// The topics that the parameters pick.
pub(crate) fn selection(config: &NodeConfig) -> Selection {
    Selection::Matching(config.topics.clone()).without(config.exclude.clone())
}

/// Refuses parameters that leave nothing to record.
pub(crate) fn check_selection(setup: &Setup, config: &NodeConfig) -> Result<()> {
    if Selection::leaves_nothing(&config.topics, &config.exclude) {
        let nothing = RecorderError::NothingToRecord {
            topics: config.topics.clone(),
            exclude: config.exclude.clone(),
        };
        bail!("{}", setup.placed(&nothing.to_string()));
    }
    if let Err(error) = check_clock(config, &Time::of(setup)) {
        bail!("{}", setup.placed(&error.to_string()));
    }
    Ok(())
}

/// Refuses simulated time without the topic that tells it.
///
/// # Errors
/// When no pattern takes it, or a ring is to hold the last minutes of a time that may rest.
pub fn check_clock(config: &NodeConfig, time: &Time) -> Result<()> {
    let Time::Simulated(clock) = time else {
        return Ok(());
    };
    if !selection(config).takes(clock) {
        bail!(
            "use_sim_time: {clock}, by which messages are stamped, is not among the topics that are recorded: add it to topics, or take it from exclude"
        );
    }
    if config.ring.is_some() {
        bail!(
            "use_sim_time: must be false with ring, which keeps and saves the last minutes of real time"
        );
    }
    Ok(())
}

/// What every bag holds beside messages.
pub(crate) fn context(machine_file: Option<String>) -> RunContext {
    RunContext {
        machine_file,
        ..RunContext::default()
    }
}

/// Most bags of one folder.
const MOST_BAGS: u32 = 10_000;

/// Makes the first folder `NAME_0`, `NAME_1`, … below `folder` that is not there yet, counted from `next`; bags of
/// earlier runs stay.
pub(crate) fn free_folder(
    folder: &Path,
    name: &str,
    next: &mut u32,
) -> Result<(PathBuf, Directory), RecorderError> {
    loop {
        let path = folder.join(format!("{name}_{next}"));
        match Directory::create(&path) {
            Ok(directory) => return Ok((path, directory)),
            Err(RecorderError::Exists { .. }) if *next < MOST_BAGS => *next += 1,
            Err(error) => return Err(error),
        }
    }
}

/// The last part of the parameter `bag`.
pub(crate) fn name_of(folder: &Path) -> Result<String> {
    let name = folder.file_name().with_context(|| {
        let shown = folder.display();
        format!("bag = \"{shown}\": must be a folder's name")
    })?;
    Ok(name.to_string_lossy().into_owned())
}

/// The folder of one bag.
fn begin(config: &NodeConfig) -> Result<(PathBuf, Directory)> {
    let folder = Path::new(&config.bag);
    let name = name_of(folder)?;
    if config.bag_per_start {
        return Ok(free_folder(folder, &name, &mut 0)?);
    }
    Ok((folder.to_owned(), Directory::create(folder)?))
}

/// Records the network into a new bag; `machine` is the text of the machine file, `name` the listener's own name on
/// the graph, and `time` stamps what comes.
///
/// # Errors
/// When the bag is there already or cannot be written, or there is no network.
pub fn record(
    config: &NodeConfig,
    machine: Option<String>,
    name: &str,
    time: Time,
) -> Result<Capture> {
    check_clock(config, &time)?;
    let (path, directory) = begin(config)?;
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let begin = || -> Result<_> {
        let mut recording = Recording::begin(directory, &file, config.writing.clone())?;
        if machine.is_some() {
            recording.add_context(&context(machine))?;
        }
        Ok(recording)
    };
    let recording = begin().inspect_err(|_| {
        // What was begun is no bag; the folder is new.
        let _ = std::fs::remove_dir_all(&path);
    })?;
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
