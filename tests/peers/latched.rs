//! What is latched reaches who comes late, and what is not does not.

use std::time::Duration;

use abbe_msgs::topics;
use abbe_tests::cyclone::{Cyclone, end, named_end};
use abbe_tests::program::{Process, domain};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use serde_json::{Value, json};

use crate::wire::{now, stamp};

/// Corners of first_run's blocks, m.
const BLOCKS: [(&str, [f64; 3]); 2] = [
    ("block_1", [-0.22, -0.18, 0.02]),
    ("block_2", [0.22, 0.18, 0.2]),
];

/// Both blocks, displaced.
fn cycle(cyclone: &mut Cyclone, run: u32, shift_m: f64) {
    for (id, corner) in BLOCKS {
        let at = stamp(now());
        let message = json!({
            "header": {"stamp": at}, "block_id": id, "cold": run == 1, "run": run,
            "position_m": corner.map(|place| place + shift_m),
            "standard_uncertainty_m": [3e-7, 3e-7, 3e-7], "touched": [at, at, at],
        });
        cyclone.write(topics::BLOCKS_MEASUREMENT.name, &message);
    }
}

#[test]
fn a_late_joiner_gets_the_last_latched_state_and_a_volatile_one_nothing() {
    let Some(python) = interpreter("a late joiner gets the last latched state") else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("first_run"), domain(2));
    let file = scenario.argument("thermal_model.yaml");
    // Cycles milliseconds apart have no rate of drift to bring their faces to one instant with.
    let still = "cycle.align_faces:=false";
    let arguments = ["--params-file", &file, "-p", still];
    let node = Process::node(domain, "thermal_model", &arguments);
    let topic = topics::THERMAL_MODEL.name;
    let mut early = Cyclone::start(
        &python,
        domain,
        &[end(&topics::THERMAL_MODEL)],
        &[end(&topics::BLOCKS_MEASUREMENT)],
    );
    early.matched_after_s(topics::BLOCKS_MEASUREMENT.name);
    early.matched_after_s(topic);
    // The first sample right after a match may be lost by the peer's side of the match.
    std::thread::sleep(Duration::from_millis(500));
    let mut models = Vec::new();
    for run in 1..=3_u32 {
        cycle(&mut early, run, f64::from(run - 1) * 1e-6);
        models.push(early.sample(topic, |model| model["sequence"] == run));
    }
    let shift_m: Vec<f64> = models.iter().map(|m| k0_m(m, "X")).collect();
    for (found, sent) in shift_m.iter().zip([0.0, 1e-6, 2e-6]) {
        assert!((found - sent).abs() < 1e-12, "{shift_m:?}");
    }
    let mut late = Cyclone::start(&python, domain, &[end(&topics::THERMAL_MODEL)], &[]);
    let after_s = late.matched_after_s(topic);
    assert!(after_s < 3.0, "discovered after {after_s} s");
    let got = late.samples_within(topic, Duration::from_secs(2));
    eprintln!(
        "late joiner: discovered after {after_s:.3} s, {} states",
        got.len()
    );
    assert_eq!(got.last(), models.last(), "{} states came", got.len());
    let volatile = named_end::<abbe_msgs::msg::ThermalModel>(topic, true, false, 1);
    let mut deaf = Cyclone::start(&python, domain, &[volatile], &[]);
    deaf.matched_after_s(topic);
    let got = deaf.samples_within(topic, Duration::from_secs(2));
    assert_eq!(
        got,
        Vec::<Value>::new(),
        "what was said before is not for it"
    );
    for cyclone in [early, late, deaf] {
        cyclone.stop();
    }
    node.stop();
}

fn k0_m(model: &Value, axis: &str) -> f64 {
    let axes = model["axes"].as_array().unwrap();
    let drift = axes.iter().find(|drift| drift["axis"] == axis).unwrap();
    drift["k0_m"].as_f64().unwrap()
}
