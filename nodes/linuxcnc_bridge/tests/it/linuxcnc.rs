//! A real LinuxCNC behind the bridge, without a display, as an ordinary user.
//!
//! Only one LinuxCNC runs on a computer: each test has namespaces of its own, in which it is the only one.
//! Where LinuxCNC is not installed nothing can be tested: that is a failure where `CI=true`, and is
//! said elsewhere.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::print_stdout, reason = "the figures seen are worth showing")]
#![expect(
    clippy::disallowed_methods,
    reason = "a real machine is waited for, and CI is asked"
)]

mod compensation;
mod cycles;
mod faults;
mod latency;
mod rig;
mod screw_error;
mod start;
mod states;
mod tilted;
