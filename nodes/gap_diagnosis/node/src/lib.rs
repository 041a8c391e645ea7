//! ROS shell of the gap diagnosis.

use abbe_msgs::topics;
use anyhow::Result;
use gap_diagnosis::session::Input::{
    Block, Compensation, Grid, Length, Segment, State, Temperature, Trigger,
};
use gap_diagnosis::{GapDiagnosisConfig, GapDiagnosisStage, Input, Output};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Diagnostic, Level, Node, Setup, Wiring};

mod beside;

use beside::Beside;

/// Time between two looks at whether a diagnosis is due.
const TICK: Span = Span::from_nanos(500_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: GapDiagnosisConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(GapDiagnosisStage::new(&config, &machine))?;
    let mut wiring = Wiring::new(setup.name(), parameters, Beside::new(stage))
        .live(Beside::begin)
        .on(&topics::AXES_STATE, |s| Input::Sample(State(s)))
        .on(&topics::GRID_POSITION, |s| Input::Sample(Grid(s)))
        .on(&topics::LENGTH_POSITION, |s| Input::Sample(Length(s)))
        .on(&topics::PROBE_TRIGGER, |s| Input::Sample(Trigger(s)))
        .on(&topics::COMPENSATION, |s| Input::Sample(Compensation(s)))
        .on(&topics::BLOCKS_MEASUREMENT, |s| Input::Sample(Block(s)))
        .on(&topics::TEST_SEGMENT, |s| Input::Sample(Segment(s)))
        .every(TICK, || Input::Tick)
        .publish(&topics::GAP_REPORT, |output| match output {
            Output::Report(report) => Some(report.as_ref()),
            _ => None,
        })
        .diagnose(condition);
    for sensor in &machine.temperature_sensors {
        wiring = wiring.on_member(&topics::TEMPERATURE, &sensor.id, |s| {
            Input::Sample(Temperature(s))
        })?;
    }
    Ok(wiring.node())
}

fn condition(output: &Output) -> Option<Diagnostic> {
    let (level, name, message) = match output {
        Output::NewEffect {
            effect,
            besides,
            size,
            confidence,
        } => {
            let message =
                format!("new effect: {effect}{besides}, {size}, confidence {confidence:.2}");
            (Level::Warn, "new_effect", message)
        }
        Output::NewRest { covariate } => {
            let message = format!("a rest that no known effect explains goes with {covariate}");
            (Level::Warn, "unknown_effect", message)
        }
        Output::OtherMachine(error) => {
            let message = format!(
                "axes/state: {error}; such states are left out and counted, the diagnosis goes on: remap the other machine's topic"
            );
            (Level::Warn, "another_machine", message)
        }
        Output::NotYet(error) => (Level::Ok, "no_diagnosis", error.to_string()),
        Output::LeftOut(remarks) => (Level::Ok, "left_out", remarks.join("; ")),
        Output::Report(_) | Output::Due(_) => return None,
    };
    Some(Diagnostic::new(level, name, message))
}
