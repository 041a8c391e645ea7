//! Straightness: an axis leaves its line in a direction across it.
//!
//! # Model
//!
//! Legendre polynomials of the place x within the travel, or within the part of it that is given, -1 to 1; the linear part is
//! squareness:
//!
//! ```text
//!   E = sum_n p_n P_n(x),   n = 2, 3 and, wider, 4, 5; over a part 1, too (1)
//!   E += sum_k f_k b_k(x),   splines with knots at the sixteenths        (2)
//! ```
//!
//! (2) is for a guide that is worn or dented in one place.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p_n | `p2_um`, `p3_um`, wider form `free_p4_um`, `free_p5_um`, `free_p1_um` | µm |
//! | f_k | `free_1_of_8_um` .. `free_7_of_8_um`, `free_1_of_16_um`, `free_3_of_16_um` .. `free_15_of_16_um` | µm |
//! | ends of the part | `free_from_mm`, `free_to_mm` | mm |
//!
//! # Holds when
//! The line is that of the point whose position the axes name, with the other axes anywhere. Beyond a part its curve stays as
//! at its end.
//!
//! # Agreement
//! `val_a_guide_bent_to_a_circle`: 3e-7 µm of 6.8 µm. `val_a_slide_on_a_guide_that_is_worn_in_one_place`: of 0.82 µm
//! P2 to P5 leave 0.50, with splines at the eighths 0.16, at the sixteenths 0.055.
//!
//! # References
//! \[1\] ISO 230-1:2012, clause 3.4 (straightness deviation, reference straight line).

use metrology::ErrorComponent;

use super::form::{CURVE_UM, PLACE_SPLINES, Travel, legendre, place_splines, with_part};
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
    free: &BEND,
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings across the axis over its travel",
    build: |target, values| Box::new(Straightness::new(&target, values)),
};

/// The heights of the curve, the ends of the part of the travel that it is over, and its slope there: about the line through
/// the whole travel it has one.
const BEND: [Parameter; CURVE_UM.len() + 3] = {
    let mut all = with_part::<{ CURVE_UM.len() + 3 }>(CURVE_UM);
    all[CURVE_UM.len() + 2] = Parameter::ordinate("free_p1_um", 500.0, 1.0);
    all
};
/// Place of the lower end of the part among the values.
const BEND_FROM: usize = 2 + CURVE_UM.len();

struct Straightness {
    component: ErrorComponent,
    part_mm: [f64; 2],
    polynomial_mm: [f64; 4],
    slope_mm: f64,
    local_mm: [f64; PLACE_SPLINES],
}

impl Straightness {
    fn new(target: &Target, values: &[f64]) -> Self {
        let part_mm = [values[BEND_FROM], values[BEND_FROM + 1]];
        let is_part = part_mm[0] < part_mm[1];
        Self {
            component: target.component(),
            part_mm,
            slope_mm: if is_part {
                values[BEND_FROM + 2] * 1e-3
            } else {
                0.0
            },
            polynomial_mm: std::array::from_fn(|k| values[k] * 1e-3),
            local_mm: std::array::from_fn(|k| values[4 + k] * 1e-3),
        }
    }
}

impl Effect for Straightness {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::part(scene, self.component.of, self.part_mm);
        let position = &scene.run.motion.position[self.component.of];
        lever::add(scene, self.component, response, |tick| {
            let x = travel.share_within(position[tick], self.part_mm);
            let local_mm = place_splines(&self.local_mm, x); // (2)
            self.slope_mm * x + legendre(2, &self.polynomial_mm, x) + local_mm // (1)
        });
    }
}
