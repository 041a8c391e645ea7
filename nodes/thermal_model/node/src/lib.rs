//! ROS shell of the thermal model.

use abbe_msgs::topics;
use anyhow::Result;
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Node, Setup, Wiring};
use thermal_model::{Input, Output, ThermalModelConfig, ThermalModelStage};

mod conditions;

/// Time between two looks at the update rule.
const TICK: Span = Span::from_nanos(1_000_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: ThermalModelConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(ThermalModelStage::new(config, &machine))?;
    let mut wiring = Wiring::new(setup.name(), parameters, stage)
        .saved()
        .on(&topics::BLOCKS_MEASUREMENT, Input::Block)
        .on(&topics::TEST_SEGMENT, Input::Segment)
        .every(TICK, || Input::Tick)
        .publish(&topics::THERMAL_MODEL, |output| match output {
            Output::Model(model) => Some(model),
            _ => None,
        })
        .publish(&topics::THERMAL_UPDATE_REQUEST, |output| match output {
            Output::UpdateRequest(request) => Some(request),
            _ => None,
        })
        .diagnose(conditions::condition);
    for sensor in &machine.temperature_sensors {
        wiring = wiring.on_member(&topics::TEMPERATURE, &sensor.id, Input::Temperature)?;
    }
    Ok(wiring.node())
}
