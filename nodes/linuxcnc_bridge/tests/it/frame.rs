//! Programs of machine coordinates on a LinuxCNC in any modal state: they run in the machine's frame or are refused,
//! and the state is afterwards what it was.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod control;
mod desk;
mod offsets;
mod states;
mod waiting;
