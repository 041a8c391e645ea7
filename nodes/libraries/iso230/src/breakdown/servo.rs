//! Lags of the servos: unequal ones tilt an oval by 45° with the sense of travel, equal ones shrink the circle.
//!
//! ```text
//!   e_a = −T_a v_a:   ρ = σ v (T₁ − T₂) sin θ cos θ = σ (v/2)(T₁ − T₂) sin 2θ     (1)
//!   e_a = −T v_a + T² a_a, with the tangent's share:   ρ = −v² T²/(2R)            (2)
//! ```
//!
//! The value of (2) is T², which is below 0 where a loop enlarges the circle. (1) is above 0 where the
//! first axis lags more.

use super::scene::{Point, Trace};

/// (1)
pub(super) fn mismatch(trace: &Trace, point: &Point) -> f64 {
    trace.sense * trace.feed_mm_s * point.direction[0] * point.direction[1]
}

/// (2)
pub(super) fn contraction(trace: &Trace) -> f64 {
    -trace.feed_mm_s.powi(2) / (2.0 * trace.radius_mm)
}
