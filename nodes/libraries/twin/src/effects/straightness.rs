//! Straightness: an axis leaves its line in a direction across it.
//!
//! # Model
//!
//! Legendre polynomials of the place x within the travel, -1 to 1; the linear part is squareness:
//!
//! ```text
//!   E = sum_n p_n P_n(x),   n = 2, 3 and, wider, 4, 5                     (1)
//!   E += sum_k f_k b_k(x),   splines with knots at the sixteenths of the travel        (2)
//! ```
//!
//! (2) is for a guide that is worn or dented in one place.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p_n | `p2_um`, `p3_um`, wider form `free_p4_um`, `free_p5_um` | µm |
//! | f_k | `free_1_of_8_um` .. `free_7_of_8_um`, `free_1_of_16_um`, `free_3_of_16_um` .. `free_15_of_16_um` | µm |
//!
//! # Holds when
//! The line is that of the point whose position the axes name, with the other axes anywhere.
//!
//! # Agreement
//! `val_a_guide_bent_to_a_circle`: 3e-7 µm of 6.8 µm. `val_a_slide_on_a_guide_that_is_worn_in_one_place`: of 0.82 µm
//! P2 to P5 leave 0.50, with splines at the eighths 0.16, at the sixteenths 0.055.
//!
//! # References
//! \[1\] ISO 230-1:2012, clause 3.4 (straightness deviation, reference straight line).

use metrology::ErrorComponent;

use super::form::{CURVE_UM, PLACE_SPLINES, Travel, legendre, place_splines};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "straightness",
    title: "straightness",
    targets: Targets::Across,
    parameters: &[
        Parameter::amplitude("p2_um", 60.0, 3.0),
        Parameter::amplitude("p3_um", 60.0, 2.0),
    ],
    free: CURVE_UM,
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings across the axis over its travel",
    build: |target, values| Box::new(Straightness::new(&target, values)),
};

struct Straightness {
    component: ErrorComponent,
    polynomial_mm: [f64; 4],
    local_mm: [f64; PLACE_SPLINES],
}

impl Straightness {
    fn new(target: &Target, values: &[f64]) -> Self {
        Self {
            component: target.component(),
            polynomial_mm: std::array::from_fn(|k| values[k] * 1e-3),
            local_mm: std::array::from_fn(|k| values[4 + k] * 1e-3),
        }
    }
}

impl Effect for Straightness {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::of(scene, self.component.of);
        let position = &scene.run.motion.position[self.component.of];
        lever::add(scene, self.component, response, |tick| {
            let x = travel.share(position[tick]);
            let local_mm = place_splines(&self.local_mm, x); // (2)
            legendre(2, &self.polynomial_mm, x) + local_mm // (1)
        });
    }
}
