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
//! The wider form adds steps that fade with the way since the reversal, hats in its logarithm:
//!
//! ```text
//!   q - m += -sgn(last motion) sum_k f_k h_k(log10 s)                     (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | b | `width_um` | µm |
//! | f_k | `free_0p03mm_um` .. `free_3mm_um` | µm |
//! | s | `since_reversal` | mm |
//!
//! # Holds when
//! The slide stays where it is left. Not modelled: elasticity within the play (presliding).
//!
//! # References
//! \[1\] ISO 230-2:2014, 2.10 (reversal error). \[2\] A. Visintin, Differential Models of Hysteresis,
//! Springer 1994, ch. III (play operator).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Role, Scene, Target, Targets};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "backlash",
    title: "backlash",
    targets: Targets::LinearAxes,
    parameters: &[Parameter {
        name: "width_um",
        role: Role::Amplitude,
        low: -30.0,
        high: 30.0,
        typical: 4.0,
    }],
    free: &[
        hat("free_0p03mm_um"),
        hat("free_0p1mm_um"),
        hat("free_0p3mm_um"),
        hat("free_1mm_um"),
        hat("free_3mm_um"),
    ],
    moment: Moment::Mean,
    needs: "a reversal of the axis",
    build: |target, values| Box::new(Backlash::new(&target, values)),
};

const fn hat(name: &'static str) -> Parameter {
    Parameter {
        name,
        role: Role::Amplitude,
        low: -30.0,
        high: 30.0,
        typical: 1.0,
    }
}

/// Places of the hats, decimal logarithm of mm since the reversal.
const HATS: [f64; 5] = [-1.5, -1.0, -0.5, 0.0, 0.5];

struct Backlash {
    axis: Axis,
    width_mm: f64,
    free_mm: [f64; 5],
}

impl Backlash {
    fn new(target: &Target, values: &[f64]) -> Self {
        let Target::Axis(axis) = target else {
            unreachable!("the kind acts on axes only")
        };
        let mut free_mm = [0.0; 5];
        for (free, value) in free_mm.iter_mut().zip(&values[1..]) {
            *free = value * 1e-3;
        }
        Self {
            axis: *axis,
            width_mm: values[0] * 1e-3,
            free_mm,
        }
    }

    fn free_at_mm(&self, way_mm: f64) -> f64 {
        let place = way_mm.max(1e-9).log10();
        let hat = |(at, height): (&f64, &f64)| height * (1.0 - (place - at).abs() / 0.5).max(0.0);
        HATS.iter().zip(&self.free_mm).map(hat).sum()
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
            let free_mm = self.free_at_mm(motion.since_reversal[self.axis][tick]);
            *sum += lag * self.width_mm.signum() - f64::from(sense[tick]) * free_mm; // (3)
        }
    }
}
