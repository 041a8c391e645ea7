//! A positioning table that is learned and refreshed is computed again.

use std::path::Path;
use std::sync::OnceLock;

use abbe_msgs::from_cdr;
use abbe_msgs::msg::AxisState;
use abbe_tests::program::root;
use abbe_tests::scenario::Scenario;
use recorder::{Bag, Event, Order};

use crate::contract::{Run, check, count, edited, recorded, with_another};
use crate::snapshot::resumes_at;

/// The shortened `dual_loop` of which a bag is kept.
fn scenario() -> Scenario {
    let scenario = Scenario::copy_of("dual_loop");
    for file in ["plan.yaml", "refresh.ngc"] {
        let kept = root().join("bags/dual_loop").join(file);
        scenario.write(file, &std::fs::read_to_string(kept).unwrap());
    }
    let dwell = "unpassed_follow: true, settle_s: 0.04, dwell_s: 0.04";
    scenario.replace("axis_compensation.yaml", "unpassed_follow: true", dwell);
    scenario
}

/// Where X dwells first, m.
const FIRST_TARGET_M: f64 = -0.024;
/// States behind the first of a dwell: it has settled, and goes on.
const SETTLED: usize = 4;

/// The bag of its run.
pub fn run() -> &'static Path {
    static RUN: OnceLock<Run> = OnceLock::new();
    recorded(&RUN, scenario)
}

#[test]
fn replay_computes_a_table_that_is_learned_and_refreshed_again() {
    let (code, outcome) = check(run());
    assert_eq!(code, 0, "{outcome:#}");
    // Learned once; five points are passed in both directions.
    for (topic, least) in [("/positioning/table", 10), ("/compensation", 1_000)] {
        let messages = count(&outcome, topic, "messages");
        eprintln!("{topic}: {messages} messages");
        assert!(messages >= least, "{topic}: {messages}");
    }
}

#[test]
fn replay_of_a_table_resumes_while_it_is_learned_and_while_it_is_refreshed() {
    resumes_at(run(), 41);
}

/// Which state of the bag is the last one that is averaged in the first dwell at the first target.
pub fn averaged(bag: &Path) -> usize {
    let bag = Bag::open(bag).unwrap();
    let mut messages = bag.messages(Order::File);
    let mut commanded_m = Vec::new();
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}");
        };
        if bag.topic(message.topic).topic == "/axes/state" {
            let state: AxisState = from_cdr(message.data).unwrap();
            commanded_m.push(state.commanded[0]);
        }
    }
    let is_there = |commanded_m: &f64| (commanded_m - FIRST_TARGET_M).abs() < 1e-9;
    let mut windows = commanded_m.windows(SETTLED + 1);
    let dwell = windows.position(|window| window.iter().all(is_there));
    let from = dwell.unwrap();
    let stays = commanded_m[from..].iter().take_while(|m| is_there(m));
    from + stays.count() - 1
}

/// A reading of X's scale, changed by a picometre: tables are kept in whole femtometres, and an ulp of one reading in a mean of
/// dozens is less than one.
pub fn scale_by_a_picometre(data: &mut Vec<u8>) {
    edited(data, |state: &mut AxisState| state.scale[0] += 1e-12);
}

#[test]
fn replay_notices_a_picometre_of_one_reading_of_the_scale_in_the_table() {
    let state = ("/axes/state", averaged(run()));
    let bag = with_another(run(), state, scale_by_a_picometre);
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    let first = &outcome["first_difference"];
    eprintln!("{first:#}");
    assert_eq!(first["topic"], "/positioning/table");
    assert_eq!(first["discrepancy"]["kind"], "field");
    // What is refreshed goes on from what was learned.
    assert!(
        count(&outcome, "/positioning/table", "differing") > 5,
        "{outcome:#}"
    );
}
