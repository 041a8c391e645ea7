//! Rotary axes that are found on a sphere, and compensated, are computed again.

use std::path::Path;
use std::sync::OnceLock;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::from_cdr;
use abbe_msgs::msg::{AxisState, ProbeTrigger};
use abbe_tests::program::root;
use abbe_tests::scenario::Scenario;
use recorder::{Bag, Event, Order};

use crate::contract::{Run, check, count, edited, recorded, with_another};
use crate::snapshot::resumes_at;

/// The shortened `five_axis` of which a bag is kept.
fn scenario() -> Scenario {
    let scenario = Scenario::copy_of("five_axis");
    let plan = std::fs::read_to_string(root().join("bags/rotary_sphere/plan.yaml")).unwrap();
    scenario.write("plan.yaml", &plan);
    scenario.append("fake_cnc.yaml", "    state_rate_hz: 100.0\n");
    let latency = "    latency_ms: 3.7\n    latency_standard_uncertainty_ms: 0.01\n";
    scenario.append(
        "probe.yaml",
        &format!("    longest_gap_ms: 20.0\n{latency}"),
    );
    scenario.replace("machine.yaml", "feed_mm_min: 120.0", "feed_mm_min: 480.0");
    scenario
}

/// The bag of its run.
pub fn run() -> &'static Path {
    static RUN: OnceLock<Run> = OnceLock::new();
    recorded(&RUN, scenario)
}

#[test]
fn replay_computes_spheres_rotary_axes_and_their_compensation_again() {
    let (code, outcome) = check(run());
    assert_eq!(code, 0, "{outcome:#}");
    // Six poses and two of the verification; the verification finds no axes.
    for (topic, least) in [
        ("/probe/point", 40),
        ("/probe/feature", 8),
        ("/geometry/rotary", 1),
        ("/compensation", 1_000),
    ] {
        let messages = count(&outcome, topic, "messages");
        eprintln!("{topic}: {messages} messages");
        assert!(messages >= least, "{topic}: {messages}");
    }
}

#[test]
fn replay_of_rotary_axes_resumes_while_poses_are_visited_and_while_they_are_compensated() {
    resumes_at(run(), 23);
}

/// A touch of the third pose.
const TOUCH: usize = 12;
/// How late the probe's signal is taken to be in that scenario, ns.
const LATENCY: i64 = 3_700_000;

/// Which state of the bag is the last one before the contact of [`TOUCH`]: what is computed of a touch whose latency is known
/// comes of the states around it, and not of what was latched.
pub fn at_contact(bag: &Path) -> usize {
    let bag = Bag::open(bag).unwrap();
    let nanos = |stamp: &Time| i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec);
    let mut messages = bag.messages(Order::File);
    let (mut states, mut touches) = (Vec::new(), Vec::new());
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}");
        };
        match bag.topic(message.topic).topic.as_str() {
            "/axes/state" => {
                let state: AxisState = from_cdr(message.data).unwrap();
                states.push(nanos(&state.controller_stamp));
            }
            "/probe/trigger" => {
                let touch: ProbeTrigger = from_cdr(message.data).unwrap();
                touches.push(nanos(&touch.controller_stamp));
            }
            _ => {}
        }
    }
    let contact = touches[TOUCH] - LATENCY;
    states.iter().rposition(|at| *at <= contact).unwrap()
}

/// Positions of the motors, changed by one unit in the last place.
pub fn positions_by_one_ulp(data: &mut Vec<u8>) {
    edited(data, |state: &mut AxisState| {
        for motor in &mut state.motor {
            *motor = motor.next_up();
        }
    });
}

#[test]
fn replay_notices_one_ulp_of_one_state_at_a_contact_up_to_the_compensated_rotary_axes() {
    let state = ("/axes/state", at_contact(run()));
    let bag = with_another(run(), state, positions_by_one_ulp);
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    eprintln!("{:#}", outcome["first_difference"]);
    assert_eq!(outcome["first_difference"]["topic"], "/probe/point");
    for topic in ["/probe/point", "/probe/feature", "/geometry/rotary"] {
        assert_eq!(
            count(&outcome, topic, "differing"),
            1,
            "{topic}: {outcome:#}"
        );
    }
    let differing = count(&outcome, "/compensation", "differing");
    assert!(differing > 0, "{outcome:#}");
}
