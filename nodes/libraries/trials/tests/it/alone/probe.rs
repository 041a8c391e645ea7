//! Effects of the touch probe: its seat, its stylus, its link.

use sequencer::Step;

use crate::alone::judge::{is_named, is_named_with, told};
use crate::alone::rigs::{repeating, with_artefacts, with_circles};

/// Three supports under a heavy spring, felt all round a ring gauge; centre and radius of the ring float.
#[test]
fn a_seat_of_three_supports_is_lobing() {
    let mut rig = with_artefacts(repeating(&["artefact, id: ring, points: 24"], 10));
    rig.plant.touch_probe.spring_force_n = 4.0;
    is_named(&told(&[&rig]), "probe_lobing", "");
}

/// A long stylus on the same seat, felt all over a sphere: it bends when it is pushed sideways and not when it is pushed
/// up. The seat of the plant lobes besides, and that is to be named as well.
#[test]
fn a_stylus_that_bends_is_pretravel() {
    let mut rig = with_artefacts(with_circles());
    let is_kept = |step: &Step| matches!(step, Step::Latency { .. } | Step::Positioning(_));
    rig.plan.steps.retain(is_kept);
    let ball = Step::Artefact {
        id: "ball".to_owned(),
        points: 25,
    };
    rig.plan.steps.extend(std::iter::repeat_n(ball, 12));
    rig.plant.touch_probe.spring_force_n = 3.0;
    rig.plant.touch_probe.stylus_length_mm = 80.0;
    is_named_with(&told(&[&rig]), "probe_pretravel", "", &["probe_lobing"]);
}

const TOUCHES: [&str; 2] = [
    "latency, feature: block_1.x, feeds_mm_min: [60.0, 240.0, 480.0], repeats: 4",
    "latency, feature: block_1.z, feeds_mm_min: [60.0, 240.0, 480.0], repeats: 4",
];

/// The link of the probe goes over to a mode that is 1 ms slower, between two bags of one machine.
#[test]
fn a_link_that_changes_its_mode_is_a_drift_of_the_latency() {
    let rig = repeating(&TOUCHES, 4);
    let mut later = rig.later(rig.plan.clone());
    later.plant.touch_probe.latency_ms += 1.0;
    let step_ms = is_named(&told(&[&rig, &later]), "latency_drift", "");
    assert!((step_ms - 1.0).abs() < 0.1, "{step_ms}");
}
