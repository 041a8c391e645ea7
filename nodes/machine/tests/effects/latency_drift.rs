//! A latency that changes, against calibrations before and after.

use machine::twin::History;
use nalgebra::Vector3;

use crate::past::{predict, touch, touching};
use crate::scene::bench;

const ID: (&str, &str) = ("latency_drift", "");

/// The two-feed latency of touches at an instant, s.
fn calibrated_s(at_s: f64, given: &[(&str, f64)]) -> f64 {
    let feeds = [2.0, 14.0];
    let run = touching(
        feeds
            .map(|f| touch(at_s, [0.0; 3], -Vector3::z(), f))
            .into(),
    );
    let travel = predict(&bench(), &History::default(), &run, ID, given);
    (travel[1] - travel[0]) / (feeds[1] - feeds[0])
}

#[test]
fn val_latency_drift_from_two_calibrations() {
    let given = [("step_ms", 0.4), ("at_min", 30.0)];
    assert!(calibrated_s(1799.0, &given).abs() < 1e-15);
    assert!((calibrated_s(1801.0, &given) - 0.4e-3).abs() < 1e-12);
}

#[test]
fn eq2_a_drift_of_half_a_millisecond_an_hour_is_one_in_two_hours() {
    let given = [
        ("step_ms", 0.0),
        ("at_min", 0.0),
        ("free_rate_ms_per_h", 0.5),
    ];
    assert!((calibrated_s(7200.0, &given) - 1e-3).abs() < 1e-12);
}
