//! The server, built with the feature `serve`. Without it, a start ends with the command that builds it.

use std::collections::BTreeMap;

use metrology::Stamp;
use metrology::stamp::Host;

use crate::stage::Input;

#[cfg(feature = "serve")]
mod document;
#[cfg(feature = "serve")]
mod gate;
#[cfg(feature = "serve")]
mod hub;
#[cfg(not(feature = "serve"))]
mod none;
#[cfg(feature = "serve")]
mod server;

#[cfg(not(feature = "serve"))]
pub use none::LiveViewIo;
#[cfg(feature = "serve")]
pub use server::LiveViewIo;

/// Appends the inputs since the last call, each with its instant, and returns the time.
pub type Source = Box<dyn FnMut(&mut Vec<(Stamp<Host>, Input)>) -> Stamp<Host> + Send>;

/// Browsers and refused requests of a server.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Browsers connected now.
    pub browsers: usize,
    /// Requests refused since the start, by reason.
    pub refused: BTreeMap<&'static str, u64>,
}
