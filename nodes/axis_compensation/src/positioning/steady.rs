//! Whether an axis moves at one speed, and has for so long that its slide no longer swings.
//!
//! ```text
//!   steady at a step s in Δt    |s − s_before Δt/Δt_before| ≤ 2 pulses + a Δt²,
//!                               |s − v Δt| ≤ 2 pulses + a T Δt                                            (1)
//! ```
//!
//! with T the time for which it must be steady, v the mean speed of the last T and a = [`LIMIT_MM_S2`]: under an acceleration a
//! the slide lags by m a/k, 0.1 µm for a tonne on 200 N/µm, which a table may learn; under that of a turn it may not. An arc of
//! 50 mm at 1000 mm/min is steady by it, for it speeds an axis up by 6 mm/s².

use crate::femtometre::FM_PER_MM;

/// Greatest acceleration of a motion that counts as steady, mm/s².
pub const LIMIT_MM_S2: f64 = 20.0;
/// Sums of ticks end a rounding before or after the time asked for.
const BEYOND_ROUNDING: f64 = 1.0 + 1e-9;

/// Follows the command of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Steady {
    settle_s: f64,
    tolerance_fm: f64,
    /// The last step, fm, and its time, s.
    before: Option<(i64, f64)>,
    /// v, fm/s.
    mean_fm_s: f64,
    for_s: f64,
}

impl Steady {
    /// Steady once the speed was one for `settle_s`, on a control whose commands are known to a pulse of `pulse_fm`.
    pub fn new(settle_s: f64, pulse_fm: i64) -> Self {
        Self {
            settle_s,
            tolerance_fm: 2.0 * pulse_fm as f64,
            before: None,
            mean_fm_s: 0.0,
            for_s: 0.0,
        }
    }

    /// The next step does not follow the last one.
    pub fn forget(&mut self) {
        (self.before, self.for_s) = (None, 0.0);
    }

    /// One step of the command; whether the motion was steady long enough before it, and still is.
    pub fn advance(&mut self, step_fm: i64, dt_s: f64) -> bool {
        if let Some((before_fm, before_s)) = self.before {
            let differs = |expected_fm: f64, over_s: f64| {
                let allowed_fm = self.tolerance_fm + LIMIT_MM_S2 * FM_PER_MM * over_s * dt_s;
                (step_fm as f64 - expected_fm).abs() > allowed_fm
            };
            let is_steady = !differs(before_fm as f64 / before_s * dt_s, dt_s)
                && !differs(self.mean_fm_s * dt_s, self.settle_s);
            if !is_steady {
                self.forget();
            }
        }
        let is_settled = self.for_s * BEYOND_ROUNDING >= self.settle_s;
        if dt_s > 0.0 {
            self.before = Some((step_fm, dt_s));
            self.for_s += dt_s;
            let speed_fm_s = step_fm as f64 / dt_s;
            let share = dt_s / self.for_s.min(self.settle_s.max(dt_s));
            self.mean_fm_s += (speed_fm_s - self.mean_fm_s) * share.min(1.0);
        }
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

    /// Round a circle of 50 mm at 1000 mm/min, 6 mm/s2; the axis turns after a quarter.
    #[test]
    fn an_arc_is_steady() {
        let mut steady = Steady::new(0.3, PULSE_FM);
        let at_fm = |tick: i32| {
            let angle_rad = f64::from(tick) * 1e-3 * (1000.0 / 60.0) / 50.0;
            (50.0 * angle_rad.sin() * 1e4).round() as i64 * PULSE_FM
        };
        let said: Vec<bool> = (0..9000)
            .map(|tick| steady.advance(at_fm(tick + 1) - at_fm(tick), 1e-3))
            .collect();
        assert!(said[301..].iter().all(|said| *said));
    }

    #[test]
    fn a_motion_that_slows_down_is_not() {
        let mut steady = Steady::new(0.05, PULSE_FM);
        let said: Vec<bool> = (0..110)
            .map(|tick| steady.advance(slowed_fm(tick + 1) - slowed_fm(tick), 1e-3))
            .collect();
        assert!(said[50..100].iter().all(|said| *said), "{said:?}");
        assert!(!said[102..].iter().any(|said| *said), "{said:?}");
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
