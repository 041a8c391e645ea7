//! Cyclic error: repeats with the lead of the screw or the period of the scale, at the same places of the axis.
//!
//! ```text
//!   e_a = a sin(2π x_a/p + ψ) = a cos ψ sin(2π x_a/p) + a sin ψ cos(2π x_a/p)      (1)
//! ```
//!
//! x_a is the axis position, so that ψ holds at every centre.

use std::f64::consts::TAU;

use super::scene::{Point, Scene};
use super::term::Quadrature;

/// Samples that the shortest period must have where the axis is fastest.
const SAMPLES_PER_PERIOD: f64 = 4.0;

/// One part of (1) seen along the radius.
pub(super) fn cyclic(axis: usize, pitch_mm: f64, part: Quadrature, point: &Point) -> f64 {
    let phase = TAU * point.position_mm[axis] / pitch_mm;
    let wave = match part {
        Quadrature::Sine => phase.sin(),
        Quadrature::Cosine => phase.cos(),
    };
    wave * point.direction[axis]
}

/// Whether all recordings are sampled densely enough for a period.
pub(super) fn is_resolved(pitch_mm: f64, scene: &Scene) -> bool {
    let step_mm = |trace: &super::scene::Trace| trace.radius_mm * trace.spacing_rad;
    scene
        .traces
        .iter()
        .all(|trace| step_mm(trace) * SAMPLES_PER_PERIOD <= pitch_mm)
}
