//! When a loop over the scale, closed once a cycle with a delay, becomes unstable.
//!
//! # Model
//!
//! Each cycle adds g times the error that was measured D cycles ago to the offset o, which removes it:
//!
//! ```text
//!   o(k+1) = o(k) + g [d − o(k−D)],   characteristic z^(D+1) − z^D + g = 0        (1)
//! ```
//!
//! At the limit a pair of roots lies on the unit circle, z = exp(iφ). From z − 1 = −g z^(−D): moduli give
//! 2 sin(φ/2) = g, arguments (π + φ)/2 = π − Dφ, so φ = π/(2D+1), and
//!
//! ```text
//!   stable for 0 < g < g_max(D) = 2 sin{π/[2 (2D+1)]}                             (2)
//! ```
//!
//! | D | 0 | 1 | 2 | 3 | 4 | 5 |
//! |---|---|---|---|---|---|---|
//! | g_max | 2 | 1 | 0.618 | 0.445 | 0.347 | 0.285 |
//!
//! The measured part of `weighted_increments` has g = 1 − ω ≥ 0.7: it is stable up to D = 1 only, and there
//! not with ω = 0. (4) of `positioning`, the refreshed table, has no such loop: what it measures, xs − xm,
//! does not change with the offset but by slope times offset.
//!
//! # Holds when
//! The axis has followed its offset within the D cycles: a cycle is some settling times of the servo
//! loop. DERIVED; the published text says nothing of delay.
//!
//! # Agreement
//! `val_delayed_integrator_settles_below_and_grows_above_the_limit`: on both sides, 1 % apart, D = 0 to 5.

use std::f64::consts::PI;

use metrology::Axis;

use super::refusal::PositioningRefusal;

/// g_max of (2).
#[must_use]
pub fn gain_limit(delay_cycles: u32) -> f64 {
    2.0 * (PI / (2.0 * (2.0 * f64::from(delay_cycles) + 1.0))).sin()
}

/// Whether a measured loop of gain 1 − `weight` is stable.
///
/// # Errors
/// When it is not, or at the very limit.
pub fn check(axis: Axis, weight: f64, delay_cycles: u32) -> Result<(), PositioningRefusal> {
    let (gain, limit) = (1.0 - weight, gain_limit(delay_cycles));
    // At the limit itself an error swings for ever; sin(π/6) may round to either side of 1/2.
    if gain < limit * (1.0 - 1e-9) {
        return Ok(());
    }
    Err(PositioningRefusal::LoopUnstable {
        axis,
        gain,
        limit,
        delay_cycles,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Greatest |d − o| in the last quarter of 40,000 cycles after a step d = 1: (1) itself.
    fn left_after_a_step(gain: f64, delay: usize) -> f64 {
        let mut offsets = vec![0.0_f64; delay + 1];
        for _ in 0..40_000 {
            let now = offsets[offsets.len() - 1];
            let seen = offsets[offsets.len() - 1 - delay];
            let next = now + gain * (1.0 - seen);
            offsets.push(if next.abs() < 1e30 { next } else { 1e30 });
        }
        offsets[30_000..]
            .iter()
            .map(|offset| (1.0 - offset).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn val_delayed_integrator_settles_below_and_grows_above_the_limit() {
        for delay in 0..=5_u32 {
            let limit = gain_limit(delay);
            let (below, above) = (
                left_after_a_step(0.99 * limit, delay as usize),
                left_after_a_step(1.01 * limit, delay as usize),
            );
            eprintln!("D {delay}: limit {limit:.4}, left below {below:.1e}, above {above:.1e}");
            assert!(below < 1e-6, "D {delay}: {below} left below the limit");
            assert!(above > 1e3, "D {delay}: only {above} left above the limit");
        }
    }

    #[test]
    fn eq2_gives_the_closed_forms() {
        let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
        for (delay, limit) in [(0, 2.0), (1, 1.0), (2, golden)] {
            assert!((gain_limit(delay) - limit).abs() < 1e-15);
        }
    }

    #[test]
    fn a_loop_at_or_beyond_its_limit_is_refused_with_the_numbers() {
        assert_eq!(check(Axis::X, 0.0, 0), Ok(()));
        assert_eq!(check(Axis::X, 0.01, 1), Ok(()));
        assert!(check(Axis::X, 0.0, 1).is_err());
        let refused = check(Axis::Y, 0.3, 2).unwrap_err().to_string();
        assert!(
            refused.starts_with("axis Y: gain 0.7 of the measured loop, must be below 0.618"),
            "{refused}"
        );
        assert!(refused.ends_with("with a delay of 2 cycles"), "{refused}");
    }
}
