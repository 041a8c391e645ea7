//! Acceleration lag: an axis stays behind its command in proportion to the acceleration.
//!
//! # Model
//!
//! The answer of a loop to its command is 1 - T s - c s^2 - d s^3 ...; T is `servo_lag`, and
//!
//! ```text
//!   E = -c a - d j - g a |a| / a_0,   a_0 = 1000 mm/s2                    (1)
//! ```
//!
//! On a circle a = -(v/R)^2 r, so that its radius grows by c (v/R)^2 R. A loop of first order,
//! 1/(1 + T s), has c = -T^2: its radius shrinks by R (1 - 1/sqrt(1 + (T v/R)^2)), which is twice that by this
//! term and once back by T s, whose lag is across the radius.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | c | `time_squared_ms2` | ms² |
//! | d | `free_time_cubed_ms3` | ms³ |
//! | g | `free_square_um`, at 1000 mm/s² | µm |
//! | j | derivative of the acceleration | mm/s³ |
//!
//! # Holds when
//! The motion changes little within the loop's time.
//!
//! # Agreement
//! `val_a_first_order_loop_shrinks_circles_as_its_frequency_response_says`: below 0.001 µm of 4 µm.
//!
//! # References
//! \[1\] Y. Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, ch. 6 (design and analysis of CNC systems:
//! feed drives).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "acceleration_lag",
    title: "acceleration lag",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("time_squared_ms2", 1000.0, 20.0)],
    free: &[
        Parameter::amplitude("free_time_cubed_ms3", 100_000.0, 200.0),
        Parameter::amplitude("free_square_um", 200.0, 2.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings while the axis accelerates: circles at two feeds or radii",
    build: |target, values| Box::new(AccelerationLag::new(&target, values)),
};

struct AccelerationLag {
    axis: Axis,
    time_squared_s2: f64,
    time_cubed_s3: f64,
    /// Error per square of the acceleration, s4/mm.
    bent: f64,
}

impl AccelerationLag {
    fn new(target: &Target, values: &[f64]) -> Self {
        Self {
            axis: target.axis(),
            time_squared_s2: values[0] * 1e-6,
            time_cubed_s3: values[1] * 1e-9,
            bent: values[2] * 1e-3 / 1e6,
        }
    }
}

impl Effect for AccelerationLag {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let acceleration = &motion.acceleration[self.axis];
        let jerk = |tick: usize| {
            let (a, b) = (
                tick.saturating_sub(1),
                (tick + 1).min(acceleration.len() - 1),
            );
            let over_s = motion.time_s[b] - motion.time_s[a];
            if a < b {
                (acceleration[b] - acceleration[a]) / over_s
            } else {
                0.0
            }
        };
        for (tick, sum) in response.servo[self.axis].iter_mut().enumerate() {
            let a = acceleration[tick];
            *sum -= (self.time_squared_s2 + self.bent * a.abs()) * a;
            if self.time_cubed_s3 != 0.0 {
                *sum -= self.time_cubed_s3 * jerk(tick); // (1)
            }
        }
    }
}
