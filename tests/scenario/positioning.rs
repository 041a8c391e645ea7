//! Positioning scenarios as a person runs them: a linear scale used by a table, and in the loop.

use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::scenario::Scenario;
use metrology::Axis;
use metrology::sample::TestKind;
use recorder::Bag;
use serde_json::Value;

use crate::recorded::{all, quantile, stops, tests};

/// The longest that a run and its evaluation may take on two cores.
const LIMIT: Duration = Duration::from_secs(120);
/// Rest after which a stop counts, s.
const REST_S: f64 = 0.4;

struct Run {
    report: Value,
    bag: Bag,
    /// Keeps the folder that the bag is in.
    _scenario: Scenario,
}

fn run(name: &str) -> Run {
    let began = Instant::now();
    let scenario = Scenario::copy_of(name);
    let run = scenario.run();
    let text = std::fs::read_to_string(run.join("report.json")).unwrap();
    let found = Run {
        report: serde_json::from_str(&text).unwrap(),
        bag: Bag::open(run.join("bag")).unwrap(),
        _scenario: scenario,
    };
    let took = began.elapsed();
    eprintln!("{name}: {:.1} s", took.as_secs_f64());
    assert!(took < LIMIT, "{took:?}");
    found
}

impl Run {
    /// p95 of the true tool error in each verification, by label, µm.
    fn true_p95_um(&self, label: &str) -> f64 {
        let all = self.report["verification"]["verifications"].as_array();
        let mut all = all.unwrap().iter();
        let found = all.find(|one| one["label"] == label);
        found.unwrap()["p95_mm"].as_f64().unwrap() * 1e3
    }

    /// p95 of scale minus command at the stops of each verification, in the order of the plan, µm.
    fn scale_p95_um(&self, axis: Axis) -> Vec<f64> {
        let segments = all(&self.bag, &topics::TEST_SEGMENT);
        let states = all(&self.bag, &topics::AXES_STATE);
        tests(&segments)
            .into_iter()
            .filter(|(begin, _)| begin.kind == TestKind::Verification)
            .map(|test| {
                let stops = stops(&states, test, REST_S);
                assert!(stops.len() > 20, "{}", stops.len());
                let off = |s: &&metrology::sample::AxisState| {
                    ((s.scale[axis] - s.commanded[axis]) * 1e3).abs()
                };
                quantile(stops.iter().map(off).collect(), 0.95)
            })
            .collect()
    }

    /// A figure of the first positioning test, µm.
    fn iso230_2_um(&self, figure: &str) -> f64 {
        let tests = self.report["tests"].as_array().unwrap();
        let mut found = tests.iter().filter_map(|test| test.get("iso230_2"));
        let value = &found.next().unwrap()[figure]["value_mm"];
        value.as_f64().unwrap() * 1e3
    }
}

#[test]
fn a_learned_table_takes_the_screw_out_of_a_semi_closed_axis_and_follows_its_growth() {
    let run = run("dual_loop");
    let p95_um = run.scale_p95_um(Axis::X);
    let [semi_cold, dual_cold, dual_warm, semi_warm] = p95_um[..] else {
        panic!("four verifications: {p95_um:?}");
    };
    let truths = [
        "semi-closed cold",
        "dual loop cold",
        "dual loop after 1 h",
        "semi-closed after 1 h",
    ];
    let truths = truths.map(|label| run.true_p95_um(label));
    eprintln!(
        "dual_loop: scale minus command p95 {p95_um:.2?} um, true tool error p95 {truths:.2?} um"
    );
    // The screw grew in that hour, or nothing is shown.
    assert!(semi_warm > 2.0 * semi_cold, "{p95_um:?}");
    assert!(dual_cold < 0.25 * semi_cold, "{p95_um:?}");
    assert!(dual_warm < 0.1 * semi_warm, "{p95_um:?}");
    // What no scale on X sees is in the true error as well.
    assert!(truths[1] < 0.75 * truths[0], "{truths:?}");
    assert!(truths[2] < 0.35 * truths[3], "{truths:?}");
}

#[test]
fn a_scale_in_the_loop_keeps_the_axis_where_it_is_warm_or_cold() {
    let run = run("full_closed");
    let p95_um = run.scale_p95_um(Axis::X);
    let truths = ["full-closed cold", "full-closed after 1 h"];
    let truths = truths.map(|label| run.true_p95_um(label));
    let (accuracy_um, reversal_um) = (run.iso230_2_um("accuracy"), run.iso230_2_um("reversal"));
    eprintln!(
        "full_closed: scale minus command p95 {p95_um:.2?} um, true tool error p95 {truths:.2?} um, A {accuracy_um:.2} um, B {reversal_um:.2} um"
    );
    // Its resolution is 0.05 µm.
    assert!(p95_um.iter().all(|p95| *p95 < 0.2), "{p95_um:?}");
    assert!(
        accuracy_um < 6.0 && reversal_um < 0.3,
        "{accuracy_um} {reversal_um}"
    );
    assert!(truths[1] < truths[0] + 4.0, "{truths:?}");
}
