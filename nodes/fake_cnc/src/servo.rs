//! Cascaded loops of one axis: position P with velocity feed-forward over velocity PI.
//!
//! # Model
//!
//! ```text
//!   v_c = K_p (r - x) + f ṙ                                             (1)
//!   u   = K_v (v_c - v) + z,   ż = (K_v / T_i) (v_c - v)                  (2)
//!   |u| ≤ u_max;  z rests while u is at its limit and (2) would push on   (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | r | path plus compensation | mm, rad |
//! | ṙ | velocity of the path alone: a compensation never enters the feed-forward | mm/s |
//! | u | acceleration demand: torque over inertia | mm/s² |
//! | K_p, f | machine file | 1/s, 1 |
//! | K_v, T_i, u_max | parameters | 1/s, s, mm/s² |

/// Gains of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gains {
    /// K_p, 1/s.
    pub position_per_s: f64,
    /// f, 0 to 1.
    pub feedforward: f64,
    /// K_v, 1/s.
    pub velocity_per_s: f64,
    /// T_i, s.
    pub integral_time_s: f64,
    /// u_max, mm/s² or rad/s².
    pub demand_limit: f64,
}

/// Loops of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Servo {
    gains: Gains,
    integral: f64,
}

impl Servo {
    /// At rest.
    #[must_use]
    pub const fn new(gains: Gains) -> Self {
        Self {
            gains,
            integral: 0.0,
        }
    }

    /// Acceleration demand for a position error (mm, rad) and the path's velocity.
    pub fn demand(
        &mut self,
        position_error: f64,
        path_velocity: f64,
        velocity: f64,
        period_s: f64,
    ) -> f64 {
        let wanted =
            self.gains.position_per_s * position_error + self.gains.feedforward * path_velocity;
        self.follow_velocity(wanted, velocity, period_s)
    }

    /// Acceleration demand of the velocity loop alone; braking is `wanted` = 0.
    pub fn follow_velocity(&mut self, wanted: f64, velocity: f64, period_s: f64) -> f64 {
        let error = wanted - velocity;
        let full = self.gains.velocity_per_s * error + self.integral;
        let demand = full.clamp(-self.gains.demand_limit, self.gains.demand_limit);
        if (full - demand) * error <= 0.0 {
            self.integral +=
                self.gains.velocity_per_s / self.gains.integral_time_s * error * period_s;
        }
        demand
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAINS: Gains = Gains {
        position_per_s: 60.0,
        feedforward: 0.98,
        velocity_per_s: 300.0,
        integral_time_s: 0.02,
        demand_limit: 9000.0,
    };
    const PERIOD_S: f64 = 0.001;

    /// Rigid inertia with Coulomb friction, stepped finely.
    fn run(
        servo: &mut Servo,
        seconds: f64,
        friction: f64,
        command: impl Fn(f64) -> (f64, f64),
    ) -> f64 {
        let (mut x, mut v) = (0.0_f64, 0.0_f64);
        let steps = (seconds / PERIOD_S).round() as u32;
        for k in 1..=steps {
            let (r, rate) = command(f64::from(k - 1) * PERIOD_S);
            let u = servo.demand(r - x, rate, v, PERIOD_S);
            for _ in 0..50 {
                let push = u - friction * (v / 0.01).tanh();
                v += push * PERIOD_S / 50.0;
                x += v * PERIOD_S / 50.0;
            }
        }
        command(seconds).0 - x
    }

    #[test]
    fn eq1_lag_at_constant_speed_is_what_feedforward_leaves() {
        let mut servo = Servo::new(GAINS);
        let lag = run(&mut servo, 2.0, 400.0, |t| (20.0 * t, 20.0));
        let expected = (1.0 - 0.98) * 20.0 / 60.0;
        assert!((lag - expected).abs() < 0.02 * expected, "{lag} {expected}");
    }

    #[test]
    fn eq2_integral_overcomes_friction_at_rest() {
        let mut servo = Servo::new(GAINS);
        let error = run(&mut servo, 3.0, 400.0, |t| ((10.0 * t).min(5.0), 0.0));
        // Proportional gains alone would stop 400 / (300 * 60) mm short.
        assert!(error.abs() < 1e-3, "{error}");
    }

    #[test]
    fn eq3_demand_stays_at_its_limit_and_recovers() {
        let mut servo = Servo::new(GAINS);
        let mut demand = 0.0;
        for _ in 0..1000 {
            demand = servo.follow_velocity(1e4, 0.0, PERIOD_S);
        }
        assert!((demand - 9000.0).abs() < 1e-9);
        assert!(servo.integral.abs() < 1e-9);
        assert!(servo.follow_velocity(-1.0, 0.0, PERIOD_S) < 0.0);
    }
}
