//! Column bend: one side of the frame warms before the other, and the head shifts and tilts.
//!
//! # Model
//!
//! The difference w of column and surroundings drives a bend that follows with a lag; the head shifts and
//! turns about the machine's origin, so that what the tool side of the chain has moved is an arm:
//!
//! ```text
//!   tau dy/dt = w - y,   w = warming of column - warming of ambient       (1)
//!   tip = y (d + theta x r)                                               (2)
//! ```
//!
//! where there is no pair, w is the warming of the column, the ambient or the bed, the first that is read.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | d | `y_um_per_k`, `z_um_per_k`, `free_x_um_per_k` | µm/K |
//! | theta | `tilt_x_urad_per_k`, `free_tilt_y_urad_per_k`, `free_tilt_z_urad_per_k` | µrad/K |
//! | tau | `lag_min` | min |
//! | r | positions of the tool side's linear axes and the tool offset | mm |
//!
//! # Holds when
//! The column stands behind the table, so that it bends in the plane of Y and Z; the wider form has the other
//! directions. The bend is small and one number. A thermometer may itself be as slow as the frame of a small machine: the
//! lag between the two may be next to nothing.
//!
//! # Agreement
//! `val_column_bend_timoshenko_strip`: shift and tilt of a column whose sides differ in temperature, by the
//! curvature alpha dT/h and a head turned as a rigid body, to 3e-4 µm of 29.
//!
//! # References
//! \[1\] ISO 230-3:2020, clause 5 (environmental temperature variation error, ETVE). \[2\] S. P. Timoshenko,
//! Analysis of bi-metal thermostats, J. Opt. Soc. Am. 11(3), 1925, 233-255.

use metrology::Axis;
use nalgebra::Vector3;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;
use machine::file::SensorPlace;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "column_bend",
    title: "bend of the column",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("y_um_per_k", 100.0, 5.0),
        Parameter::amplitude("z_um_per_k", 100.0, 5.0),
        Parameter::amplitude("tilt_x_urad_per_k", 100.0, 8.0),
        Parameter::shape(
            "lag_min",
            [0.05, 480.0],
            60.0,
            &[0.5, 5.0, 20.0, 60.0, 180.0, 360.0],
        ),
    ],
    free: &[
        Parameter::amplitude("free_x_um_per_k", 100.0, 2.0),
        Parameter::amplitude("free_tilt_y_urad_per_k", 100.0, 4.0),
        Parameter::amplitude("free_tilt_z_urad_per_k", 100.0, 2.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "a thermometer on the column or in the shop whose reading changes",
    build: |_, values| {
        Box::new(ColumnBend {
            shift_mm_per_k: Vector3::new(values[4], values[0], values[1]) * 1e-3,
            tilt_rad_per_k: Vector3::new(values[2], values[5], values[6]) * 1e-6,
            lag_s: values[3] * 60.0,
        })
    },
};

struct ColumnBend {
    shift_mm_per_k: Vector3<f64>,
    tilt_rad_per_k: Vector3<f64>,
    lag_s: f64,
}

impl Effect for ColumnBend {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(gradient_k) = gradient_k(scene) else {
            return;
        };
        let bend = scene.history.lagged_temperature(&gradient_k, self.lag_s); // (1)
        let position = &scene.run.motion.position;
        let on_tool_side =
            Axis::LINEAR.map(|axis| scene.kinematics.chain().tool_side().contains(&axis));
        let offset_mm = scene.run.segment.tool_offset_mm;
        let arm_mm = |tick: usize| {
            Vector3::from_fn(|k, _| {
                let moved = position[Axis::LINEAR[k]].get(tick).copied().unwrap_or(0.0);
                offset_mm[k] + if on_tool_side[k] { moved } else { 0.0 }
            })
        };
        for (k, sum) in response.tip_mm.iter_mut().enumerate() {
            scene.add_slow(&bend, sum, |tick| {
                (self.shift_mm_per_k + self.tilt_rad_per_k.cross(&arm_mm(tick)))[k] // (2)
            });
        }
    }
}

fn gradient_k(scene: &Scene<'_>) -> Option<Vec<f64>> {
    let column = scene.warming_k(&[SensorPlace::Column]);
    let ambient = scene.warming_k(&[SensorPlace::Ambient]);
    match (column, ambient) {
        (Some(column), Some(ambient)) => {
            Some(column.iter().zip(ambient).map(|(c, a)| c - a).collect())
        }
        (one, other) => one
            .or(other)
            .or_else(|| scene.warming_k(&[SensorPlace::Bed])),
    }
}
