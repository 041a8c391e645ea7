//! Cyclic error: the screw's lead and its bearings repeat an error with every turn.
//!
//! # Model
//!
//! ```text
//!   t = 2 pi n u / lead                                                   (1)
//!   E = a sin t + b cos t + a2 sin 2t + b2 cos 2t + x (a' sin t + b' cos t)    (2)
//! ```
//!
//! x is the place within the travel, -1 to 1: a screw that is bent or set up askew has another amplitude at
//! its other end.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | lead | `lead_mm` of the machine file | mm |
//! | n | `per_turn`, periods a turn of the screw | 1 |
//! | a, b | `sin_um`, `cos_um` | µm |
//! | a2, b2 | `free_sin2_um`, `free_cos2_um` | µm |
//! | a', b' | `free_sin_by_place_um`, `free_cos_by_place_um` | µm |
//!
//! # Holds when
//! The error is fixed to the screw, direction-independent, and between motor and slide. The slowest part of a screw is its
//! ring of balls, 0.3 to 0.45 turns a turn; what is longer is `pitch_error`.
//!
//! # Agreement
//! `val_a_cross_joint_at_an_angle`: 4e-4 µm of 1.09 µm for a joint at 3 degrees.
//!
//! # References
//! \[1\] ISO 230-2:2014, annex C (periodic positioning error).

use std::f64::consts::TAU;

use metrology::Axis;

use super::form::Travel;
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "cyclic_error",
    title: "cyclic error of the screw",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("sin_um", 20.0, 1.0),
        Parameter::amplitude("cos_um", 20.0, 1.0),
        Parameter::frequency("per_turn", [0.3, 10.0], 1.0, &[0.4, 0.5, 1.0, 2.0, 4.0]),
    ],
    free: &[
        Parameter::amplitude("free_sin2_um", 20.0, 0.5),
        Parameter::amplitude("free_cos2_um", 20.0, 0.5),
        Parameter::amplitude("free_sin_by_place_um", 20.0, 0.5),
        Parameter::amplitude("free_cos_by_place_um", 20.0, 0.5),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "positions that differ by parts of the lead",
    build: |target, values| Box::new(CyclicError::new(&target, values)),
};

struct CyclicError {
    axis: Axis,
    per_turn: f64,
    first_mm: [f64; 2],
    second_mm: [f64; 2],
    by_place_mm: [f64; 2],
}

impl CyclicError {
    fn new(target: &Target, values: &[f64]) -> Self {
        let mm = |k: usize| values[k] * 1e-3;
        Self {
            axis: target.axis(),
            per_turn: values[2],
            first_mm: [mm(0), mm(1)],
            second_mm: [mm(3), mm(4)],
            by_place_mm: [mm(5), mm(6)],
        }
    }
}

impl Effect for CyclicError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(linear) = scene.machine.linear(self.axis) else {
            return;
        };
        let rad_per_mm = TAU * self.per_turn / linear.lead_mm;
        let travel = Travel::of(scene, self.axis);
        let position = &scene.run.motion.position[self.axis];
        for (sum, here) in response.drive[self.axis].iter_mut().zip(position) {
            let (sin, cos) = (rad_per_mm * here).sin_cos(); // (1)
            let (sin2, cos2) = (2.0 * sin * cos, 1.0 - 2.0 * sin * sin);
            let x = travel.share(*here);
            *sum += (self.first_mm[0] + x * self.by_place_mm[0]) * sin
                + (self.first_mm[1] + x * self.by_place_mm[1]) * cos
                + self.second_mm[0] * sin2
                + self.second_mm[1] * cos2; // (2)
        }
    }
}
