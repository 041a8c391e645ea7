//! ROS shell of the probe's corrections.

use abbe_msgs::topics;
use anyhow::Result;
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Node, Setup, Wiring};
use probe::{Input, Output, ProbeConfig, ProbeStage};

mod conditions;

/// Time between two looks at touches that wait for their positions.
const TICK: Span = Span::from_nanos(10_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: ProbeConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(ProbeStage::new(&config, &machine))?;
    Ok(Wiring::new(setup.name(), parameters, stage)
        .saved()
        .on(&topics::AXES_STATE, Input::State)
        .on(&topics::PROBE_TRIGGER, Input::Trigger)
        .on(&topics::LATENCY, Input::Latency)
        .on(&topics::TEST_SEGMENT, Input::Segment)
        .every(TICK, || Input::Tick)
        .publish(&topics::PROBE_POINT, |output| match output {
            Output::Point(point) => Some(point),
            _ => None,
        })
        .publish(&topics::BLOCKS_MEASUREMENT, |output| match output {
            Output::Block(block) => Some(block),
            _ => None,
        })
        .publish(&topics::PROBE_FEATURE, |output| match output {
            Output::Feature(feature) => Some(feature),
            _ => None,
        })
        .diagnose(conditions::condition)
        .node())
}
