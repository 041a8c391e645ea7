//! Latency against the two-feed rule.

use nalgebra::Vector3;
use twin::History;

use crate::effects::past::{predict, touch, touching};
use crate::effects::scene::bench;

const ID: (&str, &str) = ("probe_latency", "");

#[test]
fn val_probe_latency_8_3_um_per_ms() {
    let machine = bench();
    let run = touching(vec![touch(0.0, [0.0; 3], Vector3::x(), 500.0 / 60.0)]);
    let seen = predict(
        &machine,
        &History::default(),
        &run,
        ID,
        &[("latency_ms", 1.0)],
    );
    assert!((seen[0] - 8.33e-3).abs() < 5e-6, "{seen:?}");
}

#[test]
fn val_probe_latency_two_feeds() {
    let machine = bench();
    let n = Vector3::new(0.6, 0.0, -0.8);
    let feeds = [100.0 / 60.0, 900.0 / 60.0];
    let run = touching(feeds.map(|f| touch(0.0, [5.0, 2.0, 1.0], n, f)).into());
    let given = [("latency_ms", 3.7)];
    let travel = predict(&machine, &History::default(), &run, ID, &given);
    let latched = [0, 1].map(|k| Vector3::new(5.0, 2.0, 1.0) + n * travel[k]);
    let found_s = (latched[0] - latched[1]).norm() / (feeds[1] - feeds[0]);
    assert!((found_s - 3.7e-3).abs() < 1e-12, "{found_s}");
}

#[test]
fn eq2_an_axis_that_still_accelerates_goes_with_the_square_of_its_feed() {
    let machine = bench();
    // Contact at v, then 100 mm/s2 more during T: v T + a T2 / 2; with v2 = 2 a s and s = 0.5 mm the second part is
    // (T2 / (4 s)) v2.
    let latency_s = 4e-3;
    let feed = f64::sqrt(2.0 * 100.0 * 0.5);
    let way_mm = feed * latency_s + 0.5 * 100.0 * latency_s * latency_s;
    let at_1_m_min_um = latency_s * latency_s / (4.0 * 0.5) * (1000.0_f64 / 60.0).powi(2) * 1e3;
    let run = touching(vec![touch(0.0, [0.0; 3], Vector3::x(), feed)]);
    let given = [("latency_ms", 4.0), ("free_square_um", at_1_m_min_um)];
    let seen = predict(&machine, &History::default(), &run, ID, &given)[0];
    assert!((seen - way_mm).abs() < 1e-12, "{seen} {way_mm}");
}
