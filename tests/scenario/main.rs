//! Whole cells in simulated time: what goes wrong with a probe, a block or a plan is said with place,
//! value and limit and spoils nothing else; the scenarios of launch_configs do what their pages say.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

#[path = "../../nodes/libraries/history/tests/postgres/authority.rs"]
#[expect(dead_code, reason = "the tests of the history use the rest")]
mod authority;
mod bad_plan;
mod blocks;
mod cell;
mod design;
mod diagonals;
mod five_axis;
mod fleet_board;
mod gap_alike;
mod gap_bad_bags;
mod gap_first;
mod gap_import;
mod gap_pair;
mod gap_parts;
mod gap_plain;
mod gap_report;
mod gap_simulated;
mod gap_wear;
mod grid_truth;
mod grid_xy;
mod kept;
mod lifecycle;
mod live_view;
mod mtconnect_log;
mod odd_files;
mod odd_logs;
mod page;
mod positioning;
#[path = "../../nodes/libraries/history/tests/postgres/server.rs"]
#[expect(dead_code, reason = "the tests of the history use the rest")]
mod postgres;
mod preflight;
mod probe_faults;
mod real_shift;
mod recorded;
#[path = "../replay/rewrite.rs"]
mod rewrite;
mod rotary_coverage;
mod schemas;
mod shadow;
mod shipped;
mod short;
mod times;
mod told;
mod volumetric;
mod waiting;
mod warm_up;
mod weighted_increments;
