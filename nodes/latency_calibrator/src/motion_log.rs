//! Where the axes were before a latch, and so how fast the ball met the surface.
//!
//! # Model
//!
//! ```text
//!   n·p(t) = s + f t + a t²/2,   t from the middle of the window before the latch      (1)
//!   steady  ⇔  |a| w ≤ max(share · f, 3 u(a) w)                                       (2)
//!   covered  ⇔  no time in [latch − w, latch] longer than w/5 without a position      (3)
//! ```
//!
//! f is the feed at contact, w the window. After a short stand-off the ball is still accelerating at
//! contact, and near the end of its move it already brakes: then its feed was not the one at which
//! the latency acted, and (2) refuses the touch. Noise of the encoder does not, whatever the feed.
//!
//! # Holds when
//! The window is at least as long as the latency, which is known only once all touches are evaluated and
//! is checked there; the control does not react before the latch. (3) is checked here: positions at
//! one end of the window alone say nothing of the other, where the contact was.

use std::collections::VecDeque;
use std::ops::Range;

use metrology::sample::AxisState;
use metrology::stamp::Span;
use metrology::{Machine, Stamp, least_squares};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::diagnostic::TouchFault;

/// Positions that the fit needs.
const LEAST_POSITIONS: usize = 6;
/// Coverage factor of a change that is noise.
const NOISE_COVERAGE_FACTOR: f64 = 3.0;
/// Uncertainty of a logged position where the fit is exact, mm.
const LEAST_UNCERTAINTY_MM: f64 = 1e-9;

/// Recent linear positions by the controller's stamp.
#[derive(Clone, Debug)]
pub struct MotionLog {
    positions: VecDeque<(Stamp<Machine>, Vector3<f64>)>,
    capacity: usize,
}

impl MotionLog {
    /// An empty log for `capacity` positions.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self {
            positions: VecDeque::with_capacity(capacity),
            capacity,
        }
    }

    /// Adds a position; says whether it stands in order of time. Otherwise the log begins anew.
    pub fn push(&mut self, state: &AxisState) -> bool {
        let in_order = match self.newest() {
            Some(newest) if state.controller_at == newest => return true,
            Some(newest) => state.controller_at > newest,
            None => true,
        };
        if !in_order {
            self.positions.clear();
        }
        if self.positions.len() == self.capacity {
            self.positions.pop_front();
        }
        self.positions
            .push_back((state.controller_at, state.motor.xyz()));
        in_order
    }

    /// Stamp of the newest position.
    #[must_use]
    pub fn newest(&self) -> Option<Stamp<Machine>> {
        self.positions.back().map(|(at, _)| *at)
    }

    /// Feed along `approach` at contact, mm/s, equation (1).
    ///
    /// # Errors
    /// When the log does not know it, or it was not steady.
    pub fn feed_at_contact_mm_s(
        &self,
        latch_at: Stamp<Machine>,
        approach: &Vector3<f64>,
        window: Span,
        steady_share: f64,
    ) -> Result<f64, TouchFault> {
        let from = latch_at - window;
        let first = self.positions.partition_point(|(at, _)| *at < from);
        let behind = self.positions.partition_point(|(at, _)| *at <= latch_at);
        let n = behind.saturating_sub(first);
        let window_s = window.as_secs_f64();
        if n < LEAST_POSITIONS {
            return Err(TouchFault::FeedUnknown {
                n,
                least: LEAST_POSITIONS,
                window_s,
            });
        }
        self.check_covered(first..behind, from, latch_at)?;
        let middle = from + Span::from_nanos(window.nanos() / 2);
        // Times in units of half a window keep the columns of one size.
        let half_s = window_s / 2.0;
        let rows: Vec<(f64, f64)> = self
            .positions
            .range(first..behind)
            .map(|(at, p)| ((*at - middle).as_secs_f64() / half_s, p.dot(approach)))
            .collect();
        let design = DMatrix::from_fn(n, 3, |i, j| rows[i].0.powi([0, 1, 2][j]));
        let along_mm = DVector::from_iterator(n, rows.iter().map(|(_, along)| *along));
        let unit = DVector::from_element(n, 1.0);
        let fit =
            least_squares::solve(&design, &along_mm, &unit).map_err(|_| TouchFault::NotFinite)?;
        let noise_mm = (fit.chi_square / fit.degrees_of_freedom as f64)
            .sqrt()
            .max(LEAST_UNCERTAINTY_MM);
        let feed_mm_s = fit.parameters[1] / half_s;
        let u_feed_mm_s = noise_mm * fit.covariance[(1, 1)].sqrt() / half_s;
        // What noise alone can make of a ball at rest is no feed.
        if feed_mm_s <= NOISE_COVERAGE_FACTOR * u_feed_mm_s {
            return Err(TouchFault::FeedNotPositive { feed_mm_s });
        }
        // Over the window, from -1 to 1, the slope of c t² changes by 4 c.
        let change_mm_s = 4.0 * fit.parameters[2].abs() / half_s;
        let u_change_mm_s = 4.0 * noise_mm * fit.covariance[(2, 2)].sqrt() / half_s;
        let limit_mm_s = (steady_share * feed_mm_s).max(NOISE_COVERAGE_FACTOR * u_change_mm_s); // (2)
        if change_mm_s > limit_mm_s {
            return Err(TouchFault::FeedNotSteady {
                feed_mm_s,
                change_mm_s,
                limit_mm_s,
                window_s,
            });
        }
        Ok(feed_mm_s)
    }
}

impl MotionLog {
    /// (3) for the positions `places`, all between `from` and `to`.
    fn check_covered(
        &self,
        places: Range<usize>,
        from: Stamp<Machine>,
        to: Stamp<Machine>,
    ) -> Result<(), TouchFault> {
        let window_s = (to - from).as_secs_f64();
        let stamps = self.positions.range(places).map(|(at, _)| *at);
        let ends = stamps.clone().chain([to]);
        let gap_s = [from]
            .into_iter()
            .chain(stamps)
            .zip(ends)
            .map(|(before, after)| (after - before).as_secs_f64())
            .fold(0.0, f64::max);
        let limit_s = window_s / (LEAST_POSITIONS - 1) as f64;
        if gap_s > limit_s {
            return Err(TouchFault::LogGap {
                gap_s,
                limit_s,
                window_s,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::{AxisSet, PerAxis};

    fn log_of(path: impl Fn(f64) -> f64, n: i64) -> MotionLog {
        let mut log = MotionLog::new(64);
        for k in 0..n {
            let mut motor = PerAxis::default();
            motor.0[2] = -path(k as f64 / 1e3);
            let state = AxisState {
                scale: motor,
                ..AxisState::standing(
                    Stamp::from_nanos(0),
                    Stamp::from_nanos(k * 1_000_000),
                    AxisSet::XYZ,
                    motor,
                )
            };
            assert!(log.push(&state));
        }
        log
    }

    fn feed(log: &MotionLog, latch_ms: f64) -> Result<f64, TouchFault> {
        let at = Stamp::from_nanos(0) + Span::from_secs_f64(latch_ms / 1e3);
        log.feed_at_contact_mm_s(at, &-Vector3::z(), Span::from_secs_f64(0.03), 0.02)
    }

    #[test]
    fn eq1_finds_a_constant_feed() {
        let log = log_of(|t| 8.5 * t, 200);
        assert!((feed(&log, 190.4).unwrap() - 8.5).abs() < 1e-9);
    }

    #[test]
    fn eq2_refuses_a_ball_that_still_accelerates() {
        let log = log_of(|t| 300.0 * t * t / 2.0, 100);
        // Middle of the window at 84 ms: 25.2 mm/s, changing by 300 · 0.03 = 9 mm/s.
        match feed(&log, 99.0) {
            Err(TouchFault::FeedNotSteady {
                feed_mm_s,
                change_mm_s,
                ..
            }) => {
                assert!((feed_mm_s - 25.2).abs() < 1e-6);
                assert!((change_mm_s - 9.0).abs() < 1e-6);
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn eq2_noise_of_the_encoder_does_not_refuse_a_creeping_touch() {
        // 10 mm/min, read in steps of 0.5 µm.
        let log = log_of(|t| (t / 6.0 / 5e-4).round() * 5e-4, 200);
        let found = feed(&log, 190.0).unwrap();
        assert!((found - 1.0 / 6.0).abs() < 0.01, "{found}");
    }

    #[test]
    fn eq3_positions_at_one_end_of_the_window_do_not_speak_for_the_other() {
        // The log begins 12 ms before the latch: 18 of 30 ms are missing.
        let mut late = MotionLog::new(64);
        let mut holed = MotionLog::new(64);
        for k in 0..60_i64 {
            let mut motor = PerAxis::default();
            motor.0[2] = -8.5 * k as f64 / 1e3;
            let state = AxisState {
                scale: motor,
                ..AxisState::standing(
                    Stamp::from_nanos(0),
                    Stamp::from_nanos(k * 1_000_000),
                    AxisSet::XYZ,
                    motor,
                )
            };
            if k >= 47 {
                late.push(&state);
            }
            if !(36..44).contains(&k) {
                holed.push(&state);
            }
        }
        for (log, gap_ms) in [(late, 18.0), (holed, 9.0)] {
            match feed(&log, 59.0) {
                Err(TouchFault::LogGap { gap_s, limit_s, .. }) => {
                    assert!((gap_s * 1e3 - gap_ms).abs() < 1e-9, "{gap_s}");
                    assert!((limit_s - 0.006).abs() < 1e-12);
                }
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn what_the_log_does_not_know_is_said() {
        assert!(matches!(
            feed(&log_of(|t| t, 4), 3.0),
            Err(TouchFault::FeedUnknown { n: 4, least: 6, .. })
        ));
        assert!(matches!(
            feed(&log_of(|t| t, 200), 500.0),
            Err(TouchFault::FeedUnknown { n: 0, .. })
        ));
        // The ring of 64 has forgotten the time before 136 ms.
        assert!(matches!(
            feed(&log_of(|t| t, 200), 100.0),
            Err(TouchFault::FeedUnknown { n: 0, .. })
        ));
        assert!(matches!(
            feed(&log_of(|_| 1.0, 200), 190.0),
            Err(TouchFault::FeedNotPositive { .. })
        ));
        assert!(matches!(
            feed(&log_of(|t| -t, 200), 190.0),
            Err(TouchFault::FeedNotPositive { feed_mm_s }) if (feed_mm_s + 1.0).abs() < 1e-9
        ));
        assert_eq!(
            feed(&log_of(|_| f64::NAN, 200), 190.0),
            Err(TouchFault::NotFinite)
        );
    }
}
