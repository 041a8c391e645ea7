//! The live runner on real DDS, or over Zenoh by `RMW_IMPLEMENTATION`: loopback only, each test in a domain of its own.
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and write files"
)]
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(clippy::too_many_lines, reason = "a test tells one story")]

mod live {
    pub mod actions;
    pub mod log_levels;
    pub mod parameters;
    pub mod processes;
    pub mod puppet;
    pub mod simulated_time;
    pub mod stopping;
    pub mod tap;
    pub mod topics;
}
