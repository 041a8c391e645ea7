//! What is measured: circles in three planes, positioning runs, touches; in a drawn order, under drawn conditions.
//!
//! One circle in XY is run three times in both senses, spread over the session; circles of another radius and another
//! feed are run once, so that a diagnosis can hold conditions out. Every other plane has two repeats and one other
//! feed, every axis three positioning runs, every touched face two touches at each of three feeds.

use std::fmt::Write as _;

use machine::MachineFile;
use metrology::Axis;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use sequencer::Plan;

use crate::error::TrialError;

/// Targets of a positioning run.
const TARGETS: f64 = 9.0;
/// Way from a beam's end to the first target, mm.
pub(crate) const BEAM_MARGIN_MM: f64 = 20.0;

/// Radii and feeds of the circles, the repeated ones first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    pub radius_mm: [f64; 2],
    pub feed_mm_min: [f64; 2],
}

impl Conditions {
    pub(crate) fn draw(random: &mut Pcg64Mcg) -> Self {
        let mut whole =
            |low: f64, high: f64, step: f64| (random.random_range(low..high) / step).round() * step;
        Self {
            radius_mm: [whole(70.0, 95.0, 1.0), whole(30.0, 45.0, 1.0)],
            feed_mm_min: [whole(3000.0, 4000.0, 100.0), whole(6000.0, 9000.0, 100.0)],
        }
    }
}

/// Draws the order and writes the plan.
pub(crate) fn plan(
    random: &mut Pcg64Mcg,
    machine: &MachineFile,
    conditions: &Conditions,
) -> Result<Plan, TrialError> {
    let [large, small] = conditions.radius_mm;
    let [slow, fast] = conditions.feed_mm_min;
    let mut once = [(small, slow), (large, fast), (small, fast)];
    once.shuffle(random);
    // The repeats stand between the others: first, in the middle, last.
    let mut parts = vec![vec![
        circle("middle", large, slow),
        circle("middle", once[0].0, once[0].1),
        circle("middle", large, slow),
        circle("middle", once[1].0, once[1].1),
        circle("middle", once[2].0, once[2].1),
        circle("middle", large, slow),
    ]];
    for placement in ["side", "front"] {
        parts.push(vec![
            circle(placement, large, slow),
            circle(placement, large, fast),
            circle(placement, large, slow),
        ]);
    }
    let beams = machine
        .length_reference
        .iter()
        .flat_map(|length| &length.beams);
    for (axis, beam) in Axis::LINEAR.into_iter().zip(beams) {
        let ends = [beam.from_mm[axis.index()], beam.to_mm[axis.index()]];
        parts.push(vec![positioning(axis, &beam.id, ends)]);
    }
    let faces = ["block_1.x", "block_1.y", "block_1.z", "block_2.x"];
    parts.push(faces.map(touches).to_vec());
    parts.shuffle(random);
    let mut text = "title: a blind trial\nsteps:\n".to_owned();
    for step in parts.iter().flatten() {
        let _ = writeln!(text, "  - {step}");
    }
    Plan::from_yaml(&text).map_err(|source| TrialError::ProgrammeText { source })
}

pub(crate) fn circle(placement: &str, radius_mm: f64, feed_mm_min: f64) -> String {
    format!(
        "{{do: grid, placement: {placement}, trajectory: circle, radius_mm: {radius_mm:.1}, \
         feed_mm_min: {feed_mm_min:.1}, sense: both, on_the_fly: true}}"
    )
}

fn positioning(axis: Axis, beam: &str, [low, high]: [f64; 2]) -> String {
    let (from_mm, to_mm) = (low + BEAM_MARGIN_MM, high - BEAM_MARGIN_MM);
    let spacing_mm = (to_mm - from_mm) / (TARGETS - 1.0);
    format!(
        "{{do: positioning, axis: {axis}, from_mm: {from_mm:.1}, to_mm: {to_mm:.1}, \
         spacing_mm: {spacing_mm:.1}, runs: 3, dwell_s: 0.5, feed_mm_min: 12000.0, \
         overrun_mm: 5.0, beam: {beam}}}"
    )
}

fn touches(feature: &str) -> String {
    format!("{{do: latency, feature: {feature}, feeds_mm_min: [100.0, 250.0, 500.0], repeats: 2}}")
}
