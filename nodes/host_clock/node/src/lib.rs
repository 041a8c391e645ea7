//! ROS shell of the host clock.

use abbe_msgs::topics;
use anyhow::Result;
use host_clock::{Diagnostic as Condition, HostClockConfig, HostClockStage, Input, Output};
use metrology::sample::HostClock;
use metrology::stamp::Span;
use node_runtime::{Diagnostic, Level, Node, Setup, Wiring};

/// Between two maps.
const TELL: Span = Span::from_nanos(1_000_000_000);

/// Builds the node.
///
/// # Errors
/// When a parameter is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: HostClockConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let stage = setup.built(HostClockStage::new(&config))?;
    let table = Wiring::new(setup.name(), parameters, stage).keeps_own_time();
    if config.is_reference() {
        return Ok(table
            .on(&topics::CLOCK_QUESTION, Input::Question)
            .publish(&topics::CLOCK_ANSWER, |output| match output {
                Output::Answer(answer) => Some(answer),
                _ => None,
            })
            .node());
    }
    Ok(table
        .saved()
        .on(&topics::CLOCK_ANSWER, Input::Answer)
        .every(config.period(), || Input::Ask)
        .every(TELL, || Input::Tell)
        .publish(&topics::CLOCK_QUESTION, |output| match output {
            Output::Question(question) => Some(question),
            _ => None,
        })
        .publish(&topics::HOST_CLOCK, |output| match output {
            Output::Map(map) => Some(map),
            _ => None,
        })
        .diagnose(condition)
        .node())
}

/// How the clocks stand to each other, for people who look at `/diagnostics`.
fn figure(clock: &HostClock) -> Diagnostic {
    let offset_s = clock.map.offset(clock.map.at()).as_secs_f64();
    let message = format!(
        "host {} is {offset_s:.6} s ahead of {}, standard uncertainty {:.6} s",
        clock.reference, clock.host, clock.standard_uncertainty_s
    );
    Diagnostic::new(Level::Ok, "clock_relation", message)
        .with("offset_s", format!("{offset_s:.9}"))
        .with("standard_uncertainty_s", clock.standard_uncertainty_s)
        .with("drift_us_per_s", clock.map.drift() * 1e6)
        .with("bound_s", clock.bound_s)
        .with("least_round_trip_s", clock.least_round_trip_s)
        .with("exchanges", clock.n)
        .with("steps", clock.steps)
        .staying()
}

fn condition(output: &Output) -> Option<Diagnostic> {
    match output {
        Output::Diagnostic(found) => {
            let level = Level::from(found.severity());
            let told = Diagnostic::new(level, found.condition(), found.to_string());
            Some(match found {
                Condition::Stepped { by_s, .. } => told.with("by_s", by_s),
                Condition::Silent { silence_s, .. } => told.with("silence_s", silence_s),
                _ => told,
            })
        }
        Output::Map(clock) => Some(figure(clock)),
        Output::Question(_) | Output::Answer(_) => None,
    }
}
