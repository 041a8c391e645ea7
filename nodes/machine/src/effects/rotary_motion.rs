//! Error motion of a rotary axis: radial, axial, tilt or positioning error, once and twice a turn.
//!
//! # Model
//!
//! ```text
//!   e(c) = a cos c + b sin c + a2 cos 2c + b2 sin 2c                      (1)
//!   E = e times the lever of `volumetric::sensitivity`, (3) there         (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | a, b | `cos_um_urad`, `sin_um_urad`: µm for XC and the like, µrad for AC and the like | µm, µrad |
//! | a2, b2 | `free_cos2_um_urad`, `free_sin2_um_urad` | µm, µrad |
//!
//! # Holds when
//! The error repeats with the turn. A bearing's asynchronous motion does not.
//!
//! # Agreement
//! `val_an_eccentric_scale_ring`: 3e-4 µm of 9.4 µm against the geometry of a graduated ring.
//!
//! # References
//! \[1\] ISO 230-7:2015, clause 3 (error motions of an axis of rotation).

use metrology::ErrorComponent;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets, lever};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "rotary_motion",
    title: "error motion of a rotary axis",
    targets: Targets::RotaryMotions,
    parameters: &[
        Parameter::amplitude("cos_um_urad", 200.0, 5.0),
        Parameter::amplitude("sin_um_urad", 200.0, 5.0),
    ],
    free: &[
        Parameter::amplitude("free_cos2_um_urad", 200.0, 2.0),
        Parameter::amplitude("free_sin2_um_urad", 200.0, 2.0),
    ],
    moment: Moment::Mean,
    needs: "readings at positions of the rotary axis over a turn",
    build: |target, values| {
        Box::new(RotaryMotion {
            component: target.component(),
            first: [0, 1].map(|k| values[k] * lever::per_micro(target.component())),
            second: [2, 3].map(|k| values[k] * lever::per_micro(target.component())),
        })
    },
};

struct RotaryMotion {
    component: ErrorComponent,
    /// mm or rad.
    first: [f64; 2],
    second: [f64; 2],
}

impl Effect for RotaryMotion {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let position = &scene.run.motion.position[self.component.of];
        let ([a, b], [a2, b2]) = (self.first, self.second);
        lever::add(scene, self.component, response, |tick| {
            let (sin, cos) = position[tick].sin_cos();
            let twice = a2 * (cos * cos - sin * sin) + b2 * 2.0 * sin * cos;
            a * cos + b * sin + twice // (1)
        });
    }
}
