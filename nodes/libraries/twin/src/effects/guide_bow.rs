//! Bow of a guide: a slide on a bent guide leaves its line and tilts along it, both from one cause.
//!
//! # Model
//!
//! With h half the travel and q the place from its middle, a guide with sagitta s:
//!
//! ```text
//!   E = s (q/h)^2,   slope = dE/dq = 2 s q / h^2                          (1)
//! ```
//!
//! the slope turns the slide about the third direction, and the tip sees it through its arm.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `sagitta_um`, of half the travel | µm |
//!
//! # Holds when
//! The slide is short against the bow. A straightness and an angular error whose sizes agree so are this.
//!
//! No wider form: a bow is known by the one number that sagitta and tilt share. A deviation of any form is `straightness`, a
//! tilt of any form `angular_error`.
//!
//! # Agreement
//! `val_a_slide_on_an_arc`: 1.3e-4 µm of 8 µm against the rigid motion along an arc.
//!
//! # References
//! \[1\] ISO 230-1:2012, clause 3.4 (straightness and angular error motions of a linear axis).

use metrology::{Axis, ErrorComponent};

use super::form::Travel;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets, lever};
use crate::Response;
use machine::kinematics::direction_of;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "guide_bow",
    title: "bow of a guide",
    targets: Targets::Across,
    parameters: &[Parameter::amplitude("sagitta_um", 60.0, 5.0)],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings across the axis over its travel, with two arms",
    build: |target, values| {
        Box::new(GuideBow {
            component: target.component(),
            sagitta_mm: values[0] * 1e-3,
        })
    },
};

struct GuideBow {
    component: ErrorComponent,
    sagitta_mm: f64,
}

impl Effect for GuideBow {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let ErrorComponent { direction, of, .. } = self.component;
        let travel = Travel::of(scene, of);
        let position = &scene.run.motion.position[of];
        lever::add(scene, self.component, response, |tick| {
            self.sagitta_mm * travel.share(position[tick]).powi(2) // (1)
        });
        let about = direction_of(of).cross(&direction_of(direction));
        let turn = Axis::ROTARY[about.iamax()];
        let slope = 2.0 * self.sagitta_mm * travel.per_half() * about[about.iamax()];
        let tilt = ErrorComponent::motion(turn, of);
        lever::add(scene, tilt, response, |tick| {
            slope * travel.share(position[tick]) // (1)
        });
    }
}
