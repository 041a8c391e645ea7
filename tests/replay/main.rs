//! The replay contract: a bag of a run in simulated time determines its results, byte for byte, and a replay that could
//! not fail is none.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(clippy::disallowed_methods, reason = "tests read files")]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

mod computed;
mod contract;
mod descriptions;
mod equal_bytes;
mod frames;
mod host_clocks;
mod joined;
mod kept;
mod leaps;
mod lifecycle;
mod old_bags;
mod one_wrong;
mod other_recorders;
mod out_of_run;
mod parts;
mod positioning;
mod recorded_output;
mod rewrite;
mod rotary;
mod snapshot;
mod spoiled;
mod update_requests;
mod wall_clock;
mod wrong_stamps;
