//! Backlash: after an axis reverses, it stays behind until the play is taken up; the trace steps outward.
//!
//! ```text
//!   e_a = (b/2) h(s) ε,    ε = +1 after the positive end, −1 after the negative one      (1)
//!   h(s) = min(1, −1 + 2 R (1 − cos s)/w)     while a play of width w is taken up         (2)
//!   b(x) = b⁺ (1 + x'/R_max)/2 + b⁻ (1 − x'/R_max)/2                                      (3)
//! ```
//!
//! (3) is the only way in which two reversals can differ and the loop still close: the play changes
//! along the axis. R_max is the largest radius of the plane, where b⁺ and b⁻ are the steps themselves.
//! b below 0, an inward step, is play that the control compensates too much.

use super::scene::{Point, Trace};
use super::term::BacklashEnd;

/// (1) to (3) seen along the radius, for b⁺ or b⁻.
pub(super) fn backlash(
    axis: usize,
    end: BacklashEnd,
    width_mm: f64,
    largest_radius_mm: f64,
    trace: &Trace,
    point: &Point,
) -> f64 {
    let towards = match end {
        BacklashEnd::Positive => 1.0,
        BacklashEnd::Negative => -1.0,
    };
    let weight = 0.5 * (1.0 + towards * point.offset_mm[axis] / largest_radius_mm); // (3)
    let retreat_mm = trace.radius_mm * (1.0 - point.arc_rad[axis].cos());
    let taken_up = if retreat_mm < width_mm {
        -1.0 + 2.0 * retreat_mm / width_mm
    } else {
        1.0
    }; // (2)
    0.5 * taken_up * point.end[axis] * weight * point.direction[axis] // (1)
}
