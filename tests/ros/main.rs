//! Nodes as processes on the ROS graph: killed and restarted, told nonsense, started wrongly.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and read the environment"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

mod bad_topics;
mod debian;
mod gap_follows;
mod interruptions;
mod kills;
mod machine_that_reports;
mod playing;
mod recording;
mod refusals;
