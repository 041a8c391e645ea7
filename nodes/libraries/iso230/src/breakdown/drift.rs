//! Drift: a radius that changes with time leaves a seam where the circle should close.
//!
//! ```text
//!   ρ = r (t − t_middle)        (1)
//! ```
//!
//! In the angle it is a saw-tooth whose sign turns with the sense; in time it does not.

use super::scene::Point;

/// (1)
pub(super) fn ramp(point: &Point) -> f64 {
    point.time_s
}
