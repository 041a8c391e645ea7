//! Other people's software on the other side: Cyclone DDS on the wire, PyPI `rosbags` and `mcap` on
//! a recorded bag. They come from PyPI into a Python of their own (tests/run makes it).
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests look at clocks and write files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

mod bag;
mod calls;
mod fast;
mod foreign;
mod frames;
mod hashes;
mod latched;
mod opcua_cell;
mod opcua_machine;
mod opcua_shift;
mod ring;
mod served;
mod slow;
mod wire;
mod zenoh;
