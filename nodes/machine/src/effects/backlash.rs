//! Backlash: the slide follows its motor only after the play between them is taken up.
//!
//! # Model
//!
//! The play operator between motor m and slide q, of width b:
//!
//! ```text
//!   q - m = max(-b/2, min(b/2, (q - m) before - dm))                      (1)
//!   q - m = -(b/2) sgn(last motion) once the play is taken up             (2)
//! ```
//!
//! Where the run begins before the axis has moved by b the slide stands in the middle of its play. A
//! negative width is a backlash that the control over-compensates: (1) with |b|, its sign turned.
//! The wider form adds steps that fade with the way since the reversal, hats in its logarithm of which the first
//! reaches back to the reversal:
//!
//! ```text
//!   q - m += -sgn(last motion) sum_k f_k h_k(log10 s)                     (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | b | `width_um` | µm |
//! | f_k | `free_0p01mm_um` .. `free_3mm_um` | µm |
//! | s | `since_reversal` | mm |
//!
//! # Holds when
//! The slide stays where it is left. Not modelled: elasticity within the play (presliding).
//!
//! # Agreement
//! `val_a_slide_dragged_through_a_gap`: 2.2 µm, which is how far the contact of that slide yields.
//! `val_the_wider_form_takes_presliding_friction`: of 4.7 µm a step leaves 2.2, with hats 0.43.
//!
//! # References (from memory)
//! \[1\] ISO 230-2:2014, 2.10 (reversal error). \[2\] A. Visintin, Differential Models of Hysteresis,
//! Springer 1994, ch. III (play operator).

use metrology::Axis;

use super::form::{WAY_HATS, way_hats};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "backlash",
    title: "backlash",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("width_um", 30.0, 4.0)],
    free: &[
        Parameter::amplitude("free_0p01mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p03mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p1mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p3mm_um", 30.0, 1.0),
        Parameter::amplitude("free_1mm_um", 30.0, 1.0),
        Parameter::amplitude("free_3mm_um", 30.0, 1.0),
    ],
    moment: Moment::Mean,
    needs: "a reversal of the axis",
    build: |target, values| Box::new(Backlash::new(&target, values)),
};

/// Nearer to the reversal the wider form stays at its first hat's height, as presliding begins there.
const FIRST_HAT_MM: f64 = 0.01;

struct Backlash {
    axis: Axis,
    width_mm: f64,
    free_mm: [f64; WAY_HATS],
}

impl Backlash {
    fn new(target: &Target, values: &[f64]) -> Self {
        let mut free_mm = [0.0; WAY_HATS];
        for (free, value) in free_mm.iter_mut().zip(&values[1..]) {
            *free = value * 1e-3;
        }
        Self {
            axis: target.axis(),
            width_mm: values[0] * 1e-3,
            free_mm,
        }
    }
}

impl Effect for Backlash {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let (position, sense) = (&motion.position[self.axis], &motion.sense[self.axis]);
        let half = 0.5 * self.width_mm.abs();
        let mut lag = 0.0_f64;
        let mut last = position.first().copied().unwrap_or(0.0);
        for (tick, sum) in response.drive[self.axis].iter_mut().enumerate() {
            lag = (lag - (position[tick] - last)).clamp(-half, half); // (1)
            last = position[tick];
            let way = motion.since_reversal[self.axis][tick].max(FIRST_HAT_MM);
            let free_mm = way_hats(&self.free_mm, way);
            *sum += lag * self.width_mm.signum() - f64::from(sense[tick]) * free_mm; // (3)
        }
    }
}
