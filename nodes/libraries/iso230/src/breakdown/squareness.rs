//! Squareness of the second axis to the first: an oval at 45° that stays when the circle is driven the other way.
//!
//! ```text
//!   e₁ = −s φ y',   ρ = −s φ y' cos θ = −(s R φ/2) sin 2θ        (1)
//! ```
//!
//! φ is the component of ISO 230-1 of the two axes, E_C0Y for XY, and s its sign in the enclosed angle:
//! [`metrology::squareness`]. In the gauge of (1) the whole error is booked on the first axis; a radial trace cannot tell
//! where it is.

use super::scene::Point;
use metrology::Axis;
use metrology::squareness::{between, opening};

/// s of (1).
pub(super) fn sign(axes: [Axis; 2]) -> f64 {
    between(axes[0], axes[1]).map_or(0.0, opening)
}

/// (1)
pub(super) fn squareness(axes: [Axis; 2], point: &Point) -> f64 {
    -sign(axes) * point.offset_mm[1] * point.direction[0]
}
