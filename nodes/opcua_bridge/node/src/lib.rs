//! ROS shell of opcua_bridge.

use abbe_msgs::topics;
use anyhow::{Result, anyhow};
use machine_report::mapping::{MapFile, Use};
use metrology::sample::Quantity;
use metrology::stamp::Span;
use metrology::yaml;
use node_runtime::{Node, Setup, Wiring};
use opcua_bridge::io::IS_BUILT;
use opcua_bridge::live::{LiveBridge, LiveInput};
use opcua_bridge::{BridgeConfig, BridgeError, Output, Settings};

mod files;
mod forms;

/// Time between two looks at what has come from the machine; every look takes all that came since the last.
const TICK: Span = Span::from_nanos(10_000_000);

/// Builds the node; it looks for the machine at its first tick.
///
/// # Errors
/// When a parameter or the mapping is wrong, or the program was built without OPC UA.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: BridgeConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    if !IS_BUILT {
        return Err(BridgeError::NotBuilt.into());
    }
    let (file, text) = files::mapping(setup, &config.map_file)?;
    let placed = |error: &dyn std::fmt::Display| {
        anyhow!("mapping {}", yaml::placed(&file, &text, &error.to_string()))
    };
    let map = MapFile::from_yaml(&text).map_err(|error| placed(&error))?;
    let settings = Settings::new(&config, &map).map_err(|error| placed(&error))?;
    let credentials = files::credentials(setup, &config.security)?;
    let bridge = LiveBridge::open(&settings, credentials)?.stamped_by(setup.arrival_clock());
    let mut wiring = Wiring::new(setup.name(), parameters, bridge)
        .every(TICK, || LiveInput::Tick)
        .diagnose(forms::condition)
        .shutdown(
            || LiveInput::Shutdown,
            |output| matches!(output, Output::Stopped),
        );
    // Without an axis in its mapping it may stand beside a controller that publishes them.
    if settings.mapping.has_axes() {
        wiring = wiring
            .publish_in(
                &topics::AXES_STATE,
                setup.frame(""),
                |message| &mut message.header.frame_id,
                forms::state,
            )
            .publish_message(&topics::JOINT_STATES, forms::joints);
    }
    for (_, used) in settings.mapping.uses() {
        let (Use::Number { name, quantity, .. } | Use::Text { name, quantity, .. }) = used else {
            continue;
        };
        let id = name.clone();
        wiring = wiring.publish_member(&topics::MACHINE, name, move |output| {
            forms::value(output, &id)
        })?;
        if *quantity == Quantity::Temperature {
            let id = name.clone();
            wiring = wiring.publish_member(&topics::TEMPERATURE, name, move |output| {
                forms::temperature(output, &id)
            })?;
        }
    }
    Ok(wiring.node())
}
