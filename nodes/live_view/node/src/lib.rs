//! ROS shell of live_view: it listens to the network itself, for topics of sensors are found while it runs.

use anyhow::Result;
use live_view::LiveViewConfig;
use metrology::stamp::Span;
use node_runtime::{Node, Setup, Wiring};

mod ears;
mod feed;
mod hearing;
mod limits;
mod view;
mod watch;

pub use feed::{Feed, Slot};
pub use hearing::Hearing;
pub use limits::limits_of;
pub use view::{Given, View};
use watch::{Input, Output, Watch};

/// Time between two looks at the server's account.
const TICK: Span = Span::from_nanos(1_000_000_000);

/// Builds the node; the page is served at once.
///
/// # Errors
/// When a parameter is wrong, the address is taken, there is no network, or the program was built without the server.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: LiveViewConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let view = View::open(&config, Given::of(setup, &config)?)?;
    let tap = hearing::listen(setup, view.feed())?;
    Ok(Wiring::new(setup.name(), parameters, Watch::new(view, tap))
        .every(TICK, || Input::Tick)
        .diagnose(Output::diagnostic)
        .shutdown(
            || Input::Shutdown,
            |output| matches!(output, Output::Stopped),
        )
        .node())
}
