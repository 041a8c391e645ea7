//! Angular error: roll, pitch or yaw of an axis, seen at the tip through its arm.
//!
//! # Model
//!
//! ```text
//!   w = sum_n p_n P_n(x),   n = 1, 2 and, wider, 3, 4                     (1)
//!   w += sum_k f_k b_k(x),   splines with knots at the sixteenths        (2)
//!   E = w times the lever of `volumetric::sensitivity` at the pose        (3)
//! ```
//!
//! x is the place within the travel, or within the part of it that is given, -1 to 1; beyond a part the angle stays as at its end. The mean angle is left out: it is squareness, or the frame.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p_n | `p1_urad`, `p2_urad`, wider form `free_p3_urad`, `free_p4_urad` | µrad |
//! | f_k | `free_1_of_8_urad` .. `free_7_of_8_urad`, `free_1_of_16_urad`, `free_3_of_16_urad` .. `free_15_of_16_urad` | µrad |
//! | ends of the part | `free_from_mm`, `free_to_mm` | mm |
//!
//! # Holds when
//! Angles are small. The straightness that belongs to an angular error is that at the machine's zero of the
//! other axes; only another arm (height, tool offset, place of the other axes) tells the two apart.
//!
//! # Agreement
//! `val_a_table_turned_by_a_rotation_matrix`: 3e-4 µm. `val_the_abbe_offset_makes_the_error`.
//!
//! # References
//! \[1\] ISO 230-1:2012, clause 3.4 (error motions of a linear axis). \[2\] J. B. Bryan, Precision Engineering 1(3), 1979,
//! doi:10.1016/0141-6359(79)90037-0 (the Abbe principle).

use metrology::ErrorComponent;

use super::form::{PLACE_SPLINES, Travel, legendre, place_splines, with_part};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets, lever};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "angular_error",
    title: "angular error",
    targets: Targets::Turning,
    parameters: &[
        Parameter::amplitude("p1_urad", 300.0, 10.0),
        Parameter::amplitude("p2_urad", 300.0, 8.0),
    ],
    free: &TURN,
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "positions over the axis' travel, with two arms",
    build: |target, values| Box::new(AngularError::new(&target, values)),
};

/// Heights of any curve over the travel beside P1 and P2, in the order of [`place_splines`] behind P3 and P4.
const CURVE_URAD: &[Parameter] = &[
    Parameter::ordinate("free_p3_urad", 300.0, 4.0),
    Parameter::ordinate("free_p4_urad", 300.0, 3.0),
    Parameter::ordinate("free_1_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_2_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_3_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_4_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_5_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_6_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_7_of_8_urad", 300.0, 3.0),
    Parameter::ordinate("free_1_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_3_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_5_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_7_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_9_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_11_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_13_of_16_urad", 300.0, 3.0),
    Parameter::ordinate("free_15_of_16_urad", 300.0, 3.0),
];
/// The same, then the ends of the part of the travel that it is over.
const TURN: [Parameter; CURVE_URAD.len() + 2] = with_part(CURVE_URAD);
/// Place of the lower end of the part among the values.
const TURN_FROM: usize = 2 + CURVE_URAD.len();

struct AngularError {
    component: ErrorComponent,
    part_mm: [f64; 2],
    polynomial_rad: [f64; 4],
    local_rad: [f64; PLACE_SPLINES],
}

impl AngularError {
    fn new(target: &Target, values: &[f64]) -> Self {
        Self {
            component: target.component(),
            part_mm: [values[TURN_FROM], values[TURN_FROM + 1]],
            polynomial_rad: std::array::from_fn(|k| values[k] * 1e-6),
            local_rad: std::array::from_fn(|k| values[4 + k] * 1e-6),
        }
    }
}

impl Effect for AngularError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::part(scene, self.component.of, self.part_mm);
        let position = &scene.run.motion.position[self.component.of];
        lever::add(scene, self.component, response, |tick| {
            let x = travel.share_within(position[tick], self.part_mm);
            let local_rad = place_splines(&self.local_rad, x); // (2)
            legendre(1, &self.polynomial_rad, x) + local_rad // (1)
        });
    }
}
