//! Servo lag: an axis follows its command by another time than the machine file's gains say.
//!
//! # Model
//!
//! The nominal following error, (1 - f) v / K, is the twin's own (`following`). This is what comes
//! on top of it, the first term in v of any loop's answer, and odd powers where the drive is not linear:
//!
//! ```text
//!   E = -T v - c_2 (v / v_0) |v / v_0| - c_3 (v / v_0)^3,   v_0 = 100 mm/s      (1)
//!   E += -T_w (u - v),   du/dt = K (v - u)                                      (2)
//! ```
//!
//! (2) is the wider form of a lag that the position loop itself works off by its gain: T_w is T where the feed-forward is
//! wrong, and zero where the whole command comes late.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | T | `time_ms` | ms |
//! | T_w | `free_worked_off_ms` | ms |
//! | K | `position_gain_per_s` of the machine file | 1/s |
//! | c_2, c_3 | `free_square_um`, `free_cube_um`, at 100 mm/s | µm |
//!
//! # Holds when
//! The velocity changes little within T: the next term is `acceleration_lag`. A circle shows only the
//! difference of its axes' lags (and their mean as a turn of the start).
//!
//! # Agreement
//! `val_a_loop_of_first_order_integrated_finely`: 0.1 µm of 100 µm, the next order.
//! `val_mismatch_is_an_ellipse_at_45_degrees`: 3.33 µm for 0.2 ms at 2 m/min.
//! `val_a_loop_that_lacks_feed_forward`: (1) leaves 1.2 µm at 360 mm/s², (2) below 1e-4 µm.
//!
//! # References
//! \[1\] ISO 230-4:2022, annex B (what typical errors of a machine do to circular paths).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "servo_lag",
    title: "servo lag",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("time_ms", 60.0, 0.3)],
    free: &[
        Parameter::amplitude("free_square_um", 200.0, 2.0),
        Parameter::amplitude("free_cube_um", 200.0, 2.0),
        Parameter::amplitude("free_worked_off_ms", 60.0, 0.3),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings while the axis moves, at two speeds or in both senses",
    build: |target, values| Box::new(ServoLag::new(&target, values)),
};

struct ServoLag {
    axis: Axis,
    time_s: f64,
    square_mm: f64,
    cube_mm: f64,
    worked_off_s: f64,
}

impl ServoLag {
    fn new(target: &Target, values: &[f64]) -> Self {
        Self {
            axis: target.axis(),
            time_s: values[0] * 1e-3,
            square_mm: values[1] * 1e-3,
            cube_mm: values[2] * 1e-3,
            worked_off_s: values[3] * 1e-3,
        }
    }
}

/// Speed at which the wider form's amplitudes are given, mm/s.
const REFERENCE_MM_S: f64 = 100.0;

impl Effect for ServoLag {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let velocity = &scene.run.motion.velocity[self.axis];
        for (sum, v) in response.servo[self.axis].iter_mut().zip(velocity) {
            let share = v / REFERENCE_MM_S;
            let bent_mm = share * (self.square_mm * share.abs() + self.cube_mm * share * share);
            *sum -= self.time_s * v + bent_mm; // (1)
        }
        if self.worked_off_s != 0.0 {
            self.add_worked_off(scene, response);
        }
    }
}

impl ServoLag {
    /// (2); a command whose velocity goes evenly from tick to tick is followed exactly.
    fn add_worked_off(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(linear) = scene.machine.linear(self.axis) else {
            return;
        };
        let motion = &scene.run.motion;
        let velocity = &motion.velocity[self.axis];
        let mut followed = velocity.first().copied().unwrap_or(0.0);
        for (tick, sum) in response.servo[self.axis].iter_mut().enumerate().skip(1) {
            let period_s = motion.time_s[tick] - motion.time_s[tick - 1];
            let step = linear.position_gain_per_s * period_s;
            let [from, to] = [velocity[tick - 1], velocity[tick]];
            let lag = (to - from) / step;
            followed = to - lag + (followed - from + lag) * (-step).exp();
            *sum -= self.worked_off_s * (followed - to);
        }
    }
}
