//! Effects of scatter that the plant has dice for.

use fake_cnc::plant::VibrationEntry;
use metrology::Axis;

use crate::alone::judge::{is_named_with, leads, names_nothing, told};
use crate::alone::rigs::{repeating, with_circles};

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

/// A foundation that shakes the tool whatever the axes do: part of the noise floor, by its frequency.
#[test]
fn a_tool_that_shakes_in_every_run_alike_is_noise_and_no_cause() {
    let mut rig = with_circles();
    rig.plant.vibration = Some(VibrationEntry {
        amplitude_um: [1.0, 0.0, 0.0],
        frequency_hz: 43.0,
        wander_hz: 2.0,
        wander_time_s: 1.0,
    });
    let report = told(&[&rig]);
    names_nothing(&report, "vibration_random");
    let floor = report.noise_floor.iter();
    let seen: Vec<_> = floor.flat_map(|floor| &floor.vibrations).collect();
    // The plate is read 83 times a second: 43 Hz is seen as 40 Hz.
    let is_it = |hz: f64| (hz - 43.0).abs() < 1.5;
    let all = seen
        .iter()
        .all(|own| is_it(own.sampled_hz - own.frequency_hz));
    assert!(all && seen.len() == 2, "{seen:#?}");
    let planes: Vec<&str> = seen.iter().map(|own| own.plane.as_str()).collect();
    assert_eq!(planes, ["XY", "ZX"]);
}

/// A slide on plain guides that breaks away at five times the force at which it slides, on arcs that it runs through without
/// turning. That friction is lost motion that goes with the feed as well.
#[test]
fn a_slide_that_jumps_at_slow_feeds_sticks_and_slips() {
    let arcs = [(3.0, 60.0), (4.0, 60.0), (4.0, 90.0), (3.0, 60.0)].map(|(radius_mm, feed_mm_min)| {
        format!(
            "grid, placement: middle, trajectory: arc, radius_mm: {radius_mm:.1}, from_deg: 5.0, swept_deg: 80.0, \
             feed_mm_min: {feed_mm_min:.1}, sense: both, on_the_fly: true, repeats: 2"
        )
    });
    let mut rig = repeating(&arcs.each_ref().map(String::as_str), 1);
    let drive = rig.plant.linear_drives.get_mut(&Axis::X).unwrap();
    drive.guide_friction.breakaway_n = 1500.0;
    drive.guide_friction.coulomb_n = 300.0;
    drive.guide_friction.stribeck_velocity_mm_s = 0.3;
    drive.guide_friction.presliding_um = 4.0;
    let report = told(&[&rig]);
    is_named_with(&report, "stick_slip", "X", &["feed_lost_motion"]);
    let causes = report.causes.iter();
    let own = causes.filter(|cause| cause.effect == "stick_slip");
    let parameters: Vec<_> = own.flat_map(|cause| &cause.parameters).collect();
    let value = |name: &str| parameters.iter().find(|p| p.name == name).unwrap().value;
    // Readings of the slow part scatter by 2.8 to 3.0 um, up to 0.69 mm/s on the way up and from 0.51 mm/s on the way down.
    assert!((value("free_even_um") - 12.0_f64.sqrt() * 2.9).abs() < 0.7);
    assert!((0.6..0.8).contains(&value("critical_mm_s")));
    assert!((0.15..0.45).contains(&value("free_hysteresis")));
}
