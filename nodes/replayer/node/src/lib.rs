//! ROS shell of replayer: a bag's messages on the topics on which they were recorded.

use std::sync::Arc;

use abbe_msgs::std_srvs::srv::TriggerResponse;
use abbe_msgs::topics;
use anyhow::Result;
use metrology::stamp::Span;
use node_runtime::environment::Environment;
use node_runtime::{Node, Setup, Wiring};
use replayer::PlaybackConfig;

mod access;
mod contents;
mod desk;
mod graph_watch;
mod latched;
mod player;
mod watch;

pub use access::access;
pub use desk::{Desk, Progress};
pub use player::Played;
use player::Player;
use watch::{Input, Output, Watch};

/// Time between two looks at the player.
const TICK: Span = Span::from_nanos(200_000_000);

/// Builds the node; the bag begins to play after `delay_s`.
///
/// # Errors
/// When a parameter is wrong, the bag cannot be opened or holds nothing of what is asked for, or there is no network.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    play(setup, &setup.config()?).map(|(node, _)| node)
}

/// The same for given parameters, with the desk at which the playing can be watched.
///
/// # Errors
/// As [`node`].
pub fn play(setup: &Setup, config: &PlaybackConfig) -> Result<(Box<dyn Node>, Arc<Desk>)> {
    let parameters = setup.resolved(config)?;
    let names = access::voice(setup.names());
    let player = Player::start(&Environment::read()?, &names, config)?;
    let desk = player.desk();
    let done = |answered: Result<&[Output], &str>| match answered {
        Ok(outputs) => outputs.iter().find_map(Output::answer).unwrap_or_default(),
        Err(reason) => TriggerResponse {
            success: false,
            message: reason.to_owned(),
        },
    };
    let node = Wiring::new(setup.name(), parameters, Watch::new(player))
        .every(TICK, || Input::Tick)
        .service(&topics::PAUSE_PLAYING, |_| Input::Pause, done)
        .service(&topics::RESUME_PLAYING, |_| Input::Resume, done)
        .service(&topics::STEP_PLAYING, |_| Input::Step, done)
        .diagnose(Output::diagnostic)
        .shutdown(
            || Input::Shutdown,
            |output| matches!(output, Output::Stopped),
        )
        .node();
    Ok((node, desk))
}
