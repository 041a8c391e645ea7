//! ROS shell of the rotary-axis calibration.

use abbe_msgs::topics;
use anyhow::Result;
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Node, Setup, Wiring};
use rotary_axes::{Input, Output, RotaryAxesConfig, RotaryAxesStage};

mod conditions;

/// Time between two looks at a run that ends.
const TICK: Span = Span::from_nanos(100_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: RotaryAxesConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(RotaryAxesStage::new(&config, &machine))?;
    Ok(Wiring::new(setup.name(), parameters, stage)
        .saved()
        .on(&topics::PROBE_FEATURE, Input::Feature)
        .on(&topics::TEST_SEGMENT, Input::Segment)
        .on(&topics::GEOMETRY_MODEL, Input::Linear)
        .every(TICK, || Input::Tick)
        .publish(&topics::GEOMETRY_ROTARY, |output| match output {
            Output::Model(model) => Some(model),
            _ => None,
        })
        .diagnose(conditions::condition)
        .node())
}
