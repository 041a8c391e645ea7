//! What the control loops of the machine file leave by themselves: the nominal following error.
//!
//! A position loop of gain K with a share f of velocity feed-forward around an ideal velocity loop:
//!
//! ```text
//!   de/dt = -K e - (1 - f) dr/dt,   e = motor - command                   (1)
//!   e -> -(1 - f) v / K at constant velocity                              (2)
//! ```
//!
//! (1) is stepped exactly for commands that are straight lines between ticks; the run is taken to begin in
//! the state (2). This is nominal: every prediction of the machine as it is described has it, so that an
//! effect such as `servo_lag` is only what the real loop does differently.
//!
//! # Holds when
//! The velocity loop is fast against K. What it adds is of second order and found as `acceleration_lag`.
//!
//! # Agreement
//! `val_the_loop_integrated_finely`: 3.4e-4 µm of 33 µm on a circle.

use super::response::Response;
use crate::effects::{Effect, Scene};
use crate::file::AxisEntry;

/// The nominal following errors of all axes.
#[derive(Clone, Copy, Debug)]
pub struct Following;

impl Effect for Following {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        for (axis, entry) in &scene.machine.axes {
            let (gain_per_s, feedforward) = match entry {
                AxisEntry::Linear(a) => (a.position_gain_per_s, a.velocity_feedforward),
                AxisEntry::Rotary(a) => (a.position_gain_per_s, a.velocity_feedforward),
            };
            let left_s = (1.0 - feedforward) / gain_per_s;
            let position = &motion.position[*axis];
            let velocity = &motion.velocity[*axis];
            let mut error = -left_s * velocity.first().copied().unwrap_or(0.0); // (2)
            let (mut period_s, mut kept) = (0.0_f64, 1.0);
            let ticks = response.servo[*axis].iter_mut().zip(position).enumerate();
            for (tick, (sum, here)) in ticks {
                if tick > 0 {
                    let step_s = motion.time_s[tick] - motion.time_s[tick - 1];
                    if (step_s - period_s).abs() > 1e-9 {
                        (period_s, kept) = (step_s, (-gain_per_s * step_s).exp());
                    }
                    let steady = -left_s * (here - position[tick - 1]) / step_s;
                    error = steady + (error - steady) * kept; // (1)
                }
                *sum += error;
            }
        }
    }
}
