//! A bag of `abbe run`, read by PyPI `rosbags` and `mcap-ros2-support`: every message, every value.

use std::fs::File;
use std::io::BufWriter;

use abbe_tests::python::{interpreter, script, succeeded};
use abbe_tests::scenario::{SHORT_PLAN, Scenario};
use recorder::{Bag, dump_json};

#[test]
fn every_message_of_a_run_is_read_alike_by_rosbags_and_mcap() {
    let Some(python) = interpreter("a run's bag is read by rosbags and mcap") else {
        return;
    };
    let scenario = Scenario::copy_of("first_run");
    scenario.write("plan.yaml", SHORT_PLAN);
    let bag = scenario.run().join("bag");
    let dumped = scenario.out().join("dump.jsonl");
    let mut out = BufWriter::new(File::create(&dumped).unwrap());
    assert_eq!(dump_json(&Bag::open(&bag).unwrap(), &mut out).unwrap(), []);
    drop(out);
    let output = script(&python, "read_bag.py")
        .args([&bag, &dumped])
        .output();
    let text = succeeded(&output.unwrap());
    eprint!("{text}");
    for topic in [
        "axes/state",
        "joint_states",
        "probe/trigger",
        "probe/point",
        "latency",
        "blocks/measurement",
        "thermal/model",
        "compensation",
        "test/segment",
        "sequencer/status",
        "temperature/spindle_front",
    ] {
        assert!(text.contains(&format!("/{topic} 1")), "{topic}: {text}");
    }
}
