//! Several hosts: the controller on one, models on another, the recorder on a third, over links that delay, lose and break.
//!
//! Each host is a network namespace with a tap; between them is a switch of the test's own, which does to frames what
//! the test says. What needs namespaces and taps that this computer does not have is said, and fails where `CI=true`.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(
    clippy::disallowed_methods,
    reason = "programs are run, time passes, and CI is asked"
)]

mod contours;
mod cuts;
mod named_hosts;
mod three_hosts;
