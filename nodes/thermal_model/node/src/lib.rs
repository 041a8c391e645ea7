//! ROS shell of thermal_model.

use abbe_msgs::topics;
use anyhow::Context;
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::parameter::Parameter;
use node_runtime::{Diagnostic, Level, Node, Wiring};
use thermal_model::{Input, Output, Severity, ThermalModelConfig, ThermalModelStage};

/// Name of the node, its folder, parameter file and log target.
pub const NAME: &str = "thermal_model";

/// The node for a resolved configuration; `parameters` is what `ros2 param` shows of it.
///
/// # Errors
/// When the configuration or the machine file is refused, or a sensor's id is no ROS name.
pub fn node(
    config: ThermalModelConfig,
    parameters: Vec<Parameter>,
    machine: &MachineFile,
) -> anyhow::Result<Box<dyn Node>> {
    let stage = ThermalModelStage::new(config, machine).context(NAME)?;
    let mut wiring = Wiring::new(NAME, parameters, stage)
        .on(&topics::BLOCKS_MEASUREMENT, Input::Block)
        .on(&topics::TEST_SEGMENT, Input::Segment)
        .every(Span::from_secs_f64(1.0), || Input::Tick)
        .publish(&topics::THERMAL_MODEL, |output| match output {
            Output::Model(model) => Some(model),
            _ => None,
        })
        .publish(&topics::THERMAL_UPDATE_REQUEST, |output| match output {
            Output::UpdateRequest(request) => Some(request),
            _ => None,
        })
        .diagnose(condition);
    for sensor in &machine.temperature_sensors {
        wiring = wiring
            .on_member(&topics::TEMPERATURE, &sensor.id, Input::Temperature)
            .with_context(|| format!("temperature sensor \"{}\"", sensor.id))?;
    }
    Ok(wiring.node())
}

fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(diagnostic) = output else {
        return None;
    };
    let level = match diagnostic.severity() {
        Severity::Info => Level::Ok,
        Severity::Warn => Level::Warn,
        Severity::Error => Level::Error,
    };
    Some(Diagnostic::new(
        level,
        diagnostic.condition(),
        diagnostic.to_string(),
    ))
}
