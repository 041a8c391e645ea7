//! Stylus jump: the stylus is bumped, loosens, chips or is exchanged, and touches jump by an offset.
//!
//! # Model
//!
//! ```text
//!   travel = r for t > t_c, else 0                                        (1)
//!   travel -= d . n for t > t_c                                           (2)
//! ```
//!
//! (1) is a ball that has become smaller by r; (2), the wider form, one that sits elsewhere by d: a ball that
//! is ahead meets the surface earlier.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | r | `radius_um` | µm |
//! | t_c | `at_min`, since the session began | min |
//! | d | `free_x_um`, `free_y_um`, `free_z_um`, machine frame | µm |
//!
//! # Holds when
//! It happens once.
//!
//! # Agreement
//! `val_stylus_jump_ring_gauge`: a ring touched all round by a ball that shrank and shifted has the centre and
//! radius that geometry says, to the square of the shift over the radius.
//!
//! # References
//! \[1\] ISO 230-10:2022, 7.1 (touch trigger probes: where the stylus tip sits, tests on ring and sphere).

use nalgebra::Vector3;

use super::coolant::EVENT_GRID_MIN;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "stylus_jump",
    title: "jump of the stylus",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("radius_um", 200.0, 5.0),
        Parameter::shape("at_min", [0.0, 1440.0], 20.0, EVENT_GRID_MIN),
    ],
    free: &[
        Parameter::amplitude("free_x_um", 200.0, 10.0),
        Parameter::amplitude("free_y_um", 200.0, 10.0),
        Parameter::amplitude("free_z_um", 200.0, 10.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "touches of the same surfaces at two times",
    build: |_, values| {
        Box::new(StylusJump {
            radius_mm: values[0] * 1e-3,
            at_s: values[1] * 60.0,
            shift_mm: Vector3::new(values[2], values[3], values[4]) * 1e-3,
        })
    },
};

struct StylusJump {
    radius_mm: f64,
    at_s: f64,
    shift_mm: Vector3<f64>,
}

impl Effect for StylusJump {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        for (travel, touch) in response.travel_mm.iter_mut().zip(&scene.run.touches) {
            if touch.time_s > self.at_s {
                *travel += self.radius_mm - self.shift_mm.dot(&touch.approach); // (1), (2)
            }
        }
    }
}
