//! Thermal shift: a body of the machine that a thermometer is on grows, and the tip moves with it.
//!
//! # Model
//!
//! ```text
//!   tau dy/dt = w - y,   w = warming of the thermometer                   (1)
//!   tip = d y                                                             (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | d | `x_um_per_k`, `y_um_per_k`, `z_um_per_k` | µm/K |
//! | tau | `lag_min` | min |
//!
//! # Holds when
//! The same place is read throughout, as by a displacement sensor that stands: what a body's growth makes of other places
//! is for `column_bend`, `screw_elongation` and `workpiece_expansion`. The diagnosis tries it for
//! logs, of the thermometers that a log goes with, and elsewhere in the place of a slow drift that a temperature explains better.
//!
//! No wider form: of a body in which heat spreads a second lag would be a part, which a log hardly tells from another first one.
//!
//! # Agreement
//! `val_thermal_shift_of_a_bar_heated_at_its_end`: a bar whose thermometer is at its warm end, in 40 cells, to 6 % of its
//! growth with the lag of its mean temperature, which is no first order.
//!
//! # References
//! \[1\] ISO 230-3:2020, clause 5 (environmental temperature variation error, ETVE).

use nalgebra::Vector3;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "thermal_shift",
    title: "shift with a temperature",
    targets: Targets::Thermometers,
    parameters: &[
        Parameter::amplitude("x_um_per_k", 200.0, 3.0),
        Parameter::amplitude("y_um_per_k", 200.0, 3.0),
        Parameter::amplitude("z_um_per_k", 200.0, 3.0),
        Parameter::shape(
            "lag_min",
            [0.05, 720.0],
            20.0,
            &[0.5, 3.0, 8.0, 20.0, 50.0, 120.0, 300.0],
        ),
    ],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "a log of one place beside a thermometer whose reading changes",
    build: |target, values| {
        Box::new(ThermalShift {
            thermometer: target.thermometer(),
            shift_mm_per_k: Vector3::new(values[0], values[1], values[2]) * 1e-3,
            lag_s: values[3] * 60.0,
        })
    },
};

struct ThermalShift {
    thermometer: String,
    shift_mm_per_k: Vector3<f64>,
    lag_s: f64,
}

impl Effect for ThermalShift {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(warming_k) = scene.history.warming_k(&self.thermometer) else {
            return;
        };
        let warmed = scene.history.lagged_temperature(&warming_k, self.lag_s); // (1)
        let sums = response.tip_mm.iter_mut().zip(&self.shift_mm_per_k);
        for (sum, shift_mm_per_k) in sums {
            if shift_mm_per_k.abs() > 0.0 {
                scene.add_slow(&warmed, sum, |_| *shift_mm_per_k); // (2)
            }
        }
    }
}
