//! Squareness of the second axis to the first: an oval at 45° that stays when the circle is driven the other way.
//!
//! ```text
//!   e₁ = φ y',   ρ = φ y' cos θ = (R φ/2) sin 2θ        (1)
//! ```
//!
//! φ above 0: the positive directions enclose less than 90°. In the gauge of (1) the whole error is
//! booked on the first axis; a radial trace cannot tell where it is.

use super::scene::Point;

/// (1)
pub(super) fn squareness(point: &Point) -> f64 {
    point.offset_mm[1] * point.direction[0]
}
