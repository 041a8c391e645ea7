//! The live runner on real DDS: loopback only, each test in a domain of its own.
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and write files"
)]

mod live {
    pub mod actions;
    pub mod parameters;
    pub mod processes;
    pub mod puppet;
    pub mod simulated_time;
    pub mod tap;
    pub mod topics;
}
