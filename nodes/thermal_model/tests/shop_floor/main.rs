//! The whole stage on a shop floor: blocks, a probe, a clock and a drift that each test makes up.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![expect(clippy::print_stdout, reason = "figures that module headers quote")]

mod saw_tooth;
mod scenes;
mod shop;
mod sign;
