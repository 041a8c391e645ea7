//! The server: the only part that does something itself.
//!
//! It is built with the feature `serve`; without it nothing is served, and it is said how it is built.

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
mod patience;
#[cfg(feature = "serve")]
mod server;

#[cfg(not(feature = "serve"))]
pub use none::LiveViewIo;
#[cfg(feature = "serve")]
pub use server::LiveViewIo;

/// Whether the program has the server.
pub const IS_BUILT: bool = cfg!(feature = "serve");

/// Hands over what was heard since the last call, each with its instant, and says what time it is.
pub type Source = Box<dyn FnMut(&mut Vec<(Stamp<Host>, Input)>) -> Stamp<Host> + Send>;

/// What the server has done so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Browsers that look now.
    pub browsers: usize,
    /// Requests that were refused since the start, by reason.
    pub refused: BTreeMap<&'static str, u64>,
}
