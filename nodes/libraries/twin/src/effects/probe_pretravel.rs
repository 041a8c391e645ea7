//! Probe pretravel: how far the ball goes on after it met the surface until the probe triggers.
//!
//! # Model
//!
//! With n the approach, lateral and axial touches need different ways. Under a constant triggering force the
//! stylus bends with the third power of its length, under a constant moment with the second:
//!
//! ```text
//!   travel = p_l |n_lateral|2 (L/L_m)^e + p_a n_z2                        (1)
//!   bending under a force F at the end:  F L3 / (3 E I)                   (2)
//! ```
//!
//! A ball whose effective radius is wrong adds the same in every direction, dr = -(p_l = p_a), and is contained.
//! The wider form lets opposite sides differ, as a bent stylus or run-out makes them, and slanting touches need
//! more than their parts, as in a seat whose lever shortens with the height on the ball:
//!
//! ```text
//!   travel += b . n + 4 c |n_lateral|2 n_z2                               (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | p_l, p_a | `lateral_um` with the mounted stylus, `axial_um` | µm |
//! | e | `length_exponent` | 1 |
//! | L, L_m | `stem_length_mm` of the stylus of the run and of the mounted one, else `length_mm` | mm |
//! | b | `free_x_um`, `free_y_um`, `free_z_um` | µm |
//! | c | `free_slant_um`, at 45 degrees | µm |
//!
//! # Holds when
//! The stylus is slender and the probe's axis is Z. Feed does not matter; what it adds is `probe_latency`.
//!
//! # Agreement
//! `val_probe_pretravel_cantilever`: carbide stems of 50 and 100 mm bent by 0.2 N, the beam's equation
//! integrated finely, to 1e-9 of the bending. `val_probe_pretravel_three_point_seat`: the moments about
//! the edges of a seat, over a hemisphere: (1) leaves 16 %, the wider form with that of `probe_lobing` 2.5 %.
//!
//! # References
//! \[1\] ISO 230-10:2022 (probing performance). \[2\] R. Hibbeler, Mechanics of Materials, appendix C (deflection
//! of a cantilever).

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::{Response, Run};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "probe_pretravel",
    title: "pretravel of the probe",
    targets: Targets::Machine,
    parameters: &[
        Parameter::amplitude("lateral_um", 50.0, 5.0),
        Parameter::amplitude("axial_um", 50.0, 3.0),
        Parameter::shape("length_exponent", [0.0, 4.0], 3.0, &[2.0, 3.0]),
    ],
    free: &[
        Parameter::amplitude("free_x_um", 50.0, 3.0),
        Parameter::amplitude("free_y_um", 50.0, 3.0),
        Parameter::amplitude("free_z_um", 50.0, 3.0),
        Parameter::amplitude("free_slant_um", 50.0, 1.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "touches of known surfaces from both sides, or along the probe's axis and across it",
    build: |_, values| {
        Box::new(ProbePretravel {
            lateral_mm: values[0] * 1e-3,
            axial_mm: values[1] * 1e-3,
            exponent: values[2],
            sided_mm: [3, 4, 5].map(|k| values[k] * 1e-3),
            slant_mm: values[6] * 1e-3,
        })
    },
};

struct ProbePretravel {
    lateral_mm: f64,
    axial_mm: f64,
    exponent: f64,
    sided_mm: [f64; 3],
    slant_mm: f64,
}

impl Effect for ProbePretravel {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let longer = length_ratio(scene, scene.run).powf(self.exponent);
        for (travel, touch) in response.travel_mm.iter_mut().zip(&scene.run.touches) {
            let n = touch.approach;
            let lateral = n.x * n.x + n.y * n.y;
            *travel += self.lateral_mm * lateral * longer + self.axial_mm * n.z * n.z; // (1)
            let [x, y, z] = self.sided_mm;
            *travel += x * n.x + y * n.y + z * n.z + 4.0 * self.slant_mm * lateral * n.z * n.z; // (3)
        }
    }
}

/// Length of the run's stylus over that of the mounted one; 1 where either is unknown.
pub(super) fn length_ratio(scene: &Scene<'_>, run: &Run) -> f64 {
    let of_run = scene.machine.probe.styli.get(&run.segment.stylus);
    match (of_run, scene.machine.mounted_stylus()) {
        (Some(of_run), Some(mounted)) => of_run.bending_length_mm() / mounted.bending_length_mm(),
        _ => 1.0,
    }
}
