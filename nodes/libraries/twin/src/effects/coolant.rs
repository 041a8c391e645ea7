//! Coolant: it begins to flow, a wall changes its temperature, and the tip moves along one direction.
//!
//! # Model
//!
//! ```text
//!   tip = A (1 - exp(-(t - t_c)/tau)) for t > t_c, else 0                 (1)
//!   tip += g (u - middle) (1 - exp(-(t - t_c)/tau))                       (2)
//! ```
//!
//! (2) is the wider form: the axis grows with the distance from the middle of its travel too.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | A | `step_um`, in the end | µm |
//! | t_c | `at_min`, since the session began | min |
//! | tau | `lag_min` | min |
//! | g | `free_growth_um_per_m` | µm/m |
//!
//! # Holds when
//! The coolant is switched once. A recording that tells when should fix `at_min`.
//!
//! # Agreement
//! `val_coolant_wall`: a wall between coolant and air, its heat balance integrated finely, to 1e-9 µm of 12.
//!
//! # References
//! \[1\] J. Bryan, International status of thermal error research, CIRP Annals 39(2), 1990, 645-656 (coolants
//! among the six sources of thermal influence).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Instants that are tried for an event, min since the session began.
pub(super) const EVENT_GRID_MIN: &[f64] = &[
    1.0, 2.0, 3.5, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 120.0,
];

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "coolant",
    title: "step of the coolant",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("step_um", 100.0, 8.0),
        Parameter::shape("at_min", [0.0, 1440.0], 20.0, EVENT_GRID_MIN),
        Parameter::shape("lag_min", [0.1, 30.0], 4.0, &[2.0, 8.0]),
    ],
    free: &[Parameter::amplitude("free_growth_um_per_m", 100.0, 8.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "measurements along the direction before and after the coolant begins to flow",
    build: |target, values| {
        Box::new(Coolant {
            axis: target.axis(),
            step_mm: values[0] * 1e-3,
            at_s: values[1] * 60.0,
            lag_s: values[2] * 60.0,
            growth_per_mm: values[3] * 1e-6,
        })
    },
};

struct Coolant {
    axis: Axis,
    step_mm: f64,
    at_s: f64,
    lag_s: f64,
    growth_per_mm: f64,
}

impl Effect for Coolant {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let position = &motion.position[self.axis];
        let middle_mm = scene
            .machine
            .linear(self.axis)
            .map_or(0.0, |axis| 0.5 * (axis.travel_mm[0] + axis.travel_mm[1]));
        let sum = &mut response.tip_mm[self.axis.index()];
        for (tick, (sum, at_s)) in sum.iter_mut().zip(&motion.time_s).enumerate() {
            if *at_s > self.at_s {
                let risen = 1.0 - (-(at_s - self.at_s) / self.lag_s).exp();
                let from_mm = position.get(tick).map_or(0.0, |here| here - middle_mm);
                *sum += risen * (self.step_mm + self.growth_per_mm * from_mm); // (1), (2)
            }
        }
    }
}
