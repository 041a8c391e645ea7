//! Drift: the tool wanders slowly against the workpiece along one direction, whatever is measured.
//!
//! # Model
//!
//! ```text
//!   tip = r t                                                             (1)
//!   tip += q t2 + c t3 + k w(t) + sum_i a_i (1 - exp(-t / tau_i))         (2)
//! ```
//!
//! (2) is the wider form; w is the warming of the air (or else of the bed) since the session began. A set-up that was just
//! mounted, a hand's warmth or an open door relax within minutes: tau_i is 1, 4 and 16 min.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | r | `rate_um_per_h` | µm/h |
//! | q, c | `free_square_um_per_h2`, `free_cube_um_per_h3` | µm/h2, µm/h3 |
//! | k | `free_air_um_per_k` | µm/K |
//! | a_i | `free_in_1_min_um`, `free_in_4_min_um`, `free_in_16_min_um` | µm |
//! | t | since the session began | h |
//!
//! # Holds when
//! The drift is one shift of the whole working space. Over hours a polynomial is a poor day: record the air's
//! temperature.
//!
//! # Agreement
//! `val_ambient_drift_etve_day`: the first four hours of a sinusoidal day of 10 µm are met by (1) and (2) to
//! 0.11 µm.
//!
//! # References
//! \[1\] ISO 230-3:2020, clause 5 (environmental temperature variation error, ETVE).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "ambient_drift",
    title: "slow drift",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("rate_um_per_h", 1000.0, 5.0)],
    free: &[
        Parameter::amplitude("free_square_um_per_h2", 200.0, 3.0),
        Parameter::amplitude("free_cube_um_per_h3", 200.0, 1.0),
        Parameter::amplitude("free_air_um_per_k", 50.0, 3.0),
        Parameter::ordinate("free_in_1_min_um", 100.0, 1.0),
        Parameter::ordinate("free_in_4_min_um", 100.0, 1.0),
        Parameter::ordinate("free_in_16_min_um", 100.0, 1.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "measurements along the direction at two times, without a new set-up between them",
    build: |target, values| {
        Box::new(AmbientDrift {
            axis: target.axis(),
            by_time_mm: [0, 1, 2].map(|k| values[k] * 1e-3),
            by_air_mm_per_k: values[3] * 1e-3,
            relaxing_mm: [4, 5, 6].map(|k| values[k] * 1e-3),
        })
    },
};

const SECONDS_PER_HOUR: f64 = 3600.0;
/// tau_i, s.
const RELAXES_S: [f64; 3] = [60.0, 240.0, 960.0];

struct AmbientDrift {
    axis: Axis,
    by_time_mm: [f64; 3],
    by_air_mm_per_k: f64,
    relaxing_mm: [f64; 3],
}

impl Effect for AmbientDrift {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let sum = &mut response.tip_mm[self.axis.index()];
        let [rate, square, cube] = self.by_time_mm;
        for (sum, at_s) in sum.iter_mut().zip(&scene.run.motion.time_s) {
            let at_h = at_s / SECONDS_PER_HOUR;
            *sum += at_h * (rate + at_h * (square + at_h * cube)); // (1), (2)
        }
        for (relaxing_mm, relaxes_s) in self.relaxing_mm.into_iter().zip(RELAXES_S) {
            if relaxing_mm.abs() > 0.0 {
                let relaxed = |at_s: f64| 1.0 - (-at_s.max(0.0) / relaxes_s).exp();
                for (sum, at_s) in sum.iter_mut().zip(&scene.run.motion.time_s) {
                    *sum += relaxing_mm * relaxed(*at_s);
                }
            }
        }
        if self.by_air_mm_per_k.abs() > 0.0 {
            let places = [SensorPlace::Ambient, SensorPlace::Bed];
            let warming_k = scene.warming_k(&places).unwrap_or_default();
            scene.add_slow(&warming_k, sum, |_| self.by_air_mm_per_k);
        }
    }
}
