//! Reversal spike: an axis that turns round stays behind until its loop has overcome the friction.
//!
//! # Model
//!
//! Friction changes sign at the reversal, a step for the position loop. A loop with integral action
//! whose dominant poles coincide at 1/w answers such a step by
//!
//! ```text
//!   w^2 e'' + 2 w e' + e = w d'   =>   e(t) = d (t/w) exp(-t/w)           (1)
//!   E = -sgn(motion) h p exp(1 - p),   p = t/w + s/l                      (2)
//! ```
//!
//! where (2) is (1) with its peak h, and in which friction also needs the way l to settle on its new
//! side (presliding): whichever comes first ends the spike. The wider form lets the height grow with
//! the acceleration at the reversal and adds hats over the logarithm of the way:
//!
//! ```text
//!   E += -sgn(motion) (g |a_r| / 100 mm/s2 p exp(1 - p) + sum_k f_k h_k(log10 s))    (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | h | `height_um` | µm |
//! | w | `width_ms` | ms |
//! | l | `length_mm` | mm |
//! | g | `free_at_100mm_s2_um` | µm |
//! | f_k | `free_0p01mm_um` .. `free_3mm_um` | µm |
//! | t, s | `since_reversal_s`, `since_reversal` | s, mm |
//!
//! # Holds when
//! The axis had left its earlier reversal behind. Seen by the motor's encoder, as a servo error.
//!
//! # Agreement
//! `eq1_a_step_into_a_loop_of_two_equal_poles`: 0.1 % of the height.
//! `val_lugre_friction_under_a_cascaded_loop`: of a LuGre drive under position and velocity loops, at two feeds
//! and radii with one height, (2) leaves 39 % of the rms, (3) 31 %.
//!
//! # References (from memory)
//! \[1\] C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Autom. Control 40(3),
//! 1995, doi:10.1109/9.376053 (the friction of the test).

use std::f64::consts::E;

use metrology::Axis;

use super::form::{WAY_HATS, way_hats};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "reversal_spike",
    title: "reversal spike",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("height_um", 30.0, 3.0),
        Parameter::shape(
            "width_ms",
            [0.5, 2000.0],
            15.0,
            &[3.0, 8.0, 20.0, 50.0, 125.0, 1000.0],
        ),
        Parameter::shape(
            "length_mm",
            [0.003, 100.0],
            3.0,
            &[0.01, 0.1, 0.5, 2.0, 8.0, 50.0],
        ),
    ],
    free: &[
        Parameter::amplitude("free_at_100mm_s2_um", 30.0, 1.0),
        Parameter::amplitude("free_0p01mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p03mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p1mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p3mm_um", 30.0, 1.0),
        Parameter::amplitude("free_1mm_um", 30.0, 1.0),
        Parameter::amplitude("free_3mm_um", 30.0, 1.0),
    ],
    moment: Moment::Mean,
    needs: "a reversal of the axis in motion",
    build: |target, values| Box::new(ReversalSpike::new(&target, values)),
};

struct ReversalSpike {
    axis: Axis,
    height_mm: f64,
    width_s: f64,
    length_mm: f64,
    per_acceleration_s2: f64,
    free_mm: [f64; WAY_HATS],
}

impl ReversalSpike {
    fn new(target: &Target, values: &[f64]) -> Self {
        let mut free_mm = [0.0; WAY_HATS];
        for (free, value) in free_mm.iter_mut().zip(&values[4..]) {
            *free = value * 1e-3;
        }
        Self {
            axis: target.axis(),
            height_mm: values[0] * 1e-3,
            width_s: values[1] * 1e-3,
            length_mm: values[2],
            per_acceleration_s2: values[3] * 1e-5,
            free_mm,
        }
    }
}

/// Beyond this many widths nothing is left of a spike: p exp(1 - p) is below 1e-15.
const SPENT: f64 = 40.0;

impl Effect for ReversalSpike {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let (sense, way) = (&motion.sense[self.axis], &motion.since_reversal[self.axis]);
        let time_s = &motion.since_reversal_s[self.axis];
        let is_free = self.free_mm.iter().any(|free| *free != 0.0);
        let (mut height_mm, mut before_s) = (self.height_mm, f64::INFINITY);
        for (tick, sum) in response.servo[self.axis].iter_mut().enumerate() {
            let since_s = time_s[tick];
            if since_s < before_s {
                let turned_at = motion.acceleration[self.axis][tick].abs();
                height_mm = self.height_mm + self.per_acceleration_s2 * turned_at;
            }
            before_s = since_s;
            let p = since_s / self.width_s + way[tick] / self.length_mm;
            let mut behind_mm = 0.0;
            if p < SPENT {
                behind_mm = height_mm * p * E * (-p).exp(); // (2)
            }
            if is_free {
                behind_mm += way_hats(&self.free_mm, way[tick]); // (3)
            }
            *sum -= f64::from(sense[tick]) * behind_mm;
        }
    }
}
