//! Lateral play: a slide is pushed to the other side of its guide when it turns round.
//!
//! # Model
//!
//! Across the axis, with s the way since it last turned round:
//!
//! ```text
//!   E = (w/2) sgn(motion) (1 - 2 exp(-s/l))                               (1)
//! ```
//!
//! which goes over from one side to the other within a few l, continuously.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | w | `width_um`, from one side to the other | µm |
//! | l | `settle_mm` | mm |
//!
//! # Holds when
//! The drive pushes beside the guide's middle. At a reversal of a circle it is a step across the axis that
//! turns, as `backlash` of the other axis is not: that one turns elsewhere.
//!
//! No wider form: hats over the way, read across the axis, would take what friction and play of the other axis leave there.
//! Of a carriage that goes over at an even rate the best l leaves a seventh.
//!
//! # Agreement
//! `val_a_carriage_that_creeps_over_as_it_rolls`: below 1e-4 µm of 4 µm.
//!
//! # References
//! \[1\] ISO 230-4:2022, annex B (what typical errors of a machine do to circular paths).

use metrology::ErrorComponent;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "lateral_play",
    title: "lateral play of a guide",
    targets: Targets::Across,
    parameters: &[
        Parameter::amplitude("width_um", 60.0, 3.0),
        Parameter::shape("settle_mm", [0.01, 100.0], 1.0, &[0.03, 0.3, 3.0, 20.0]),
    ],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "a reversal of the axis, read across it",
    build: |target, values| {
        Box::new(LateralPlay {
            component: target.component(),
            half_mm: values[0] * 0.5e-3,
            settle_mm: values[1],
        })
    },
};

struct LateralPlay {
    component: ErrorComponent,
    half_mm: f64,
    settle_mm: f64,
}

impl Effect for LateralPlay {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let of = self.component.of;
        let (sense, way) = (&motion.sense[of], &motion.since_reversal[of]);
        lever::add(scene, self.component, response, |tick| {
            let moved = 1.0 - 2.0 * (-way[tick] / self.settle_mm).exp();
            self.half_mm * f64::from(sense[tick]) * moved // (1)
        });
    }
}
