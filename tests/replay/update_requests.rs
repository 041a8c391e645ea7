//! A block cycle that the thermal model asks for is asked for again.

use std::path::Path;
use std::sync::OnceLock;

use abbe_msgs::msg::ProbeTrigger;
use abbe_tests::scenario::Scenario;

use crate::contract::{Run, check, count, edited, recorded, with_another};
use crate::snapshot::resumes_at;

/// Cold blocks, and production whose begin, once they are evaluated, is a change of load.
const PLAN: &str = "\
title: an update that is asked for
steps:
  - {do: blocks, cold: true}
  - {do: wait, seconds: 1.0}
  - {do: produce, program: part.ngc, minutes: 0.05, serve_updates: true}
";
const PART: &str = "G21 G90 G17\nS8000 M3\nG0 Z240\nG1 X20 F2400\nG1 X-20\nM5\nM2\n";
/// Touches of the cold blocks.
const COLD_TOUCHES: usize = 6;

fn scenario() -> Scenario {
    let scenario = Scenario::copy_of("cold_reference");
    scenario.write("plan.yaml", PLAN);
    scenario.write("part.ngc", PART);
    let latency = "    latency_ms: 3.7\n    latency_standard_uncertainty_ms: 0.01\n";
    scenario.append("probe.yaml", latency);
    let soon = "    cycle: {least_period_min: 0.0}\n";
    scenario.append("thermal_model.yaml", soon);
    scenario
}

/// The bag of its run.
pub fn run() -> &'static Path {
    static RUN: OnceLock<Run> = OnceLock::new();
    recorded(&RUN, scenario)
}

#[test]
fn replay_asks_for_the_same_update_again() {
    let (code, outcome) = check(run());
    assert_eq!(code, 0, "{outcome:#}");
    for (topic, least) in [
        ("/thermal/update_request", 1),
        ("/thermal/model", 2),
        ("/blocks/measurement", 4),
    ] {
        let messages = count(&outcome, topic, "messages");
        eprintln!("{topic}: {messages} messages");
        assert!(messages >= least, "{topic}: {messages}");
    }
    resumes_at(run(), 31);
}

#[test]
fn replay_notices_one_nanosecond_of_the_last_cold_touch_in_what_is_asked_for() {
    // A request tells how long ago that touch was; no number of an input but a stamp comes into it.
    let later = |data: &mut Vec<u8>| {
        edited(data, |touch: &mut ProbeTrigger| {
            touch.header.stamp.nanosec += 1
        });
    };
    let bag = with_another(run(), ("/probe/trigger", COLD_TOUCHES - 1), later);
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    eprintln!("{:#}", outcome["first_difference"]);
    let topic = "/thermal/update_request";
    assert!(count(&outcome, topic, "differing") > 0, "{outcome:#}");
}
