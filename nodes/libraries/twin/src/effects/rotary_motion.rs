//! Error motion of a rotary axis: radial, axial, tilt or positioning error, once to five times a turn.
//!
//! # Model
//!
//! ```text
//!   e(c) = a cos c + b sin c + sum_(k = 2..5) (a_k cos kc + b_k sin kc)   (1)
//!   E = e times the lever of `volumetric::sensitivity`, (3) there         (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | a, b | `cos_um_urad`, `sin_um_urad`: µm for XC and the like, µrad for AC and the like | µm, µrad |
//! | a_k, b_k | `free_cos2_um_urad`, `free_sin2_um_urad` to `free_sin5_um_urad` | µm, µrad |
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
use crate::Response;

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
        Parameter::ordinate("free_cos2_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_sin2_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_cos3_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_sin3_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_cos4_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_sin4_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_cos5_um_urad", 200.0, 2.0),
        Parameter::ordinate("free_sin5_um_urad", 200.0, 2.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings at positions of the rotary axis over a turn",
    build: |target, values| {
        let per_micro = lever::per_micro(target.component());
        Box::new(RotaryMotion {
            component: target.component(),
            waves: std::array::from_fn(|k| [0, 1].map(|part| values[2 * k + part] * per_micro)),
        })
    },
};

/// Waves a turn.
const WAVES: usize = 5;

struct RotaryMotion {
    component: ErrorComponent,
    /// Cosine and sine of each, mm or rad.
    waves: [[f64; 2]; WAVES],
}

impl Effect for RotaryMotion {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let position = &scene.run.motion.position[self.component.of];
        lever::add(scene, self.component, response, |tick| {
            let (sin, cos) = position[tick].sin_cos();
            let (mut s, mut c) = (0.0, 1.0);
            let mut sum = 0.0;
            for [a, b] in self.waves {
                (s, c) = (s * cos + c * sin, c * cos - s * sin);
                sum += a * c + b * s; // (1)
            }
            sum
        });
    }
}
