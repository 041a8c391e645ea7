//! A touch as the control sees it: direction, feed at the latch, latched positions.
//!
//! # Model
//!
//! ```text
//!   n = (x_end - x_start) / |x_end - x_start|        commanded motion of the tool, X Y Z   (1)
//!   f = n · (x_m[k] - x_m[k-N]) / (N T)              feed from the encoders at the latch   (2)
//! ```
//!
//! X, Y and Z commands move the tool relative to the workpiece whichever side carries the axis
//! (ISO 841), so (1) holds for table axes as well. (2) takes the last N = [`FEED_PERIODS`] periods,
//! fewer where the touch is younger; it is the feed at contact while the axes do not slow down before
//! the signal arrives, which they do not.
//!
//! # Latch
//! `hardware`: encoder positions and time at the instant the signal arrives. `polled`: both at the end
//! of the servo period in which it arrived, up to one period later.

use machine::file::Latch;
use metrology::stamp::Span;
use metrology::{Machine, PerAxis, Stamp};
use nalgebra::Vector3;

use crate::plant::{Feedback, ProbeEdge};

/// Periods over which the feed at the latch is taken.
pub const FEED_PERIODS: usize = 16;

/// What was latched.
#[derive(Clone, Debug, PartialEq)]
pub struct Latched {
    /// Controller time of the latch.
    pub at: Stamp<Machine>,
    /// Encoder positions, mm or rad.
    pub positions: PerAxis<f64>,
    /// Direction (1).
    pub approach: Vector3<f64>,
    /// Feed (2), mm/s.
    pub feed_mm_s: f64,
    /// Index of the feature's name in the program.
    pub feature: usize,
}

/// Positions along the approach in the last periods of a touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Approach {
    direction: Vector3<f64>,
    along_mm: [f64; FEED_PERIODS + 1],
    seen: usize,
}

impl Default for Approach {
    fn default() -> Self {
        Self {
            direction: Vector3::zeros(),
            along_mm: [0.0; FEED_PERIODS + 1],
            seen: 0,
        }
    }
}

impl Approach {
    /// Begins a touch from `start` to `end`.
    pub fn begin(&mut self, start: &PerAxis<f64>, end: &PerAxis<f64>, motor: &PerAxis<f64>) {
        let way = end.xyz() - start.xyz();
        self.direction = way.try_normalize(0.0).unwrap_or_default();
        self.seen = 0;
        self.record(motor);
    }

    /// Takes the encoder positions at the end of a period.
    pub fn record(&mut self, motor: &PerAxis<f64>) {
        self.along_mm[self.seen % (FEED_PERIODS + 1)] = self.direction.dot(&motor.xyz());
        self.seen += 1;
    }

    /// Feed by (2), mm/s; zero before two positions are known.
    #[must_use]
    pub fn feed_mm_s(&self, period_s: f64) -> f64 {
        let periods = FEED_PERIODS.min(self.seen.saturating_sub(1));
        if periods == 0 {
            return 0.0;
        }
        let slot = |back: usize| self.along_mm[(self.seen - 1 - back) % (FEED_PERIODS + 1)];
        (slot(0) - slot(periods)) / (periods as f64 * period_s)
    }

    /// Latches `edge`, which arrived in the period that began at `began`.
    #[must_use]
    pub fn latch(
        &self,
        latch: Latch,
        edge: &ProbeEdge,
        feedback: &Feedback,
        began: Stamp<Machine>,
        period: Span,
    ) -> Latched {
        let (at, positions) = match latch {
            Latch::Hardware => (began + edge.after_period_start, edge.motor_at_arrival),
            Latch::Polled => (began + period, feedback.motor),
        };
        Latched {
            at,
            positions,
            approach: self.direction,
            feed_mm_s: self.feed_mm_s(period.as_secs_f64()),
            feature: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_feed_is_the_mean_over_the_last_periods() {
        let mut approach = Approach::default();
        let mut end = PerAxis::default();
        end.0[2] = -5.0;
        approach.begin(&PerAxis::default(), &end, &PerAxis::default());
        assert!(approach.feed_mm_s(0.001).abs() <= 0.0);
        let mut motor = PerAxis::default();
        for k in 1..=40 {
            // 2 mm/s downwards, after a faster beginning that must be forgotten.
            motor.0[2] -= if k < 20 { 0.01 } else { 0.002 };
            approach.record(&motor);
        }
        assert!((approach.feed_mm_s(0.001) - 2.0).abs() < 1e-9);
        assert!((approach.direction + Vector3::z()).norm() < 1e-15);
    }
}
