//! Follows a target without ever exceeding size, rate or acceleration.
//!
//! # Model
//!
//! The offset o moves with velocity v. Over a step of dt it takes the velocity at the step's *end*:
//!
//! ```text
//!   |v' − v| ≤ A dt,   |v'| ≤ R,   o' = o + v' dt                                 (1)
//!   v'²/2A + v' dt ≤ S − o     (towards either bound)                             (2)
//! ```
//!
//! Braking by (1) covers at most v²/2A, however the coming steps are spaced, since each step goes on
//! with the velocity it ends with. So if v²/2A ≤ S − o holds now, a v' that fulfils (1) and (2)
//! exists (v − A dt, or 0, is one) and the same holds after the step: the bound S is never crossed.
//! Solved for v':
//!
//! ```text
//!   v' ≤ b(S − o),   b(s) = −A dt + √(A² dt² + 2 A s)                             (3)
//! ```
//!
//! The target moves with velocity V (its own last change, if that is below R; a jump has none). The
//! wanted velocity closes the gap e = target − o − V dt with a braking ramp about V, and exactly where
//! the gap is within a step's reach:
//!
//! ```text
//!   v' = V + sign(e) b(|e|),   v' = V + e/dt  for |e| ≤ A dt²/2                    (4)
//! ```
//!
//! then cut to what (1) and (2) allow.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | S, R, A | `size`, `rate`, `acceleration` | mm, mm/s, mm/s² |
//! | o, v | `offset`, `velocity` | mm, mm/s |
//!
//! # Holds when
//! dt is the time for which the offset really acts. Jerk is not limited: acceleration switches
//! between its bounds.
//!
//! # Agreement
//! `prop_no_sequence_of_targets_and_steps_breaks_a_limit` here and `tests/props` for the whole
//! stage: no violation above 1e-9 of a limit.

/// Limits of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Greatest |offset|, mm.
    pub size: f64,
    /// Greatest |velocity|, mm/s.
    pub rate: f64,
    /// Greatest |acceleration|, mm/s².
    pub acceleration: f64,
}

/// An offset under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limiter {
    limits: Limits,
    offset: f64,
    velocity: f64,
    target: f64,
}

impl Limiter {
    /// At rest at zero.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            offset: 0.0,
            velocity: 0.0,
            target: 0.0,
        }
    }

    /// The offset, mm.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Its velocity, mm/s.
    #[must_use]
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The limits.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// Whether it stands at exactly zero.
    #[must_use]
    pub fn is_at_rest_at_zero(&self) -> bool {
        self.offset == 0.0 && self.velocity == 0.0
    }

    /// The offset did not act on for a while: it stands.
    pub fn freeze(&mut self) {
        self.velocity = 0.0;
        self.target = self.offset;
    }

    /// Goes on for `dt_s` > 0 towards `target` (|target| ≤ size; finite): (1) to (4). Returns the offset.
    pub fn follow(&mut self, target: f64, dt_s: f64) -> f64 {
        let Limits {
            size,
            rate,
            acceleration,
        } = self.limits;
        let change = acceleration * dt_s;
        let reach = |distance: f64| {
            let distance = distance.max(0.0);
            // The usual form of b, free of the cancellation of its two large terms.
            2.0 * acceleration * distance
                / (change + (change * change + 2.0 * acceleration * distance).sqrt())
        };
        let own = (target - self.target) / dt_s;
        let own = if own.abs() <= rate { own } else { 0.0 };
        let gap = target - self.offset - own * dt_s;
        let close = if gap.abs() <= 0.5 * change * dt_s {
            gap / dt_s
        } else {
            reach(gap.abs()).copysign(gap)
        };
        let upper = (self.velocity + change)
            .min(rate)
            .min(reach(size - self.offset));
        let lower = (self.velocity - change)
            .max(-rate)
            .max(-reach(size + self.offset));
        let velocity = (own + close).min(upper).max(lower);
        let landed = self.offset + velocity * dt_s;
        // Rounding must not leave a remainder of 1e-22 mm for ever.
        let arrived = (landed - target).abs() <= 1e-15 * size;
        self.velocity = if arrived && velocity.abs() <= 1e-15 * rate {
            0.0
        } else {
            velocity
        };
        self.offset = if arrived { target } else { landed };
        self.target = target;
        self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: Limits = Limits {
        size: 0.2,
        rate: 0.1,
        acceleration: 1.0,
    };

    #[test]
    fn a_step_of_the_target_is_reached_without_overshoot() {
        let mut limiter = Limiter::new(LIMITS);
        let mut greatest = 0.0_f64;
        for _ in 0..3000 {
            greatest = greatest.max(limiter.follow(0.05, 1e-3));
        }
        assert!((limiter.offset() - 0.05).abs() < 1e-15 && limiter.velocity() == 0.0);
        assert!(greatest <= 0.05 + 1e-15);
    }

    #[test]
    fn eq4_a_ramp_is_followed_without_lag() {
        let mut limiter = Limiter::new(LIMITS);
        let mut target = 0.0;
        for _ in 0..2000 {
            target += 0.02 * 1e-3;
            limiter.follow(target, 1e-3);
        }
        assert!((limiter.offset() - target).abs() < 1e-12);
    }

    #[test]
    fn eq2_a_ramp_that_ends_at_the_size_limit_does_not_cross_it() {
        let mut limiter = Limiter::new(LIMITS);
        let mut greatest = 0.0_f64;
        for k in 0..4000 {
            let target = (0.09e-3 * f64::from(k)).min(0.2);
            greatest = greatest.max(limiter.follow(target, 1e-3));
        }
        assert!(greatest <= 0.2 * (1.0 + 1e-12), "{greatest}");
        assert!((limiter.offset() - 0.2).abs() < 1e-12);
    }

    #[test]
    fn zero_is_reached_exactly() {
        let mut limiter = Limiter::new(LIMITS);
        for _ in 0..500 {
            limiter.follow(0.031, 1e-3);
        }
        for _ in 0..3000 {
            limiter.follow(0.0, 1e-3);
        }
        assert!(limiter.is_at_rest_at_zero());
    }

    #[test]
    fn the_time_to_a_far_target_is_that_of_the_trapezoid() {
        let mut limiter = Limiter::new(LIMITS);
        let steps = (1..10_000).find(|_| (limiter.follow(0.1, 1e-3) - 0.1).abs() < 1e-9);
        // 0.1 mm at 0.1 mm/s plus one acceleration time of 0.1 s.
        assert!((1095..1110).contains(&steps.unwrap()), "{steps:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 2000,
            failure_persistence: None,
            rng_seed: proptest::test_runner::RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        #[test]
        fn prop_no_sequence_of_targets_and_steps_breaks_a_limit(
            steps in proptest::collection::vec((-0.2..=0.2_f64, -5.0..0.0_f64), 1..300),
        ) {
            let mut limiter = Limiter::new(LIMITS);
            for (target, exponent) in steps {
                let dt_s = 10_f64.powf(exponent);
                let (offset, velocity) = (limiter.offset(), limiter.velocity());
                let next = limiter.follow(target, dt_s);
                let rate = (next - offset) / dt_s;
                prop_assert!(next.abs() <= LIMITS.size * (1.0 + 1e-12), "size {next}");
                prop_assert!(rate.abs() <= LIMITS.rate * (1.0 + 1e-9), "rate {rate}");
                let change = (rate - velocity).abs();
                prop_assert!(change <= LIMITS.acceleration * dt_s + 1e-10, "{change} in {dt_s}");
            }
        }
    }
}
