//! A loop whose command is a sum of waves during a step.
//!
//! # Model
//!
//! With s = i w' of a wave of angular frequency w' and the command's velocity r' on it, (3) to (5) of `following` answer by
//!
//! ```text
//!   G = 2 d w + w^2 / s,   H = 1 / (1 + s t)                              (8)
//!   v = G (K/s + f) r' / (s + G H + G K/s),   u = H v                     (9)
//!   e = (v - r') / s,   z = w^2 (c - u) / s,   c = -K e + f r'            (10)
//! ```
//!
//! and around an ideal velocity loop by e = -(1 - f) r' / (K + s), v = f r' - K e. What the state differs from that answer by
//! where the step begins passes as it does on a command of steady velocity: by how much the command was beside the waves there
//! it comes to them, evenly.
//!
//! # Agreement
//! `eq8_a_loop_on_waves_is_the_loop_in_small_steps`: 1e-4 of the waves.

use nalgebra::Complex;

use super::{Driven, ERROR, FILTERED, Follower, INTEGRAL, VELOCITY};
use machine::file::VelocityLoopEntry;

/// A wave of the command: the real part of `at` turned on by `per_s`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wave {
    /// Where the step begins.
    pub(crate) at: Complex<f64>,
    /// Angular frequency, rad/s; not zero.
    pub(crate) per_s: f64,
}

/// A velocity loop: 2 d w, w^2 and t.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inner {
    pub(super) proportional_per_s: f64,
    pub(super) integral_per_s2: f64,
    pub(super) filter_s: f64,
}

impl Inner {
    pub(super) fn of(velocity_loop: &VelocityLoopEntry) -> Self {
        let frequency = std::f64::consts::TAU * velocity_loop.frequency_hz;
        Self {
            proportional_per_s: 2.0 * velocity_loop.damping * frequency,
            integral_per_s2: frequency * frequency,
            filter_s: velocity_loop.filter_ms * 1e-3,
        }
    }
}

impl Follower {
    /// Goes on by a step in which the command comes evenly from so far beside a sum of waves to them.
    pub(crate) fn advance_by_waves(&mut self, waves: &[Wave], beside: f64, step_s: f64) {
        let mut answers = [Driven::zeros(); 2];
        for wave in waves {
            let begin = self.answer(wave);
            let turn = Complex::cis(wave.per_s * step_s);
            for (place, value) in begin {
                answers[0][place] += value.re;
                answers[1][place] += (value * turn).re;
            }
        }
        self.state -= answers[0];
        self.advance(-beside / step_s, 0.0, step_s);
        self.state += answers[1];
    }

    /// (8) to (10).
    fn answer(&self, wave: &Wave) -> [(usize, Complex<f64>); 4] {
        let s = Complex::new(0.0, wave.per_s);
        let velocity = s * wave.at;
        let (k, f) = (self.gains.position_per_s, self.gains.feedforward);
        let Some(inner) = self.inner else {
            let error = -velocity * (1.0 - f) / (s + k);
            let none = Complex::new(0.0, 0.0);
            let of_motor = velocity * f - error * k;
            return [
                (ERROR, error),
                (VELOCITY, of_motor),
                (INTEGRAL, none),
                (FILTERED, none),
            ];
        };
        let one = Complex::new(1.0, 0.0);
        let gain = one * inner.proportional_per_s + inner.integral_per_s2 / s;
        let filter = one / (one + s * inner.filter_s);
        let by_position = k / s;
        let v = velocity * gain * (by_position + f) / (s + gain * filter + gain * by_position);
        let (u, e) = (filter * v, (v - velocity) / s);
        let z = (velocity * f - e * k - u) * inner.integral_per_s2 / s;
        [(ERROR, e), (VELOCITY, v), (INTEGRAL, z), (FILTERED, u)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::Gains;
    use super::*;

    fn follower(inner: Option<VelocityLoopEntry>) -> Follower {
        let gains = Gains {
            position_per_s: 60.0,
            feedforward: 0.9,
        };
        Follower::of(gains, inner.as_ref(), Driven::zeros())
    }

    #[test]
    fn eq8_a_loop_on_waves_is_the_loop_in_small_steps() {
        let loops = [0.0, 0.25].map(|filter_ms| VelocityLoopEntry {
            frequency_hz: 50.0,
            damping: 0.8,
            filter_ms,
        });
        for inner in loops.into_iter().map(Some).chain([None]) {
            let (mut on_waves, mut stepped) = (follower(inner), follower(inner));
            // Where the command was told to be last: the first step comes from there to its waves, as the third does.
            for (step_s, beside) in [(0.004, -1.3), (0.004, 0.0), (0.002, 0.7), (0.006, 0.0)] {
                let waves = [(1.0, 1.0), (0.4, -2.0)].map(|(size, times)| Wave {
                    at: Complex::from_polar(size, 0.3 + step_s * 1e3 * times),
                    per_s: times * 2.0 / step_s,
                });
                on_waves.advance_by_waves(&waves, beside, step_s);
                let command = |t: f64| {
                    let of = |wave: &Wave| (wave.at * Complex::cis(wave.per_s * t)).re;
                    waves.iter().map(of).sum::<f64>() + beside * (1.0 - t / step_s)
                };
                let small_s = step_s / 2000.0;
                for k in 0..2000_u32 {
                    let t = f64::from(k) * small_s;
                    let velocity = (command(t + small_s) - command(t)) / small_s;
                    stepped.advance(velocity, 0.0, small_s);
                }
                let off = on_waves.error() - stepped.error();
                assert!(off.abs() < 1e-4, "{inner:?}: {off}");
                let faster = on_waves.velocity() - stepped.velocity();
                assert!(faster.abs() < 0.5, "{inner:?}: {faster}");
            }
        }
    }
}
