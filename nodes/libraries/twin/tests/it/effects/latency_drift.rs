//! A latency that changes, against calibrations before and after.

use nalgebra::Vector3;
use twin::History;

use crate::effects::past::{predict, touch, touching};
use crate::effects::scene::bench;

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

/// A probe stamps its contact by its own clock, which is slow by 1e-6 and counts microseconds; the receiver acts on it a
/// fixed time after the stamp by its own. At half past the hour the two are set to each other again.
///
/// One part in a million is 3.6 ms an hour (86.4 ms a day).
#[test]
fn val_latency_drift_of_a_link_whose_clock_runs_off() {
    let (slow, fixed_s, feed, set_s) = (1e-6_f64, 5e-3, 8.0, 1800.0);
    let times = [10.0_f64, 900.0, 1790.0, 1810.0, 2700.0, 3600.0];
    let late_s = times.map(|contact_s| {
        let set_at_s = if contact_s > set_s { set_s } else { 0.0 };
        let counted = ((contact_s - set_at_s) * (1.0 + slow) * 1e6).floor() * 1e-6;
        set_at_s + counted + fixed_s - contact_s
    });
    let run = touching(
        times
            .map(|t| touch(t, [0.0; 3], -Vector3::z(), feed))
            .into(),
    );
    let given = [
        ("step_ms", -1.8),
        ("at_min", 30.0),
        ("free_rate_ms_per_h", 3.6),
    ];
    let travel = predict(&bench(), &History::default(), &run, ID, &given);
    for (late_s, travel_mm) in late_s.iter().zip(&travel) {
        let wanted_mm = feed * (late_s - fixed_s);
        println!("late {:.4} ms: {wanted_mm:.6} mm", late_s * 1e3);
        // Within its microsecond.
        assert!((travel_mm - wanted_mm).abs() < 1.1e-6 * feed, "{travel_mm}");
    }
}

#[test]
fn eq1_latency_drift_from_two_calibrations() {
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
