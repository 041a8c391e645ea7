//! How late the probe's signal is, from touches of one surface at different feeds.
//!
//! A touch latched T too late reads P = P0 + n f T along its approach n: the faster, the deeper.
//! `motion_log` tells the feed at contact from where the axes were, and whether it was steady;
//! `two_feed` is the published method, from touches at two feeds; `line` is the signed estimate over
//! all feeds with its uncertainty and its lack of fit; `evaluation` applies both to the touches of
//! one feature and decides which is used. `stage` is the node's whole computation.
//!
//! Whatever else grows with the feed is estimated along with T: a pretravel that depends on the feed
//! (dp/df), half a servo period where the latch is polled, and 1/Kv where a control latches commands
//! instead of encoder positions. For a correction at the same feeds that is what is wanted.

pub mod config;
pub mod diagnostic;
pub mod error;
pub mod evaluation;
pub mod line;
pub mod motion_log;
pub mod stage;
pub mod two_feed;

pub use config::LatencyCalibratorConfig;
pub use diagnostic::{Refusal, TouchFault};
pub use error::LatencyCalibratorError;
pub use stage::{Input, LatencyCalibratorStage, Output};
