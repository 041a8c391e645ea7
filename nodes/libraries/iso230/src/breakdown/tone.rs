//! A tone: vibration or stick-slip of one frequency, or lobes that stay in their place.
//!
//! ```text
//!   ρ = A sin(2π f t + ψ) m,   ψ of each recording its own;
//!   m = 1 of the radius itself, cos θ of the first axis, sin θ of the second     (1)
//!   f = n v/(2π R)           for n lobes a turn                  (2)
//! ```
//!
//! At one angular speed (2) makes the two the same; a second one shows whether f or n stays.

use std::f64::consts::TAU;

use super::scene::{Point, Scene, Trace};
use super::term::Quadrature;

/// One part of (1) in the trace that is `only`, 0 elsewhere.
pub(super) fn tone(
    only: usize,
    hz: f64,
    along: Option<usize>,
    part: Quadrature,
    scene: &Scene,
    trace: &Trace,
    point: &Point,
) -> f64 {
    if scene
        .traces
        .get(only)
        .is_none_or(|t| t.recording != trace.recording)
    {
        return 0.0;
    }
    let phase = TAU * hz * point.time_s;
    let wave = match part {
        Quadrature::Sine => phase.sin(),
        Quadrature::Cosine => phase.cos(),
    };
    wave * along.map_or(1.0, |axis| point.direction[axis])
}

/// (2)
pub(super) fn hz_of_lobes(per_turn: f64, trace: &Trace) -> f64 {
    per_turn * trace.speed_rad_s() / TAU
}

/// (2) turned over.
pub(super) fn lobes_of_hz(hz: f64, trace: &Trace) -> f64 {
    hz * TAU / trace.speed_rad_s()
}
