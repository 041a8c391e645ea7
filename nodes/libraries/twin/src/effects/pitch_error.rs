//! Pitch error: the lead of a screw that differs along it.
//!
//! # Model
//!
//! Legendre polynomials of the place x within the travel, or within the part of it that is given, -1 to 1; the linear part is
//! `scale_error`:
//!
//! ```text
//!   E = sum_n p_n P_n(x)                                                  (1)
//!   E += sum_k f_k (b_k(x) - s_k x),   splines with knots at the sixteenths        (2)
//! ```
//!
//! s_k is the slope of the least-squares line through b_k, so that a slope is `scale_error` alone.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p_n | `p2_um`, `p3_um`, wider form `free_p4_um`, `free_p5_um` | µm |
//! | f_k | `free_1_of_8_um` .. `free_7_of_8_um`, `free_1_of_16_um`, `free_3_of_16_um` .. `free_15_of_16_um` | µm |
//! | ends of the part | `free_from_mm`, `free_to_mm` | mm |
//!
//! # Holds when
//! The error is of the screw, between motor and slide. Not modelled: a period shorter than an eighth of the
//! travel or part (see `cyclic_error`). Beyond a part its polynomials go on, and its splines stay as at its end.
//!
//! # Agreement
//! `val_a_screw_of_drifting_lead`: of 1.44 µm with a bump 0.1 m long, (1) leaves 0.44, splines at the
//! eighths 0.065, at the sixteenths 0.003.
//!
//! # References
//! \[1\] ISO 230-2:2014, clause 3 (positioning deviations). \[2\] ISO 3408-3:2006 (travel deviation of
//! ball screws).

use metrology::Axis;

use super::form::{
    CURVE_UM, PLACE_SPLINES, Travel, legendre, place_splines, slope_of_splines, with_part,
};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "pitch_error",
    title: "pitch error",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("p2_um", 500.0, 4.0),
        Parameter::amplitude("p3_um", 500.0, 3.0),
    ],
    free: &CURVE,
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "positions over the axis' travel",
    build: |target, values| Box::new(PitchError::new(&target, values)),
};

/// The heights of the curve, then the ends of the part of the travel that it is over.
const CURVE: [Parameter; CURVE_UM.len() + 2] = with_part(CURVE_UM);

/// Place of the lower end of the part among the values.
const FROM: usize = 2 + CURVE_UM.len();

struct PitchError {
    axis: Axis,
    part_mm: [f64; 2],
    polynomial_mm: [f64; 4],
    local_mm: [f64; PLACE_SPLINES],
    /// Sum of f_k s_k.
    slope_mm: f64,
}

impl PitchError {
    fn new(target: &Target, values: &[f64]) -> Self {
        let local_mm = std::array::from_fn(|k| values[4 + k] * 1e-3);
        Self {
            axis: target.axis(),
            part_mm: [values[FROM], values[FROM + 1]],
            polynomial_mm: std::array::from_fn(|k| values[k] * 1e-3),
            local_mm,
            slope_mm: slope_of_splines(&local_mm),
        }
    }
}

impl Effect for PitchError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let travel = Travel::part(scene, self.axis, self.part_mm);
        let is_local = self.local_mm.iter().any(|height| *height != 0.0);
        let position = &scene.run.motion.position[self.axis];
        for (sum, here) in response.drive[self.axis].iter_mut().zip(position) {
            let x = travel.share(*here);
            *sum += legendre(2, &self.polynomial_mm, x); // (1)
            if is_local {
                *sum += place_splines(&self.local_mm, x) - self.slope_mm * x.clamp(-1.0, 1.0); // (2)
            }
        }
    }
}
