//! Faults from outside: full disks, messages that are doubled, out of order, stale or senseless, clocks that step, second
//! publishers, bags that are played among them, more participants than find each other. Each in a network of its own.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

mod bag_of_steps;
mod clock_steps;
mod crowd;
mod disk;
mod messages;
mod offsets;
mod played;
mod said;
mod stepped_cell;
mod tables;
mod told_badly;
mod twins;
