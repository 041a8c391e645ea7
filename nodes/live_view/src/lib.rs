//! A page of a cell as it is now, for browsers.
//!
//! `stage` takes the messages of the topics; at each look it outputs the parts of the page that changed, as JSON. It reads
//! no clock: every event brings its instant. `io` is the server, built with the feature `serve`. `config` has the
//! parameters and their limits.

mod config;
mod error;
pub mod io;
mod page;
mod stage;

pub use config::{DEFAULT_ADDRESS, LiveViewConfig, Settings, checked_token};
pub use error::LiveViewError;
pub use page::{Condition, MOST_NAMES, MOST_TOUCHES};
pub use stage::{Input, LiveViewStage, Output};
