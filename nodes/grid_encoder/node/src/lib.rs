//! ROS shell of the grid encoder.

use abbe_msgs::topics;
use anyhow::Result;
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Diagnostic, Level, Node, Setup, Wiring};

/// Time between two looks at a recording that ends.
const TICK: Span = Span::from_nanos(50_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: GridEncoderConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(GridEncoderStage::new(&config, &machine))?;
    Ok(Wiring::new(setup.name(), parameters, stage)
        .saved()
        .on(&topics::AXES_STATE, Input::State)
        .on(&topics::GRID_POSITION, Input::Reading)
        .on(&topics::TEST_SEGMENT, Input::Segment)
        .every(TICK, || Input::Tick)
        .publish(&topics::GEOMETRY_MODEL, |output| match output {
            Output::Model(model) => Some(model),
            _ => None,
        })
        .diagnose(condition)
        .node())
}

fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(diagnostic) = output else {
        return None;
    };
    let level = Level::from(diagnostic.severity());
    Some(Diagnostic::new(
        level,
        diagnostic.condition(),
        diagnostic.to_string(),
    ))
}
