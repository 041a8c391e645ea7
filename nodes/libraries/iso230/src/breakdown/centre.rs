//! Setting up: where the centre really is, and how long the reference really is.
//!
//! ```text
//!   ρ = c₁ cos θ + c₂ sin θ        the same in all recordings of one set-up and zero     (1)
//!   ρ = l                          the same where set-up, zero and radius are the same   (2)
//! ```

use super::scene::{Point, Trace};

/// (1)
pub(super) fn offset(axis: usize, zero: usize, trace: &Trace, point: &Point) -> f64 {
    if trace.zero == zero {
        point.direction[axis]
    } else {
        0.0
    }
}

/// (2)
pub(super) fn reference_length(reference: usize, trace: &Trace) -> f64 {
    if trace.reference == Some(reference) {
        1.0
    } else {
        0.0
    }
}
