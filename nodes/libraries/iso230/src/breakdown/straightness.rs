//! Straightness: a bow of one axis moves the other's coordinate; three lobes once the centre is taken out.
//!
//! ```text
//!   first axis:  e₂ = k x'²,  ρ = k x'² sin θ = (k R²/4)(sin θ + sin 3θ)      (1)
//!   second axis: e₁ = k y'²,  ρ = k y'² cos θ = (k R²/4)(cos θ − cos 3θ)      (2)
//! ```
//!
//! The lobes of a quadratic pitch error of the other axis are the same, turned over: only circles of
//! several radii about one centre that is not set to zero anew, or several places, tell them apart.

use super::scene::Point;

/// (1) or (2)
pub(super) fn quadratic(axis: usize, point: &Point) -> f64 {
    point.offset_mm[axis].powi(2) * point.direction[1 - axis]
}
