//! The dual loop's second reading, table and measurement at once, judged by another instrument than the scale it learned
//! from: the laser along X.

use abbe_tests::scenario::Scenario;
use serde_json::Value;

/// Laser, learning by the scale, laser, parts, laser.
const PLAN: &str = "\
title: a table and what the scale says at once, judged by the laser
steps:
  - {do: positioning, axis: X, from_mm: -280.0, to_mm: 280.0, spacing_mm: 40.0, runs: 5, dwell_s: 2.0, feed_mm_min: 6000.0, overrun_mm: 5.0, beam: along_x}
  - {do: positioning, axis: X, from_mm: -300.0, to_mm: 300.0, spacing_mm: 15.0, runs: 10, dwell_s: 1.0, feed_mm_min: 6000.0, overrun_mm: 5.0, at_mm: [0.0, 0.0, 120.0]}
  - {do: compensation, enable: true}
  - {do: wait, seconds: 5.0}
  - {do: positioning, axis: X, from_mm: -280.0, to_mm: 280.0, spacing_mm: 40.0, runs: 5, dwell_s: 4.0, feed_mm_min: 6000.0, overrun_mm: 5.0, beam: along_x}
  - {do: produce, program: production.ngc, minutes: 60.0, serve_updates: false}
  - {do: positioning, axis: X, from_mm: -280.0, to_mm: 280.0, spacing_mm: 40.0, runs: 5, dwell_s: 4.0, feed_mm_min: 6000.0, overrun_mm: 5.0, beam: along_x}
";
const REFRESHED: &str = "reading: refreshed_table, weight: 0.3, directions: apart, thermal_part: false, measured_limit_um: 200.0, \
     steady_s: 0.3, unpassed_follow: true";
const WEIGHTED: &str = "reading: weighted_increments, weight: 0.3, directions: apart, thermal_part: false, measured_limit_um: 200.0, \
     loop_cycle_s: 0.2, loop_delay_cycles: 1";

/// A figure of each positioning test by the laser, in the order of the plan, µm.
fn by_laser_um(report: &Value, figure: &str) -> Vec<f64> {
    let tests = report["tests"].as_array().unwrap().iter();
    let by_laser = tests.filter(|test| {
        let title = test["test"].as_str().unwrap_or_default();
        test.get("iso230_2").is_some() && title.contains("along_x")
    });
    by_laser
        .map(|test| test["iso230_2"][figure]["value_mm"].as_f64().unwrap() * 1e3)
        .collect()
}

#[test]
fn weighted_increments_take_screw_and_play_out_as_the_laser_sees_it_cold_and_warm() {
    let scenario = Scenario::copy_of("dual_loop");
    scenario.write("plan.yaml", PLAN);
    scenario.replace("axis_compensation.yaml", REFRESHED, WEIGHTED);
    let report = scenario.run_for_report();
    let figures =
        ["accuracy", "systematic_error", "reversal"].map(|figure| by_laser_um(&report, figure));
    eprintln!("weighted_increments, by the laser: A, E, B {figures:.2?} um");
    let [accuracy, systematic, reversal] = &figures;
    assert_eq!(accuracy.len(), 3, "{figures:?}");
    // The plant's screw has 2.5 µm of play besides its windup, and 16 µm of lead error: the laser sees both without help.
    assert!(systematic[0] > 10.0 && reversal[0] > 2.5, "{figures:?}");
    for after in [1, 2] {
        // The scale's own error and what lies between scale and tool stay: it learned from the scale.
        assert!(accuracy[after] < 0.5 * accuracy[0], "{figures:?}");
        assert!(systematic[after] < 0.4 * systematic[0], "{figures:?}");
        assert!(reversal[after] < 0.2 * reversal[0], "{figures:?}");
    }
}
