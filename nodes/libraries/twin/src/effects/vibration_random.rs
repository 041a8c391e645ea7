//! Vibration of random phase: the tip shakes along one direction, differently each time.
//!
//! # Model
//!
//! A sine of amplitude A whose phase is not known has half its square as variance; the wider form shakes more
//! the faster the axis moves:
//!
//! ```text
//!   variance = A2 / 2                                                     (1)
//!   variance += (A_v v / v0)2 / 2,   v0 = 100 mm/s                        (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | A | `amplitude_um` | µm |
//! | A_v | `free_with_speed_um` at 100 mm/s | µm |
//!
//! # Holds when
//! The phase is random against the run: only the scatter shows it. One that keeps its phase is an effect of the mean.
//!
//! # Agreement
//! `val_the_plants_shaking_has_half_the_square_of_its_amplitude` (`fake_cnc`): a tool that shakes at a frequency that wanders,
//! 20 s of it, to 3 %. `val_vibration_random_phases`: 200 000 sines of drawn phase to 0.1 %, and their fourth moment.
//!
//! # References
//! \[1\] W. T. Thomson, Theory of vibration with applications, section 13.4 (distribution and variance of a sine).
//! \[2\] ISO/TR 230-8:2010 (vibrations of machine tools).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "vibration_random",
    title: "vibration of random phase",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::size("amplitude_um", 20.0, 0.5)],
    free: &[Parameter::size("free_with_speed_um", 20.0, 0.5)],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "readings of a grid encoder or length reference along the direction",
    build: |target, values| {
        Box::new(VibrationRandom {
            axis: target.axis(),
            amplitude_mm: values[0] * 1e-3,
            with_speed_s: values[1] * 1e-3 / STATED_SPEED_MM_S,
        })
    },
};

/// Speed for which the wider form is stated, mm/s.
const STATED_SPEED_MM_S: f64 = 100.0;

struct VibrationRandom {
    axis: Axis,
    amplitude_mm: f64,
    with_speed_s: f64,
}

impl Effect for VibrationRandom {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let velocity = &scene.run.motion.velocity[self.axis];
        let sums = &mut response.tip_variance_mm2[self.axis.index()];
        for (sum, velocity) in sums.iter_mut().zip(velocity) {
            let with_speed_mm = self.with_speed_s * velocity;
            *sum += 0.5 * (self.amplitude_mm.powi(2) + with_speed_mm.powi(2)); // (1), (2)
        }
    }
}
