//! Each output beside the one before, and beside the limits.

use axis_compensation::limiter::Limits;
use metrology::sample::AxisCompensation;
use metrology::{Axis, PerAxis};
use proptest::prelude::*;

/// Of both machines.
const PULSE_MM: f64 = 1e-4;

/// Follows the outputs and checks each against the one before.
pub struct Watch {
    limits: PerAxis<Option<Limits>>,
    pub last: PerAxis<f64>,
    velocity: PerAxis<f64>,
    /// How far rounding of the offset may have taken `velocity` from the limiter's own, mm/s.
    rounding: PerAxis<f64>,
    /// Greatest share of each limit that an offset with a geometric part has used.
    pub geometric_share: Limits,
}

impl Watch {
    /// An axis without limits is one that is not compensated.
    pub fn new(limits: PerAxis<Option<Limits>>) -> Self {
        Self {
            limits,
            last: PerAxis::default(),
            velocity: PerAxis::default(),
            rounding: PerAxis::default(),
            geometric_share: Limits {
                size: 0.0,
                rate: 0.0,
                acceleration: 0.0,
            },
        }
    }

    /// Nothing is said, and what comes later goes on from rest.
    pub fn rest(&mut self) {
        self.velocity = PerAxis::default();
        self.rounding = PerAxis::default();
    }

    /// `dt_s`: how long the change took; `None`: no time passed.
    pub fn check(&mut self, c: &AxisCompensation, dt_s: Option<f64>) -> Result<(), TestCaseError> {
        for axis in Axis::ALL {
            let total = c.total[axis];
            for part in [c.thermal[axis], c.geometric[axis], c.positioning[axis]] {
                prop_assert!(part.is_finite(), "a part of {axis} is {part}");
            }
            prop_assert!(c.remainder[axis].abs() < PULSE_MM);
            prop_assert!(
                (c.pulses[axis] as f64 * PULSE_MM + c.remainder[axis] - total).abs() < 1e-12
            );
            let Some(limits) = self.limits[axis] else {
                prop_assert!(total == 0.0, "{axis} is not compensated, yet {total}");
                continue;
            };
            prop_assert!(
                total.is_finite() && total.abs() <= limits.size * (1.0 + 1e-12),
                "size {total}"
            );
            let used = self.check_motion(axis, total, limits, dt_s)?;
            if c.geometric[axis].abs() > 0.0 {
                let share = &mut self.geometric_share;
                share.size = share.size.max(used.size);
                share.rate = share.rate.max(used.rate);
                share.acceleration = share.acceleration.max(used.acceleration);
            }
        }
        Ok(())
    }

    /// Rate and acceleration; returns what share of each limit was used.
    fn check_motion(
        &mut self,
        axis: Axis,
        total: f64,
        limits: Limits,
        dt_s: Option<f64>,
    ) -> Result<Limits, TestCaseError> {
        let change = total - self.last[axis];
        let mut used = Limits {
            size: total.abs() / limits.size,
            rate: 0.0,
            acceleration: 0.0,
        };
        let Some(dt_s) = dt_s else {
            prop_assert!(change == 0.0, "{change} in no time");
            return Ok(used);
        };
        prop_assert!(
            change.abs() <= limits.rate * dt_s * (1.0 + 1e-9) + 1e-14 * limits.size,
            "{change} in {dt_s} s"
        );
        let velocity = change / dt_s;
        let bent = (velocity - self.velocity[axis]).abs();
        // What the offset's last digits do to a difference over dt; a dt of 1 ns magnifies them, in
        // the change to this velocity and in that to the next.
        let rounding = 1e-15 * limits.size / dt_s;
        let both = rounding + self.rounding[axis] + 1e-9;
        let allowed = limits.acceleration * dt_s * (1.0 + 1e-9) + both;
        prop_assert!(bent <= allowed, "velocity changed by {bent} in {dt_s} s");
        used.rate = (velocity.abs() - rounding) / limits.rate;
        used.acceleration = (bent - both) / (limits.acceleration * dt_s);
        self.rounding[axis] = rounding;
        self.velocity[axis] = velocity;
        self.last[axis] = total;
        Ok(used)
    }
}
