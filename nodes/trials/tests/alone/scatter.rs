//! Effects of scatter that the plant has dice for.

use fake_cnc::plant::VibrationEntry;

use crate::judge::{leads, names_nothing, told};
use crate::rigs::{repeating, with_circles};

/// Triggers that come by 0.4 ms earlier or later: 720 touches at a very slow and a quick feed show them with a D of 25.
#[test]
fn a_link_that_jitters_is_jitter_or_two_modes() {
    let faces = [
        "latency, feature: block_1.x, feeds_mm_min: [30.0, 960.0], repeats: 12",
        "latency, feature: block_1.y, feeds_mm_min: [30.0, 960.0], repeats: 12",
    ];
    let mut rig = repeating(&faces, 15);
    rig.plant.touch_probe.jitter_ms = 0.4;
    let report = told(&[&rig]);
    let jitter_ms = leads(&report, ("latency_jitter", ""), &["latency_modes"], 20.0);
    assert!((jitter_ms - 0.4).abs() < 0.1, "{jitter_ms}");
}

/// Seven times the scatter of a good probe, alike in all directions and at all feeds.
#[test]
fn a_probe_that_repeats_badly_is_noise_and_no_cause() {
    let faces = [
        "latency, feature: block_1.x, feeds_mm_min: [60.0, 240.0], repeats: 12",
        "latency, feature: block_1.z, feeds_mm_min: [60.0, 240.0], repeats: 12",
    ];
    let mut rig = repeating(&faces, 8);
    rig.plant.touch_probe.repeatability_um = 2.0;
    names_nothing(&told(&[&rig]), "probe_repeatability");
}

/// A foundation that shakes the tool whatever the axes do.
#[test]
fn a_tool_that_shakes_in_every_run_alike_is_noise_and_no_cause() {
    let mut rig = with_circles();
    rig.plant.vibration = Some(VibrationEntry {
        amplitude_um: [1.0, 0.0, 0.0],
        frequency_hz: 43.0,
        wander_hz: 2.0,
        wander_time_s: 1.0,
    });
    names_nothing(&told(&[&rig]), "vibration_random");
}
