//! ROS shell of live_view. It has a tap of its own, since topics of sensors appear while it runs.

use anyhow::Result;
use live_view::LiveViewConfig;
use metrology::stamp::Span;
use node_runtime::{Node, Setup, Wiring, complain};

mod decoders;
mod feed;
mod limits;
mod receiver;
mod view;
mod watch;

pub use feed::{Feed, Slot};
pub use limits::limits_of;
pub use receiver::Receiver;
pub use view::{View, ViewOptions};
use watch::{Input, Output, Watch};

/// Time between two reports of the server's account.
const TICK: Span = Span::from_nanos(1_000_000_000);

/// Builds the node, serves the page at once and prints its address.
///
/// # Errors
/// When a parameter is wrong, the address is taken, there is no network, or the program was built without the server.
pub fn node(setup: &Setup) -> Result<Box<dyn Node>> {
    let config: LiveViewConfig = setup.config()?;
    let parameters = setup.resolved(&config)?;
    let view = View::open(&config, ViewOptions::of(setup, &config)?)?;
    let tap = receiver::listen(setup, view.feed())?;
    complain!("{}: {}", setup.name(), view.sentence());
    Ok(Wiring::new(setup.name(), parameters, Watch::new(view, tap))
        .every(TICK, || Input::Tick)
        .diagnose(Output::diagnostic)
        .shutdown(
            || Input::Shutdown,
            |output| matches!(output, Output::Stopped),
        )
        .node())
}
