//! A page of a cell as it is now, for browsers.
//!
//! `stage` takes what the topics carry and says, at each look, which part of the page has changed: the latest value of
//! each, as JSON. It has no clock: when a value was heard, and when it is looked at, comes with the event. `io` is the
//! server, built with the feature `serve`; `config` holds the parameters and what they allow.

mod config;
mod error;
pub mod io;
mod page;
mod stage;

pub use config::{DEFAULT_ADDRESS, LiveViewConfig, Settings, checked_token};
pub use error::LiveViewError;
pub use page::{Condition, MOST_CONDITIONS, MOST_NAMES, MOST_TOUCHES};
pub use stage::{Input, LiveViewStage, Output};
