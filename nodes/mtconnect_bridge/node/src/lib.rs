//! ROS shell of mtconnect_bridge.

use abbe_msgs::topics;
use anyhow::{Result, anyhow};
use metrology::sample::Quantity;
use metrology::stamp::Span;
use metrology::yaml;
use mtconnect_bridge::config::Source;
use mtconnect_bridge::io::LogFile;
use mtconnect_bridge::live::{LiveBridge, LiveInput};
use mtconnect_bridge::mapping::{MapFile, Use};
use mtconnect_bridge::{BridgeConfig, Output, Settings};
use node_runtime::{Node, Setup, Wiring};

mod forms;

/// Time between two looks at what has come from the machine; every look takes all that came since the last.
const TICK: Span = Span::from_nanos(10_000_000);

/// Builds the node; it looks for the machine at its first tick.
///
/// # Errors
/// When a parameter or the mapping is wrong.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: BridgeConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let (path, text) = setup.file_text("map_file")?;
    let placed = |error: &dyn std::fmt::Display| {
        let file = path.display().to_string();
        anyhow!("mapping {}", yaml::placed(&file, &text, &error.to_string()))
    };
    let map = MapFile::from_yaml(&text).map_err(|error| placed(&error))?;
    let settings = Settings::new(&config, &map).map_err(|error| placed(&error))?;
    let bridge = match settings.source {
        Source::Log => {
            let (file, length) = setup.file_opened("log_file")?;
            LiveBridge::of_log(&settings, LogFile::new(file, length))
        }
        Source::Shdr | Source::Agent => {
            LiveBridge::open(&settings)?.stamped_by(setup.arrival_clock())
        }
    };
    let mut wiring = Wiring::new(setup.name(), parameters, bridge)
        .every(TICK, || LiveInput::Tick)
        .diagnose(forms::condition)
        .shutdown(
            || LiveInput::Shutdown,
            |output| matches!(output, Output::Stopped),
        );
    // Without an axis in its mapping it may stand beside a controller that tells them.
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
