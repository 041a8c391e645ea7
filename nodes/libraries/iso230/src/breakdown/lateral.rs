//! Lateral play: an axis moves sideways in its guide when it reverses.
//!
//! ```text
//!   first axis:  e₂ = (l/2) ε,    ρ = σ (l/2)|sin θ|        (1)
//!   second axis: e₁ = −(l/2) ε,   ρ = σ (l/2)|cos θ|        (2)
//! ```
//!
//! ε = +1 while the axis comes from its positive end. No step: the trace of one sense lies outside
//! that of the other. l above 0: counter-clockwise outside.

use super::scene::{Point, Trace};

/// (1) or (2)
pub(super) fn play(axis: usize, trace: &Trace, point: &Point) -> f64 {
    0.5 * trace.sense * point.direction[1 - axis].abs()
}
