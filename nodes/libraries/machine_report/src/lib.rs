//! What machines report, however they say it: by MTConnect, by OPC UA.
//!
//! A bridge makes an [`observation`] of what it receives: a stamp of the machine's clock, a key, and the value. From
//! there on this crate does the rest, in one place for all bridges. A [`mapping`] states what a key is in the world of
//! axes, feeds and temperatures, and in which [unit](mod@unit). [`values`] keeps three things apart that a shop floor
//! mixes: a value that is *absent* gives no message, a value that *cannot be* is reported as a condition and is not
//! handed on as a temperature ([`plausibility`], [`possible`]), and a value that is good.

pub mod account;
pub mod alarm;
pub mod condition;
pub mod error;
pub mod leap;
pub mod mapping;
pub mod observation;
pub mod plausibility;
pub mod positions;
pub mod possible;
pub mod report;
pub mod turns;
pub mod unit;
pub mod values;

pub use condition::ValueCondition;
pub use error::MappingError;
pub use mapping::{MapFile, Mapping};
pub use report::{Report, Sink};
