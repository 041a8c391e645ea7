//! Workpiece expansion: a workpiece that is not at 20 °C and grows otherwise than the machine's scales.
//!
//! # Model
//!
//! A surface at r from the machine's origin has moved away from it, so that a ball meets it further on:
//!
//! ```text
//!   tau dT/dt = T_air - T,   T(0) = T_air(0)                              (1)
//!   travel = (alpha_w - alpha_m) (T - 20 degC) r . n                      (2)
//! ```
//!
//! The wider form has a growth of its own along each axis (clamping, a part of two materials).
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | alpha_w - alpha_m | `difference_um_per_m_k` | µm/(m K) |
//! | tau | `lag_min` | min |
//! | `free_y_um_per_m_k`, `free_z_um_per_m_k` | more than in X along Y and Z | µm/(m K) |
//! | n | unit vector of the approach | 1 |
//!
//! # Holds when
//! Workpiece and scales have one temperature, that of the air with a lag. Only touches see the workpiece. The
//! point that does not move is near the machine's origin; another one is an offset of the set-up.
//!
//! # Agreement
//! `val_workpiece_expansion_npl_steel_rod`: the worked example \[3\], 500.035 mm at 23.7 °C and 500.013 mm at 20 °C, to its
//! last digit.
//!
//! # References
//! \[1\] ISO 1:2022 (reference temperature of 20 °C). \[2\] ISO/TR 16015:2003 (nominal differential expansion).
//! \[3\] National Physical Laboratory, How do I correct lengths to 20 °C? (worked example of a steel rod).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "workpiece_expansion",
    title: "expansion of the workpiece",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("difference_um_per_m_k", 30.0, 8.0),
        Parameter::shape("lag_min", [0.1, 480.0], 30.0, &[1.0, 20.0, 90.0]),
    ],
    free: &[
        Parameter::amplitude("free_y_um_per_m_k", 30.0, 4.0),
        Parameter::amplitude("free_z_um_per_m_k", 30.0, 4.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "touches at two places and a thermometer in the shop that is not at 20 °C",
    build: |_, values| {
        let common = values[0];
        Box::new(WorkpieceExpansion {
            per_k: [common, common + values[2], common + values[3]].map(|v| v * 1e-6),
            lag_s: values[1] * 60.0,
        })
    },
};

const REFERENCE_DEGC: f64 = 20.0;

struct WorkpieceExpansion {
    per_k: [f64; 3],
    lag_s: f64,
}

impl Effect for WorkpieceExpansion {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let places = [SensorPlace::Ambient, SensorPlace::Bed];
        let Some(air_k) = scene.above_k(&places, REFERENCE_DEGC) else {
            return;
        };
        let first_k = air_k.first().copied().unwrap_or(0.0);
        let change: Vec<f64> = air_k.iter().map(|k| k - first_k).collect();
        let workpiece_k = scene.history.lagged_temperature(&change, self.lag_s); // (1)
        for (travel, touch) in response.travel_mm.iter_mut().zip(&scene.run.touches) {
            let above_k = first_k + scene.history.at(&workpiece_k, touch.time_s);
            let along =
                |(k, axis): (usize, Axis)| self.per_k[k] * touch.position[axis] * touch.approach[k];
            let per_k: f64 = Axis::LINEAR.into_iter().enumerate().map(along).sum();
            *travel += above_k * per_k; // (2)
        }
    }
}
