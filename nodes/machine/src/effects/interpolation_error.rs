//! Interpolation error: an encoder divides its signal period unevenly (sub-divisional error, SDE).
//!
//! # Model
//!
//! ```text
//!   t = 2 pi u / P,   E = a sin t + b cos t + a2 sin 2t + b2 cos 2t       (1)
//! ```
//!
//! The loop follows its encoder, so that the slide is off by what the encoder reads wrongly.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | P | `period_um`, of the signal | µm |
//! | a, b | `sin_um`, `cos_um`: an offset of one of the two signals | µm |
//! | a2, b2 | `free_sin2_um`, `free_cos2_um`: unequal amplitudes, or a phase that is not 90 degrees | µm |
//!
//! # Holds when
//! The feed is slow against P times the loop's bandwidth, and positions are known to a small part of P.
//!
//! # Agreement
//! `val_the_arctangent_of_two_unequal_signals`: 3 % of the error, for 2 % of offset and 3 % of inequality.
//!
//! # References
//! \[1\] P. L. M. Heydemann, Applied Optics 20(19), 1981, doi:10.1364/AO.20.003382 (errors of quadrature
//! signals).

use std::f64::consts::TAU;

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "interpolation_error",
    title: "interpolation error of an encoder",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("sin_um", 5.0, 0.1),
        Parameter::amplitude("cos_um", 5.0, 0.1),
        Parameter::shape(
            "period_um",
            [0.5, 2000.0],
            20.0,
            &[2.0, 4.0, 10.0, 16.0, 20.0, 40.0, 100.0],
        ),
    ],
    free: &[
        Parameter::amplitude("free_sin2_um", 5.0, 0.05),
        Parameter::amplitude("free_cos2_um", 5.0, 0.05),
    ],
    moment: Moment::Mean,
    needs: "slow motion or stands that differ by parts of the signal period",
    build: |target, values| {
        Box::new(InterpolationError {
            axis: target.axis(),
            first_mm: [0, 1].map(|k| values[k] * 1e-3),
            rad_per_mm: TAU / (values[2] * 1e-3),
            second_mm: [3, 4].map(|k| values[k] * 1e-3),
        })
    },
};

struct InterpolationError {
    axis: Axis,
    first_mm: [f64; 2],
    rad_per_mm: f64,
    second_mm: [f64; 2],
}

impl Effect for InterpolationError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let position = &scene.run.motion.position[self.axis];
        for (sum, here) in response.drive[self.axis].iter_mut().zip(position) {
            let (sin, cos) = (self.rad_per_mm * here).sin_cos();
            *sum += self.first_mm[0] * sin
                + self.first_mm[1] * cos
                + self.second_mm[0] * 2.0 * sin * cos
                + self.second_mm[1] * (1.0 - 2.0 * sin * sin); // (1)
        }
    }
}
