//! Positioning scenarios as a person runs them: a linear scale used by a table, and in the loop.

use std::path::PathBuf;
use std::time::Instant;

use abbe_msgs::topics;
use abbe_tests::foreseen::Foreseen;
use abbe_tests::scenario::Scenario;
use metrology::Axis;
use metrology::sample::TestKind;
use recorder::Bag;
use serde_json::Value;

use crate::recorded::{all, quantile, stops, tests};

/// Rest after which a stop counts, s.
const REST_S: f64 = 0.4;

struct Run {
    report: Value,
    bag: Bag,
    folder: PathBuf,
    /// Keeps the folder that the bag is in.
    scenario: Scenario,
}

/// Runs a scenario as it is shipped, which its preflight must have foreseen.
fn run(name: &str) -> Run {
    let scenario = Scenario::copy_of(name);
    let foreseen = Foreseen::begin(&scenario.folder());
    let run = run_of(name, scenario);
    foreseen.agrees(&run.scenario.folder(), &run.folder);
    run
}

fn run_of(name: &str, scenario: Scenario) -> Run {
    let began = Instant::now();
    let run = scenario.run();
    let text = std::fs::read_to_string(run.join("report.json")).unwrap();
    let found = Run {
        report: serde_json::from_str(&text).unwrap(),
        bag: Bag::open(run.join("bag")).unwrap(),
        folder: run,
        scenario,
    };
    let took = began.elapsed();
    eprintln!("{name}: {:.1} s", took.as_secs_f64());
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

    /// The positioning tests of the page, each checked to be the laser's and at 20 °C by the thermometers of `sources`.
    fn by_laser(&self, sources: &[&str]) -> Vec<&Value> {
        let tests = self.report["tests"].as_array().unwrap();
        let found: Vec<&Value> = tests
            .iter()
            .filter(|test| test.get("iso230_2").is_some())
            .collect();
        assert_eq!(found.len(), sources.len());
        for (test, source) in found.iter().zip(sources) {
            let title = test["test"].as_str().unwrap();
            assert!(title.ends_with("by the length reference"), "{title}");
            assert!(
                test["label"].is_null() && test["no_verdict"].is_null(),
                "{test:#}"
            );
            let correction = &test["correction_to_20_degc"];
            assert_eq!(correction["done"], true, "{correction:#}");
            assert_eq!(correction["machine"]["source"], *source);
        }
        found
    }
}

/// A figure of a positioning test, µm.
fn iso230_2_um(test: &Value, figure: &str) -> f64 {
    let value = &test["iso230_2"][figure]["value_mm"];
    value.as_f64().unwrap() * 1e3
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
    // What no part of the machine reads: the laser, without and with the table, and with it on the warm machine.
    // The screw carries what the motor leads, the scale on the bed what its table compensates.
    let by_laser = run.by_laser(&["read by nut_x", "read by bed", "read by bed"]);
    let accuracy_um: Vec<f64> =
        (by_laser.iter().map(|test| iso230_2_um(test, "accuracy"))).collect();
    eprintln!("dual_loop: A by the laser {accuracy_um:.2?} um");
    let [semi_cold, dual_cold, dual_warm] = accuracy_um[..] else {
        panic!("three tests by the laser: {accuracy_um:?}");
    };
    // At 20 °C of the screw, the first has no growth of the screw but that of its ten runs; in the last, the screw cools behind
    // a table that is not refreshed meanwhile.
    assert!(dual_cold < 0.5 * semi_cold, "{accuracy_um:?}");
    assert!(dual_warm < 1.3 * semi_cold, "{accuracy_um:?}");
    let conditions = &run.report["conditions"];
    assert_eq!(conditions["instruments"][0]["kind"], "length_reference");
    let thermometers = conditions["thermometers"].as_array().unwrap();
    assert_eq!(thermometers.len(), 7, "{conditions:#}");
}

#[test]
fn a_scale_in_the_loop_keeps_the_axis_where_it_is_warm_or_cold() {
    let run = run("full_closed");
    let p95_um = run.scale_p95_um(Axis::X);
    let truths = ["full-closed cold", "full-closed after 1 h"];
    let truths = truths.map(|label| run.true_p95_um(label));
    let by_laser = run.by_laser(&["read by bed", "read by bed"]);
    let [cold, warm] = by_laser[..] else {
        panic!("two tests by the laser: {by_laser:#?}");
    };
    let (accuracy_um, reversal_um) = (iso230_2_um(cold, "accuracy"), iso230_2_um(cold, "reversal"));
    let warm_um = iso230_2_um(warm, "accuracy");
    eprintln!(
        "full_closed: scale minus command p95 {p95_um:.2?} um, true tool error p95 {truths:.2?} um, A {accuracy_um:.2} um (warm {warm_um:.2} um), B {reversal_um:.2} um"
    );
    // Its resolution is 0.05 µm.
    assert!(p95_um.iter().all(|p95| *p95 < 0.2), "{p95_um:?}");
    assert!(
        accuracy_um < 6.0 && reversal_um < 0.3 && warm_um < 6.0,
        "{accuracy_um} {reversal_um} {warm_um}"
    );
    assert!(truths[1] < truths[0] + 4.0, "{truths:?}");
    for (figure, scatters) in [("systematic_error", 0.0), ("accuracy", 2.0)] {
        let least_um = least_uncertainty_um(cold, scatters);
        let stated = &cold["iso230_2"][figure]["expanded_uncertainty_mm"];
        let stated_um = stated.as_f64().unwrap() * 1e3;
        assert!(
            (least_um..1.1 * least_um).contains(&stated_um),
            "{figure}: {stated_um} {least_um}"
        );
    }
    for figure in ["repeatability", "reversal"] {
        let stated = &cold["iso230_2"][figure]["expanded_uncertainty_mm"];
        assert!(stated.as_f64().unwrap() > 0.0, "{figure}: {stated}");
    }
    let instrument = &run.report["conditions"]["instruments"][0];
    let certificate = instrument["certificate"].as_str().unwrap();
    assert!(
        certificate.ends_with("U = 0.1 um + 0.5 um/m, k = 2"),
        "{instrument}"
    );
}

/// U of E (no scatter) or A (two standard deviations) of `full_closed` by hand, without the share of its thermometer's changes, µm.
fn least_uncertainty_um(test: &Value, scatters: f64) -> f64 {
    let (mut high, mut low) = ((0.0, f64::MIN), (0.0, f64::MAX));
    for point in test["iso230_2"]["points"].as_array().unwrap() {
        let at_m = point["target_mm"].as_f64().unwrap() * 1e-3;
        for side in ["up", "down"] {
            let of = |key: &str| point[side][key].as_f64().unwrap();
            let around = scatters * of("standard_deviation_mm");
            if of("mean_mm") + around > high.1 {
                high = (at_m, of("mean_mm") + around);
            }
            if of("mean_mm") - around < low.1 {
                low = (at_m, of("mean_mm") - around);
            }
        }
    }
    let apart_m: f64 = high.0 - low.0;
    let apart_m = apart_m.abs();
    // k = 1: certificate 0.1 µm + 0.5 µm/m over 2; bed 8 µm/(m K) · 0.5 K over the root of 3, and 0.5 µm/(m K) by its deviation,
    // which is small; drift of 0.3 µm over twice the root of 3, in two means of five; for A also in twice the standard deviation
    // of both ends, by the root of n - 1 (first order; what drift adds to a standard deviation is above this least).
    let certificate_um = (0.1 + 0.5 * apart_m) / 2.0;
    let bed_um = 8.0 * 0.5 * apart_m / 3.0_f64.sqrt();
    let runs = test["iso230_2"]["n_runs"].as_f64().unwrap();
    let of_ends = 2.0 * scatters * scatters / (runs - 1.0);
    let drift_um = 0.3 / 12.0_f64.sqrt() * (of_ends + 2.0 / runs).sqrt();
    2.0 * certificate_um.hypot(bed_um).hypot(drift_um)
}

/// The first step of `full_closed` alone, in a shop of this temperature; with the budget or without it.
fn in_a_shop_of(degc: &str, with_budget: bool) -> Run {
    let scenario = Scenario::copy_of("full_closed");
    let start = format!("start_temp_degc: {degc}");
    scenario.replace("plant.yaml", "start_temp_degc: 20.0", &start);
    let plan = std::fs::read_to_string(scenario.path("plan.yaml")).unwrap();
    let first: Vec<&str> = plan.lines().take(3).collect();
    scenario.write("plan.yaml", &(first.join("\n") + "\n"));
    if !with_budget {
        std::fs::remove_file(scenario.path("budget.yaml")).unwrap();
    }
    run_of("full_closed", scenario)
}

#[test]
fn an_axis_in_a_shop_of_23_degc_has_the_figures_that_it_has_at_20_degc() {
    let figure = |run: &Run| {
        let tests = run.report["tests"].as_array().unwrap();
        let test = tests
            .iter()
            .find(|test| test.get("iso230_2").is_some())
            .unwrap()
            .clone();
        (iso230_2_um(&test, "systematic_error"), test)
    };
    let (cold_um, _) = figure(&in_a_shop_of("20.0", true));
    let (warm_um, warm) = figure(&in_a_shop_of("23.0", true));
    let (as_read_um, as_read) = figure(&in_a_shop_of("23.0", false));
    eprintln!(
        "E at 20 °C {cold_um:.2} um; at 23 °C {warm_um:.2} um corrected, {as_read_um:.2} um as read"
    );
    // The plant's scale grows by 8 µm/(m K), over 600 mm and 3 K by 14.4 µm; its own slope is the other way.
    assert!(as_read_um > cold_um + 6.0);
    let stated = &warm["iso230_2"]["systematic_error"]["expanded_uncertainty_mm"];
    let stated_um = stated.as_f64().unwrap() * 1e3;
    assert!((warm_um - cold_um).abs() < stated_um, "{stated_um}");
    let machine = &warm["correction_to_20_degc"]["machine"];
    assert!(
        (machine["temperature_degc"].as_f64().unwrap() - 23.0).abs() < 0.5,
        "{machine:#}"
    );
    assert_eq!(as_read["correction_to_20_degc"]["done"], false);
    let why = as_read["no_verdict"].as_str().unwrap();
    assert!(
        why.starts_with("not corrected to 20 °C: no budget was given"),
        "{why}"
    );
}
