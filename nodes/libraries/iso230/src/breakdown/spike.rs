//! Reversal spike: friction holds an axis at its end until the servo has overcome it.
//!
//! ```text
//!   ρ = A p(t) |cos θ|,   t = s R/v since the reversal                            (1)
//!   p(t) = exp(−t/τ)                        for k = 0, a pulse that rises at once
//!   p(t) = (t/(k τ))^k exp(k − t/τ)         for k = 1, 2, 3, with its peak at k τ  (2)
//! ```
//!
//! |cos θ| is |sin θ| for the second axis. A is the height of the peak, above 0 outward. It belongs to
//! one feed and radius, since it changes with the acceleration; k and τ belong to the axis: they are
//! the answer of its servo to the step of friction.

use super::scene::{Point, Trace};

/// Greatest k of (2).
pub(super) const SLOWEST_RISE: u8 = 3;

/// (1)
pub(super) fn pulse(
    axis: usize,
    condition: usize,
    rise: u8,
    decay_s: f64,
    trace: &Trace,
    point: &Point,
) -> f64 {
    if trace.condition != condition {
        return 0.0;
    }
    let since_s = point.arc_rad[axis] / trace.speed_rad_s();
    shape(since_s / decay_s, rise) * point.direction[axis].abs()
}

/// (2) of t/τ
fn shape(elapsed: f64, rise: u8) -> f64 {
    let k = f64::from(rise);
    if rise == 0 {
        return (-elapsed).exp();
    }
    (elapsed / k).powi(i32::from(rise)) * (k - elapsed).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_every_pulse_has_height_one_at_its_peak() {
        for rise in 0..=SLOWEST_RISE {
            let peak = f64::from(rise);
            assert!((shape(peak, rise) - 1.0).abs() < 1e-12);
            assert!(shape(peak + 0.1, rise) < 1.0);
            assert!(rise == 0 || shape(peak - 0.1, rise) < 1.0);
        }
    }
}
