//! Probe lobing: a seat of three supports triggers later in some directions than in others.
//!
//! # Model
//!
//! ```text
//!   travel = |n_lateral|2 sum_k (a_k cos k phi + b_k sin k phi)           (1)
//! ```
//!
//! with k = 3 for three supports; k = 2, 4, 5, 6 are the wider form (an oval ball, a tilted seat, the lobes'
//! own shape). k = 1 is where the ball is and k = 0 its radius: `probe_pretravel`.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | a_3, b_3 | `three_cos_um`, `three_sin_um` | µm |
//! | a_k, b_k | `free_<k>_cos_um`, `free_<k>_sin_um` | µm |
//! | phi | direction of the approach in the plane across the probe, from X towards Y | rad |
//!
//! # Holds when
//! The probe's axis is Z and the spindle is oriented the same way for every touch.
//!
//! # Agreement
//! `val_probe_lobing_triangle_of_supports`: the triggering lever of a three-point seat, r/2 over an edge and r
//! over a support, is met by k = 3 and 6 to 5 % of its mean, of a shape of 21 %; k = 2, 4, 5 vanish.
//!
//! # References
//! \[1\] F. M. Chan, E. J. Davis, T. G. King, K. J. Stout, Some performance characteristics of a multi-axis touch
//! trigger probe, Meas. Sci. Technol. 8(8), 1997, 837 (three-lobed pretravel variation).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "probe_lobing",
    title: "lobing of the probe",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("three_cos_um", 15.0, 1.0),
        Parameter::amplitude("three_sin_um", 15.0, 1.0),
    ],
    free: &[
        Parameter::amplitude("free_2_cos_um", 15.0, 0.5),
        Parameter::amplitude("free_2_sin_um", 15.0, 0.5),
        Parameter::amplitude("free_4_cos_um", 15.0, 0.5),
        Parameter::amplitude("free_4_sin_um", 15.0, 0.5),
        Parameter::amplitude("free_5_cos_um", 15.0, 0.5),
        Parameter::amplitude("free_5_sin_um", 15.0, 0.5),
        Parameter::amplitude("free_6_cos_um", 15.0, 0.5),
        Parameter::amplitude("free_6_sin_um", 15.0, 0.5),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "touches all round a bore, a boss or a sphere",
    build: |_, values| {
        let pair = |k: usize| [values[k] * 1e-3, values[k + 1] * 1e-3];
        Box::new(ProbeLobing {
            lobes_mm: [pair(2), pair(0), pair(4), pair(6), pair(8)],
        })
    },
};

struct ProbeLobing {
    /// Cosine and sine of the harmonics 2 to 6.
    lobes_mm: [[f64; 2]; 5],
}

impl Effect for ProbeLobing {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        for (travel, touch) in response.travel_mm.iter_mut().zip(&scene.run.touches) {
            let n = touch.approach;
            let lateral = n.x * n.x + n.y * n.y;
            let angle_rad = n.y.atan2(n.x);
            let mut harmonic = 2.0;
            for [cos_mm, sin_mm] in self.lobes_mm {
                let (sin, cos) = (harmonic * angle_rad).sin_cos();
                *travel += lateral * (cos_mm * cos + sin_mm * sin); // (1)
                harmonic += 1.0;
            }
        }
    }
}
