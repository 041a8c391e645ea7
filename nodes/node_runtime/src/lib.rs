//! Runs nodes: the only crate that knows ROS.
//!
//! A node is a pure [`metrology::Stage`] put behind a table of topics ([`Wiring`]). The table is
//! driven by one of two runners. The live runner puts it on the ROS graph, with real clocks. The
//! [`Harness`] wires many nodes to each other directly, in one total order and simulated time; a
//! scenario in one process and a replay both use it, so that equal inputs give equal bytes.

pub mod diagnostic;
pub mod harness;
pub mod node;
pub mod parameter;
pub mod wiring;

pub use diagnostic::{Diagnostic, Level};
pub use harness::Harness;
pub use node::{Bytes, Emission, Event, GoalId, GoalStatus, Node, NodeFault};
pub use wiring::{ClientSignal, GoalNews, GoalSignal, Wiring};
