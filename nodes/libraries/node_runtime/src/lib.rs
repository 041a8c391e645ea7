//! Runs nodes: the only crate that knows ROS.
//!
//! A node is a pure [`metrology::Stage`] put behind a table of topics ([`Wiring`]). The table is
//! driven by one of two runners. The live runner ([`run`], [`run_composed`], [`launch`]) puts it on the
//! ROS graph, with real clocks. The [`Harness`] wires many nodes to each other directly, in one total
//! order and simulated time; a scenario in one process and a replay both use it, so that equal inputs
//! give equal bytes.
#![cfg_attr(not(test), warn(clippy::print_stderr))]

pub mod access;
pub mod arguments;
mod clock;
pub mod complaint;
mod dds;
pub mod diagnostic;
pub mod environment;
pub mod harness;
pub mod interruption;
pub mod lifecycle;
pub mod live;
mod log;
pub mod names;
mod network;
pub mod node;
pub mod parameter;
pub mod setup;
pub mod tap;
pub mod text_file;
pub mod wiring;
#[cfg(feature = "zenoh")]
mod zenoh;

pub use clock::HostTime;
pub use diagnostic::{Diagnostic, Level};
pub use harness::Harness;
pub use interruption::Interruption;
pub use live::{Composition, Running, launch, run, run_composed};
pub use log::{Undecoded, deafness};
pub use node::{Bytes, Emission, Event, GoalId, GoalStatus, Node, NodeFault};
pub use setup::Setup;
pub use tap::{RawPublisher, RawTap};
pub use wiring::{ClientSignal, GoalNews, GoalSignal, Lifecycle, Wiring};
