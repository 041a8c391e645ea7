//! ROS shell of the latency calibrator.

use abbe_msgs::topics;
use anyhow::Result;
use latency_calibrator::{Input, LatencyCalibratorConfig, LatencyCalibratorStage, Output};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Diagnostic, Level, Node, Setup, Wiring};

/// Time between two looks at a run that ends.
const TICK: Span = Span::from_nanos(10_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter or the machine file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: LatencyCalibratorConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let stage = setup.built(LatencyCalibratorStage::new(&config, &machine))?;
    Ok(Wiring::new(setup.name(), parameters, stage)
        .saved()
        .on(&topics::AXES_STATE, Input::State)
        .on(&topics::PROBE_TRIGGER, Input::Trigger)
        .on(&topics::TEST_SEGMENT, Input::Segment)
        .every(TICK, || Input::Tick)
        .publish(&topics::LATENCY, |output| match output {
            Output::Latency(latency) => Some(latency),
            _ => None,
        })
        .diagnose(condition)
        .node())
}

fn condition(output: &Output) -> Option<Diagnostic> {
    match output {
        Output::Refused(refusal) => Some(Diagnostic::new(
            Level::Warn,
            "calibration",
            refusal.to_string(),
        )),
        Output::ClockWentBack { from, to } => {
            let message = format!(
                "controller time went back from {} to {} ns",
                from.nanos(),
                to.nanos()
            );
            Some(Diagnostic::new(Level::Error, "clock_went_back", message))
        }
        Output::Latency(latency) if latency.negative => {
            let message = format!("latency {:.6} s is below zero", latency.latency_s);
            Some(Diagnostic::new(Level::Error, "negative_latency", message))
        }
        Output::Latency(_) => Some(Diagnostic::new(
            Level::Ok,
            "negative_latency",
            String::new(),
        )),
        Output::Evaluation(_) => None,
    }
}
