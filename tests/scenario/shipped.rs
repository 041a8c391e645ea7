//! What `abbe preflight` foresees of the shipped scenarios that no other test runs as they are, and of the others beside their
//! own tests (`Foreseen`).

use std::time::Duration;

use abbe_tests::foreseen::{Foreseen, differences};
use abbe_tests::program::{Process, command, domain};
use abbe_tests::scenario::Scenario;
use serde_json::Value;

/// Longest run, s.
const PATIENCE_S: u64 = 600;

/// Runs a shipped scenario as it is, in a domain of its own, and compares its diagnosis with the preflight.
fn is_foreseen(name: &str, place: u16) {
    let scenario = Scenario::copy_of(name);
    let foreseen = Foreseen::begin(&scenario.folder());
    let mut run = command(domain(place), &["run"]);
    run.arg(scenario.folder()).arg("--runs").arg(scenario.out());
    let ended = Process::start(run).ended_within(Duration::from_secs(PATIENCE_S));
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    foreseen.agrees(&scenario.folder(), &scenario.new_run(&[]));
}

#[test]
fn a_cold_reference_is_foreseen() {
    is_foreseen("cold_reference", 14);
}

#[test]
fn a_screw_that_wears_is_foreseen() {
    is_foreseen("gap_wear", 15);
}

#[test]
fn a_short_cell_is_foreseen() {
    is_foreseen("short_cell", 16);
}

#[test]
fn three_hosts_are_foreseen() {
    is_foreseen("three_hosts", 17);
}

#[test]
fn a_forecast_that_the_run_does_not_bear_out_is_noticed() {
    let planned = serde_json::json!({
        "requested_block_cycles": 0,
        "forecast": {
            "runs": 2,
            "channels": [{"channel": "touch", "repeats": 5}],
            "not_excited": [{"effect": "spindle_growth"}],
        },
    });
    let report = |runs: u64, effect: &str, status: &str, channel: &str| {
        serde_json::json!({
            "inputs": {"bags": [{"runs": runs}]},
            "noise_floor": [{"channel": channel}],
            "causes": [{"effect": effect, "status": status}],
        })
    };
    let of = |report: &Value| differences(&planned, report).len();
    assert_eq!(of(&report(2, "probe_latency", "named", "touch")), 0);
    assert_eq!(of(&report(1, "probe_latency", "named", "touch")), 1);
    assert_eq!(of(&report(17, "probe_latency", "named", "touch")), 1);
    assert_eq!(of(&report(2, "spindle_growth", "named", "touch")), 1);
    assert_eq!(of(&report(2, "spindle_growth", "surrogate", "touch")), 0);
    assert_eq!(of(&report(2, "probe_latency", "set", "grid.u")), 2);
}
