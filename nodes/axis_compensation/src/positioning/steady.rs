//! Whether an axis moves at one speed, and has for so long that its slide no longer swings.
//!
//! ```text
//!   steady at a step s in Δt    |s − v Δt| ≤ 2 pulses,  v the mean speed since the motion is steady     (1)
//! ```
//!
//! A motion that speeds up by a is left at once where a Δt² is above 2 pulses, and after T with a T Δt/2 above them. Under it the
//! slide lags by m a/k, 4 µm for a tonne at 1 m/s² on 250 N/µm, which no table may learn.

/// Sums of ticks end a rounding before or after the time asked for.
const BEYOND_ROUNDING: f64 = 1.0 + 1e-9;

/// Follows the command of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Steady {
    settle_s: f64,
    tolerance_fm: f64,
    moved_fm: i64,
    for_s: f64,
}

impl Steady {
    /// Steady once the speed was one for `settle_s`, on a control whose commands are known to a pulse of `pulse_fm`.
    pub fn new(settle_s: f64, pulse_fm: i64) -> Self {
        Self {
            settle_s,
            tolerance_fm: 2.0 * pulse_fm as f64,
            moved_fm: 0,
            for_s: 0.0,
        }
    }

    /// The next step does not follow the last one.
    pub fn forget(&mut self) {
        (self.moved_fm, self.for_s) = (0, 0.0);
    }

    /// One step of the command; whether the motion was steady long enough before it, and still is.
    pub fn advance(&mut self, step_fm: i64, dt_s: f64) -> bool {
        if self.for_s > 0.0 {
            let expected_fm = self.moved_fm as f64 / self.for_s * dt_s;
            if (step_fm as f64 - expected_fm).abs() > self.tolerance_fm {
                self.forget();
            }
        }
        let is_settled = self.for_s * BEYOND_ROUNDING >= self.settle_s;
        self.moved_fm = self.moved_fm.saturating_add(step_fm);
        self.for_s += dt_s;
        is_settled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PULSE_FM: i64 = 100_000_000;

    /// Command at the end of a tick, in whole pulses: 10 mm/s, and from the tick 100 on slowed down at 1 m/s².
    fn slowed_fm(tick: i32) -> i64 {
        let slowed_for = f64::from((tick - 100).clamp(0, 10));
        let at_um = 10.0 * f64::from(tick.min(110)) - 0.5 * slowed_for * slowed_for;
        (at_um * 10.0).round() as i64 * PULSE_FM
    }

    #[test]
    fn one_speed_is_steady_after_its_settling_however_it_is_rounded() {
        // 16.66... um a tick: a pulse more in every third.
        let mut steady = Steady::new(0.05, PULSE_FM);
        let said: Vec<bool> = (0..200_i64)
            .map(|tick| {
                let at = |tick: i64| (tick * 1_000_000 / 6_000) * PULSE_FM;
                steady.advance(at(tick + 1) - at(tick), 1e-3)
            })
            .collect();
        assert_eq!(said.iter().position(|said| *said), Some(50));
        assert!(said[50..].iter().all(|said| *said));
    }

    #[test]
    fn a_motion_that_slows_down_is_not() {
        let mut steady = Steady::new(0.05, PULSE_FM);
        let said: Vec<bool> = (0..110)
            .map(|tick| steady.advance(slowed_fm(tick + 1) - slowed_fm(tick), 1e-3))
            .collect();
        assert!(said[50..100].iter().all(|said| *said), "{said:?}");
        assert!(!said[101..].iter().any(|said| *said), "{said:?}");
    }

    #[test]
    fn a_gap_begins_anew_and_without_settling_all_is_steady() {
        let mut steady = Steady::new(0.05, PULSE_FM);
        for _ in 0..100 {
            steady.advance(PULSE_FM, 1e-3);
        }
        steady.forget();
        assert!(!steady.advance(PULSE_FM, 1e-3));
        let mut at_once = Steady::new(0.0, PULSE_FM);
        assert!(
            [1, 50, 3]
                .iter()
                .all(|n| at_once.advance(n * PULSE_FM, 1e-3))
        );
    }
}
