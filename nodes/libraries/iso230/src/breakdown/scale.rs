//! Scales of the two axes: their mean widens the circle, their difference makes it oval along the axes.
//!
//! ```text
//!   e₁ = (m + q/2) x',  e₂ = (m − q/2) y',   m = (s₁ + s₂)/2,  q = s₁ − s₂       (1)
//!   ρ = m (x' cos θ + y' sin θ) + (q/2)(x' cos θ − y' sin θ)
//!     = R m + (R/2) q cos 2θ   on a circle about the origin                      (2)
//!   e_a = k x'_a²   quadratic pitch error                                        (3)
//! ```

use super::scene::Point;

/// Of m in (2).
pub(super) fn radial_expansion(point: &Point) -> f64 {
    point.offset_mm[0] * point.direction[0] + point.offset_mm[1] * point.direction[1]
}

/// Of q in (2).
pub(super) fn mismatch(point: &Point) -> f64 {
    0.5 * (point.offset_mm[0] * point.direction[0] - point.offset_mm[1] * point.direction[1])
}

/// (3) seen along the radius.
pub(super) fn quadratic_pitch(axis: usize, point: &Point) -> f64 {
    point.offset_mm[axis].powi(2) * point.direction[axis]
}
