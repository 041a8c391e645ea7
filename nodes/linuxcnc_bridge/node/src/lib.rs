//! ROS shell of linuxcnc_bridge.

use std::path::PathBuf;

use abbe_msgs::topics;
use anyhow::Result;
use linuxcnc_bridge::live::{LiveBridge, LiveInput};
use linuxcnc_bridge::{BridgeConfig, Output};
use machine::MachineFile;
use metrology::stamp::Span;
use node_runtime::{Lifecycle, Node, Setup, Wiring};

mod forms;

/// Time between two looks at what has come from LinuxCNC; every look takes all servo periods since the last.
const TICK: Span = Span::from_nanos(5_000_000);

/// How long LinuxCNC may take to call a program off.
const STOP: Span = Span::from_nanos(60_000_000_000);

/// Builds the node; starts LinuxCNC where its parameters name an INI file.
///
/// # Errors
/// When a parameter or the machine file is wrong, time is simulated, or LinuxCNC cannot be started.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: BridgeConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    forms::refuse_simulated_time(setup)?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    let folder = match &config.start_ini {
        Some(ini) => forms::folder_of(&setup.file_path("start_ini")?, ini),
        None => PathBuf::new(),
    };
    let bridge = LiveBridge::prepare(&config, &machine, &folder)?;
    let at_rest = |output: &Output| *output == Output::AtRest;
    let lifecycle = Lifecycle::new(config.autostart, STOP, LiveInput::Active, at_rest)
        .configured(|bridge: &mut LiveBridge| bridge.open().map_err(|error| error.to_string()))
        .cleaned_up(|bridge| {
            bridge.close();
            Ok(())
        });
    Ok(Wiring::new(setup.name(), parameters, bridge)
        .every(TICK, || LiveInput::Tick)
        .on(&topics::COMPENSATION, LiveInput::Compensation)
        .publishers_of(&topics::COMPENSATION, LiveBridge::sees_publishers)
        .authors_of(&topics::COMPENSATION, LiveBridge::hears)
        .publish_in(
            &topics::AXES_STATE,
            setup.frame(""),
            |message| &mut message.header.frame_id,
            forms::state,
        )
        .publish_message(&topics::JOINT_STATES, forms::joints)
        .publish_in(
            &topics::PROBE_TRIGGER,
            setup.frame(machine::frames::MACHINE),
            |message| &mut message.header.frame_id,
            forms::trigger,
        )
        .action_server(
            &topics::RUN_PROGRAM,
            forms::run,
            forms::cancel,
            forms::signals,
        )
        .diagnose(forms::condition)
        .shutdown(
            || LiveInput::Shutdown,
            |output| matches!(output, Output::Stopped),
        )
        .stops_last()
        .managed(lifecycle))
}
