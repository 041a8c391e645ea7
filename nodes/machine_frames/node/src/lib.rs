//! ROS shell of the machine's frames.

use abbe_msgs::{topics, transforms};
use anyhow::Result;
use machine::MachineFile;
use machine_frames::{Input, MachineFramesConfig, MachineFramesStage, Output};
use metrology::stamp::Span;
use node_runtime::{Diagnostic, Level, Node, Setup, Wiring};

/// Between two looks whether positions still come.
const TICK: Span = Span::from_nanos(1_000_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: MachineFramesConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(MachineFramesStage::new(&config, &machine, |name| {
        setup.frame(name)
    }))?;
    Ok(Wiring::new(setup.name(), parameters, stage)
        .on(&topics::JOINT_STATES, Input::Joints)
        .every(TICK, || Input::Tick)
        .publish_message(&topics::TF_STATIC, |output| match output {
            Output::Fixed(poses) => Some(transforms(poses)),
            _ => None,
        })
        .publish_message(&topics::TF, |output| match output {
            Output::Moving(poses) => Some(transforms(poses)),
            _ => None,
        })
        .diagnose(condition)
        .node())
}

fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(found) = output else {
        return None;
    };
    let level = Level::from(found.severity());
    Some(Diagnostic::new(level, found.condition(), found.to_string()))
}
