//! Plate error: the grid of a grid encoder is itself stretched, out of square and curved.
//!
//! # Model
//!
//! With u, v from the plate's centre in its own plane, reading less position:
//!
//! ```text
//!   du = s_u u + (q/2) v,   dv = s_v v + (q/2) u                          (1)
//!   du += (a u2 + b u v + c v2) / R,   dv += (d u2 + e u v + f v2) / R    (2)
//! ```
//!
//! (2) is the wider form, R = 100 mm. (q/2) in both leaves the rotation of the plate, which is set-up, aside.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s_u, s_v | `scale_u_um_per_m`, `scale_v_um_per_m` | µm/m |
//! | q | `squareness_um_per_m` | µm/m |
//! | a .. f | `free_u_uu_um_per_m` .. `free_v_vv_um_per_m`, slope at R | µm/m |
//!
//! # Holds when
//! The plate lies where the machine file's placement of the run's plane says. On one placement scale and
//! squareness of plate and machine are the same; a placement elsewhere or turned by 90 degrees tells them apart.
//!
//! # Agreement
//! `val_plate_error_reversal`: a plate turned by 90 degrees shows its squareness with the other sign, the
//! machine's with the same.
//!
//! # References
//! \[1\] C. J. Evans, R. J. Hocken, W. T. Estler, Self-calibration: reversal, redundancy, error separation, and "absolute
//! testing", CIRP Annals 45(2), 1996, 617-634.

use metrology::sample::TestPlane;
use nalgebra::Vector3;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;
use crate::simulate::plate;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "plate_error",
    title: "error of the grid plate",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("scale_u_um_per_m", 100.0, 3.0),
        Parameter::amplitude("scale_v_um_per_m", 100.0, 3.0),
        Parameter::amplitude("squareness_um_per_m", 100.0, 3.0),
    ],
    free: &[
        Parameter::amplitude("free_u_uu_um_per_m", 100.0, 2.0),
        Parameter::amplitude("free_u_uv_um_per_m", 100.0, 2.0),
        Parameter::amplitude("free_u_vv_um_per_m", 100.0, 2.0),
        Parameter::amplitude("free_v_uu_um_per_m", 100.0, 2.0),
        Parameter::amplitude("free_v_uv_um_per_m", 100.0, 2.0),
        Parameter::amplitude("free_v_vv_um_per_m", 100.0, 2.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "contours on the grid encoder at two placements",
    build: |_, values| {
        let per_mm = |k: usize| values[k] * 1e-6;
        Box::new(PlateError {
            scale: [per_mm(0), per_mm(1)],
            squareness: per_mm(2),
            curved: [
                [per_mm(3), per_mm(4), per_mm(5)],
                [per_mm(6), per_mm(7), per_mm(8)],
            ],
        })
    },
};

/// Distance from the plate's centre at which the slopes of (2) are stated, mm.
const STATED_AT_MM: f64 = 100.0;

struct PlateError {
    scale: [f64; 2],
    squareness: f64,
    curved: [[f64; 3]; 2],
}

impl PlateError {
    fn at_mm(&self, u: f64, v: f64) -> [f64; 2] {
        let curved = |[uu, uv, vv]: [f64; 3]| (uu * u * u + uv * u * v + vv * v * v) / STATED_AT_MM;
        let half = 0.5 * self.squareness;
        [
            self.scale[0] * u + half * v + curved(self.curved[0]),
            self.scale[1] * v + half * u + curved(self.curved[1]),
        ]
    }
}

impl Effect for PlateError {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let run = scene.run;
        if run.segment.plane == TestPlane::None {
            return;
        }
        let (along_u, along_v) = (plate(run, 0), plate(run, 1));
        let centre_mm = centre_mm(scene);
        let [x, y, z] = [0, 1, 2].map(|k| &run.motion.position.0[k]);
        let [of_u, of_v] = &mut response.grid_reading_mm;
        let at = |series: &[f64], tick: usize| series.get(tick).copied().unwrap_or(0.0);
        for (tick, (of_u, of_v)) in of_u.iter_mut().zip(of_v).enumerate() {
            let from_mm = Vector3::new(at(x, tick), at(y, tick), at(z, tick)) - centre_mm;
            let [du, dv] = self.at_mm(from_mm.dot(&along_u), from_mm.dot(&along_v)); // (1), (2)
            *of_u += du;
            *of_v += dv;
        }
    }
}

/// Axis positions over the plate's centre; the centre of the test where no placement fits.
fn centre_mm(scene: &Scene<'_>) -> Vector3<f64> {
    let segment = &scene.run.segment;
    let placements = scene
        .machine
        .grid_encoder
        .iter()
        .flat_map(|grid| &grid.placements);
    let fits = |offset: [f64; 3]| (Vector3::from(offset) - segment.tool_offset_mm).norm() < 1e-6;
    placements
        .filter(|p| TestPlane::from(p.plane) == segment.plane)
        .find(|p| fits(p.tool_offset_mm))
        .map_or(segment.centre_mm, |p| p.axes_at_centre_mm())
}
