//! ROS shell of the fake machine.

use abbe_msgs::topics;
use anyhow::{Context, Result};
use fake_cnc::{Cnc, Config, Input, Output};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Lifecycle, Node, Setup, Wiring};

mod forms;
mod plant_file;
mod witness;

pub use witness::Witness;
use witness::Witnessed;

/// Builds the node.
///
/// # Errors
/// When a parameter, the machine file or the plant file is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    witnessed(setup, None)
}

/// Builds the node with somebody who may look at the plant's truth.
///
/// # Errors
/// As [`node`].
pub fn witnessed(setup: &Setup, witness: Option<Witness>) -> Result<Box<dyn Node>> {
    let config: Config = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("machine_file")?;
    let of_machine = path.display().to_string();
    let machine = MachineFile::parse(&text, &of_machine)?;
    let plant = plant_file::plant(setup, &machine)?;
    let cnc = setup
        .built(Cnc::new(&config, &machine, plant))
        .with_context(|| format!("with the machine file {of_machine}"))?
        .inactive();
    let period = Span::from_secs_f64(machine.control.servo_period_ms / 1e3);
    let within = Span::from_secs_f64(config.rest_s());
    let at_rest = |output: &Output| *output == Output::AtRest;
    let lifecycle = Lifecycle::new(config.autostart, within, Input::Active, at_rest);
    let wiring = Wiring::new(setup.name(), parameters, Witnessed { cnc, witness })
        .every(period, || Input::Tick)
        .on(&topics::COMPENSATION, Input::Compensation)
        .authors_of(&topics::COMPENSATION, Witnessed::hears)
        .publish_in(
            &topics::AXES_STATE,
            setup.frame(""),
            |message| &mut message.header.frame_id,
            forms::state,
        )
        .publish_message(&topics::JOINT_STATES, forms::joints())
        .publish_in(
            &topics::PROBE_TRIGGER,
            setup.frame(machine::frames::MACHINE),
            |message| &mut message.header.frame_id,
            forms::trigger,
        )
        .publish(&topics::GRID_POSITION, forms::grid)
        .publish(&topics::LENGTH_POSITION, forms::length)
        .action_server(
            &topics::RUN_PROGRAM,
            forms::run,
            forms::cancel,
            forms::signals,
        );
    let mut wiring = forms::at_the_control(wiring);
    for sensor in &machine.temperature_sensors {
        let id = sensor.id.clone();
        wiring = wiring.publish_member(&topics::TEMPERATURE, &sensor.id, move |output| {
            forms::temperature(output, &id)
        })?;
    }
    Ok(wiring.stops_last().managed(lifecycle))
}
