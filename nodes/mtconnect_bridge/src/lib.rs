//! A machine that only reports, heard through MTConnect, on the same topics as a controller.
//!
//! A machine speaks in one of two ways. Its *adapter* sends lines of text over TCP, one or more values with
//! a stamp each (SHDR); a value is told when it changes, and holds until the next. Or an *agent* collects such
//! values, numbers them, and gives them out as XML over HTTP: `probe` says what there is, `current` what
//! holds now, `sample` what happened from a sequence number on. Either way an [`observation`] comes of it: a
//! stamp of the machine's clock, a key, and what was told.
//!
//! A [`mapping`] says what a key is in the world of axes, feeds and temperatures, and in which unit. From there
//! on three things are kept apart that a shop-floor log mixes: a value that is *absent* (`UNAVAILABLE`, or the
//! line is cut) gives no message; a value that *cannot be*, such as a spindle at 0 °C for a second between two
//! readings of 44 °C, gives a message that says so and is not handed on as a temperature
//! ([`plausibility`]); and a value that is good.
//!
//! Two clocks are told with each message: the machine's stamp, as it was sent, and the host's instant of
//! receipt. Values are taken in the order of arrival; a machine's clock may step back or leap, which is reported.
//!
//! What the bridge does outside (connect, ask, read) is in [`io`]; everything else is the pure
//! [`stage::BridgeStage`].

pub mod agent;
pub mod condition;
pub mod config;
pub mod document;
pub mod error;
pub mod framing;
pub mod io;
pub mod live;
pub mod logged;
pub mod multipart;
pub mod offer;
pub mod pacing;
pub mod proposal;
pub mod reader;
pub mod shdr;
pub mod shift;
pub mod stage;
pub mod text;
pub mod xml;
pub mod xml_bounds;

pub use config::{BridgeConfig, Settings};
pub use error::BridgeError;
// What all bridges share.
pub use machine_report::{
    account, alarm, leap, mapping, observation, plausibility, positions, possible, unit, values,
};
pub use stage::{BridgeStage, Input, Output};
