//! ROS shell of axis_compensation.

use abbe_msgs::std_srvs::srv::SetBoolResponse;
use abbe_msgs::topics;
use anyhow::Context;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Input, Output, Severity};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::parameter::Parameter;
use node_runtime::{Diagnostic, Level, Node, Wiring};

/// Name of the node, its folder, parameter file and log target.
pub const NAME: &str = "axis_compensation";

/// The node for a resolved configuration; `parameters` is what `ros2 param` shows of it.
///
/// # Errors
/// When the configuration or the machine file is refused.
pub fn node(
    config: &AxisCompensationConfig,
    parameters: Vec<Parameter>,
    machine: &MachineFile,
) -> anyhow::Result<Box<dyn Node>> {
    let stage = AxisCompensationStage::new(config, machine).context(NAME)?;
    Ok(Wiring::new(NAME, parameters, stage)
        .on(&topics::AXES_STATE, Input::State)
        .on(&topics::THERMAL_MODEL, |model| {
            Input::Model(Box::new(model))
        })
        // Without axis states the last fade at a shutdown goes on by these ticks.
        .every(Span::from_secs_f64(0.05), || Input::Tick)
        .service(
            &topics::SET_COMPENSATION,
            |request| Input::Enable(request.data),
            |outcome| SetBoolResponse {
                success: outcome.is_ok(),
                message: outcome.err().unwrap_or_default().to_owned(),
            },
        )
        .publish(&topics::COMPENSATION, |output| match output {
            Output::Compensation(compensation) => Some(compensation),
            _ => None,
        })
        .diagnose(condition)
        .shutdown(
            || Input::Shutdown,
            |output| matches!(output, Output::FadedOut),
        )
        .node())
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
