//! ROS shell of the sequencer.

use std::collections::BTreeMap;

use abbe_msgs::topics;
use anyhow::Result;
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Node, Setup, Wiring};
use sequencer::{Config, Input, Sequencer};

mod files;
mod forms;

pub use files::{plan as read_plan, programs as read_programs};

/// Time between two looks at the plan.
const TICK: Span = Span::from_nanos(100_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter, the machine file, the plan or a program is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: Config = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = if config.plan_file.is_empty() {
        Sequencer::new(config, machine, None, BTreeMap::new())?
    } else {
        let (path, text) = setup.file_text("plan_file")?;
        let plan = files::plan(&text, &path)?;
        let programs = files::programs(&plan, &path)?;
        Sequencer::new(config, machine, Some(plan), programs)
            .map_err(|error| files::placed(&error, &text, &path))?
    };
    Ok(Wiring::new(setup.name(), parameters, stage)
        .on(&topics::PROBE_TRIGGER, Input::Touch)
        .on(&topics::THERMAL_UPDATE_REQUEST, Input::UpdateRequest)
        .every(TICK, || Input::Tick)
        .publish_in(
            &topics::TEST_SEGMENT,
            setup.frame(machine::frames::MACHINE),
            |message| &mut message.header.frame_id,
            forms::segment,
        )
        .publish(&topics::PLAN_STATUS, forms::status)
        .client(&topics::SET_COMPENSATION, forms::switch, forms::switched)
        .action_client(&topics::RUN_PROGRAM, forms::program, forms::program_news)
        .action_server(
            &topics::RUN_CYCLE,
            forms::cycle,
            Input::CancelCycle,
            forms::cycle_signal,
        )
        .diagnose(forms::condition)
        .node())
}
