//! Between the bridge's outputs and their messages.

use abbe_msgs::joint_state;
use abbe_msgs::sensor_msgs::msg::JointState;
use metrology::sample::{AxisState, MachineValue, TemperatureSample};
use node_runtime::{Diagnostic, Level};
use opcua_bridge::Output;

pub(crate) fn state(output: &Output) -> Option<&AxisState> {
    match output {
        Output::State(state) => Some(state),
        _ => None,
    }
}

pub(crate) fn joints(output: &Output) -> Option<JointState> {
    state(output).map(joint_state)
}

pub(crate) fn value<'a>(output: &'a Output, name: &str) -> Option<&'a MachineValue> {
    match output {
        Output::Value(value) if value.name == name => Some(value),
        _ => None,
    }
}

pub(crate) fn temperature<'a>(output: &'a Output, name: &str) -> Option<&'a TemperatureSample> {
    match output {
        Output::Temperature(sample) if sample.sensor == name => Some(sample),
        _ => None,
    }
}

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Condition(condition) = output else {
        return None;
    };
    let level = Level::from(condition.severity());
    let diagnostic = Diagnostic::new(level, condition.name(), condition.to_string());
    Some(match condition.count() {
        Some(count) => diagnostic.with("count", count),
        None => diagnostic,
    })
}
