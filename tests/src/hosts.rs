//! Several hosts on one computer, and what the recorder's host has of a run.
//!
//! Each host is a network namespace with a tap; between them is a switch of the test's own ([`switch`]), which does to
//! frames what the test says. What needs namespaces and taps that this computer does not have is said, and fails where
//! `CI=true`.

pub mod bag;
pub mod clocks;
pub mod network;
pub mod site;
pub mod switch;
