//! Structural ringing: the tip swings on after the axis has accelerated, at a natural frequency of the structure.
//!
//! # Model
//!
//! The tip hangs on its slide by a mode of natural frequency f and damping z; g is its share in the motion:
//!
//! ```text
//!   x'' + 2 z w x' + w^2 x = -g a,   w = 2 pi f,   E = x                  (1)
//! ```
//!
//! stepped exactly for the mean acceleration between two ticks; at rest under the first one.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | g | `share` | 1 |
//! | f | `frequency_hz` | Hz |
//! | z | `damping` | 1 |
//!
//! # Holds when
//! f is below half the rate of the record. The swing is locked to the command; a vibration of its own phase is
//! `vibration_random`.
//!
//! No wider form: frequency, damping and share tell a mode wholly. A second mode is a second entry.
//!
//! # Agreement
//! `val_the_mode_integrated_finely`: 0.15 % of the swing at 12 Hz, 0.35 % at 30 Hz.
//!
//! # References
//! \[1\] Y. Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, ch. 3 (structural dynamics of machines).

use std::f64::consts::TAU;

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "structural_ringing",
    title: "ringing of the structure",
    targets: Targets::LinearAxes,
    parameters: &[
        // The first mode of a cantilever takes part in the motion of its foot with 1.57 at its tip.
        Parameter::amplitude("share", 1.6, 0.3),
        Parameter::shape(
            "frequency_hz",
            [3.0, 400.0],
            30.0,
            &[8.0, 12.0, 18.0, 25.0, 35.0, 50.0, 70.0, 100.0],
        ),
        Parameter::shape("damping", [0.002, 0.5], 0.03, &[0.02, 0.1]),
    ],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings while the axis starts, stops or changes its acceleration",
    build: |target, values| {
        Box::new(StructuralRinging {
            axis: target.axis(),
            share: values[0],
            rad_per_s: TAU * values[1],
            damping: values[2],
        })
    },
};

struct StructuralRinging {
    axis: Axis,
    share: f64,
    rad_per_s: f64,
    damping: f64,
}

impl Effect for StructuralRinging {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let mut mode = Mode::new(self.rad_per_s, self.damping);
        let mut before = None;
        let ticks = motion.driven[self.axis].iter().zip(&motion.time_s);
        let sums = response.tip_mm[self.axis.index()].iter_mut();
        for (sum, (a, at_s)) in sums.zip(ticks) {
            if let Some((before_a, before_s)) = before {
                let mean: f64 = 0.5 * (a + before_a);
                mode.step(mean * self.share, at_s - before_s);
            } else {
                mode.rest(a * self.share);
            }
            before = Some((*a, *at_s));
            *sum += mode.place; // (1)
        }
    }
}

/// The mode with its state, and the transition over the latest step.
struct Mode {
    rad_per_s: f64,
    damping: f64,
    /// Damped frequency, rad/s.
    swing: f64,
    place: f64,
    velocity: f64,
    step_s: f64,
    sin: f64,
    cos: f64,
}

impl Mode {
    fn new(rad_per_s: f64, damping: f64) -> Self {
        Self {
            rad_per_s,
            damping,
            swing: rad_per_s * (1.0 - damping * damping).sqrt(),
            place: 0.0,
            velocity: 0.0,
            step_s: 0.0,
            sin: 0.0,
            cos: 1.0,
        }
    }

    /// At rest under a steady push.
    fn rest(&mut self, push: f64) {
        self.place = -push / (self.rad_per_s * self.rad_per_s);
    }

    fn step(&mut self, push: f64, step_s: f64) {
        if (step_s - self.step_s).abs() > 1e-9 {
            let kept = (-self.damping * self.rad_per_s * step_s).exp();
            let (sin, cos) = (self.swing * step_s).sin_cos();
            (self.step_s, self.sin, self.cos) = (step_s, kept * sin, kept * cos);
        }
        let steady = -push / (self.rad_per_s * self.rad_per_s);
        let (from, along) = (self.place - steady, self.velocity);
        let drag = self.damping * self.rad_per_s;
        let across = (along + drag * from) / self.swing;
        self.place = steady + from * self.cos + across * self.sin;
        let pull = self.rad_per_s * self.rad_per_s * from + drag * along;
        self.velocity = along * self.cos - pull / self.swing * self.sin;
    }
}
