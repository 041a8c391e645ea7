//! A machine that only reports, read by OPC UA, on the same topics as a controller.
//!
//! A server has *nodes*, each with an identifier in a namespace. The bridge subscribes to those of its mapping, by the
//! namespace's URI and the identifier ([`node_key`]) or by browse names from `Objects` on: a namespace's index may be
//! another after every start of the server, so it is looked up at each connection and never written down. A change comes
//! as a value, a status code and the source's stamp. A bad status is absence, never a value; an uncertain one is counted.
//!
//! What a value then is in the world of axes, feeds and temperatures is the business of [`machine_report`], which all
//! bridges share. The bridge reads: nothing is written to the machine, no method is called.
//!
//! What is done outside (connect, browse, subscribe) is in [`io`]; everything else is the pure [`stage::BridgeStage`].
//!
//! # References
//! OPC 10000-4 (services), -6 (node identifiers as text, `nsu=`), -8 (overflow bit); OPC 40001-1 (machinery);
//! OPC 40501-1 (machine tools).

pub mod condition;
pub mod config;
pub mod engineering_unit;
pub mod error;
pub mod io;
pub mod live;
pub mod node_key;
pub mod proposal;
pub mod ready;
pub mod stage;
pub mod status;
pub mod value;

pub use condition::Condition;
pub use config::{BridgeConfig, Settings};
pub use error::BridgeError;
pub use stage::{BridgeStage, Input, Output};
