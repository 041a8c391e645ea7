//! Gravity sag: a ram, a head or a table hangs down by more the further it reaches out.
//!
//! # Model
//!
//! With r the share of the travel that is reached out, 0 to 1, from its low end, and 1 - r from its high end:
//!
//! ```text
//!   E_z = -(s r^n + s' (1 - r)^n)                                         (1)
//! ```
//!
//! n = 3 is a cantilever with its load at the end, n = 4 one that carries its own weight, n = 2 a slide
//! whose guide yields under the moment.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `sag_um`, all the way out | µm |
//! | s' | `free_from_high_um`, of a slide that reaches out towards its low end | µm |
//! | n | `power` | 1 |
//!
//! # Holds when
//! Z is upward. In one position of all other axes this is a straightness and a squareness, and nothing tells it
//! from both together; another load or overhang does.
//!
//! # Agreement
//! `val_a_cantilever_integrated`: the powers 3 and 4 are those of a curvature integrated twice.
//!
//! # References
//! \[1\] S. P. Timoshenko, Strength of Materials, part I (deflection of beams: cantilevers).

use metrology::ErrorComponent;

use super::form::Travel;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "gravity_sag",
    title: "sag of an overhanging slide",
    targets: Targets::Sagging,
    parameters: &[
        Parameter::amplitude("sag_um", 100.0, 10.0),
        Parameter::shape("power", [1.5, 4.0], 3.0, &[2.0, 3.0, 4.0]),
    ],
    free: &[Parameter::amplitude("free_from_high_um", 100.0, 5.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "vertical readings over the travel of the horizontal axis",
    build: |target, values| {
        Box::new(GravitySag {
            component: target.component(),
            sag_mm: values[0] * 1e-3,
            power: values[1],
            from_high_mm: values[2] * 1e-3,
        })
    },
};

struct GravitySag {
    component: ErrorComponent,
    sag_mm: f64,
    power: f64,
    from_high_mm: f64,
}

impl Effect for GravitySag {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::of(scene, self.component.of);
        let position = &scene.run.motion.position[self.component.of];
        let whole = (self.power - self.power.round()).abs() < 1e-12;
        #[expect(clippy::cast_possible_truncation, reason = "between 1.5 and 4")]
        let order = self.power.round() as i32;
        let grown = |share: f64| {
            let out = share.max(0.0);
            if whole {
                out.powi(order)
            } else {
                out.powf(self.power)
            }
        };
        lever::add(scene, self.component, response, |tick| {
            let out = 0.5 * (1.0 + travel.share(position[tick]));
            -(self.sag_mm * grown(out) + self.from_high_mm * grown(1.0 - out)) // (1)
        });
    }
}
