//! ROS shell of recorder: it listens to the network itself, for its topics are found while it runs.

use std::path::Path;

use abbe_msgs::std_srvs::srv::TriggerResponse;
use abbe_msgs::topics;
use anyhow::Result;
use metrology::stamp::Span;
use node_runtime::names::NodeNames;
use node_runtime::{Node, Setup, Wiring};
use recorder::NodeConfig;

mod begin;
mod capture;
mod ring;
mod time;
mod watch;

pub use begin::{check_clock, record};
use begin::{context, selection};
pub use capture::{Capture, Captured, unmatched};
use ring::RingCapture;
pub use time::Time;
use watch::{Input, Output, Watch, Work};

/// Time between two looks at the counts.
const TICK: Span = Span::from_nanos(500_000_000);

/// Builds the node; recording begins at once.
///
/// # Errors
/// When a parameter is wrong, the bag is there already or cannot be written, or there is no network.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: NodeConfig = setup.config()?;
    config.check_names()?;
    begin::check_selection(setup, &config)?;
    let machine = (!config.machine_file.is_empty()).then(|| setup.file_text("machine_file"));
    let machine = machine.transpose()?.map(|(_, text)| text);
    listen(setup, &config, machine)
}

/// The same for given parameters and the text of the machine file.
///
/// # Errors
/// As [`node`].
pub fn listen(
    setup: &Setup,
    config: &NodeConfig,
    machine: Option<String>,
) -> Result<Box<dyn Node>> {
    let parameters = setup.resolved(config)?;
    let tap = format!("{}_tap", setup.name());
    let time = Time::of(setup);
    let work = match config.ring {
        None => Work::Bag(record(config, machine, &tap, time)?),
        Some(own) => {
            let kept = (Path::new(&config.bag), context(machine));
            let (names, writing) = (NodeNames::new(&tap, &[])?, config.writing.clone());
            let picked = selection(config);
            let ring = RingCapture::start(&names, picked, &own, writing, kept, time)?;
            Work::Ring(Box::new(ring))
        }
    };
    let answer = |outcome: Result<&[Output], &str>| match outcome {
        Ok(outputs) => outputs.iter().find_map(Output::answer).unwrap_or_default(),
        Err(reason) => TriggerResponse {
            success: false,
            message: reason.to_owned(),
        },
    };
    Ok(Wiring::new(setup.name(), parameters, Watch::new(work))
        .every(TICK, || Input::Tick)
        .service(&topics::SAVE_RECORDING, |_| Input::Save, answer)
        .diagnose(Output::diagnostic)
        .shutdown(
            || Input::Shutdown,
            |output| matches!(output, Output::Stopped),
        )
        .node())
}
