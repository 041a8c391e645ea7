//! Load deflection: a force bends the frame between slide and tool tip.
//!
//! # Model
//!
//! The force that every recording contains is the inertia of what an axis accelerates, behind its control loops. The frame
//! gives way against it, far below its first resonance in proportion:
//!
//! ```text
//!   tip = -(m/k) a = -a / w0 2                                            (1)
//! ```
//!
//! On a circle (1) makes the radius larger by (m/k) v2/R. The wider form bends across the axis as well.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | m/k | `along_um` at 1 m/s2 | µm |
//! | w0 | angular frequency of the first resonance: 16 µm at 1 m/s2 for 40 Hz | rad/s |
//! | `free_next_um`, `free_after_um` | along the next axis and the one after it, X Y Z X | µm |
//!
//! # Holds when
//! Acceleration changes slowly against the resonance. The encoders do not see it, which tells it from what the
//! control loop leaves. Cutting forces and the weight of workpieces are not recorded and not modelled.
//!
//! # Agreement
//! `val_load_deflection_mass_on_spring`: a mass of 40 Hz carried round a circle, integrated finely, to 0.1 % of
//! 4 µm; what is left is (w/w0)2.
//!
//! # References
//! \[1\] Y. Altintas, A. Verl, C. Brecher, L. Uriarte, G. Pritschow, Machine tool feed drives, CIRP Annals 60(2), 2011,
//! 779-796.

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "load_deflection",
    title: "deflection under load",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("along_um", 100.0, 3.0)],
    free: &[
        Parameter::amplitude("free_next_um", 100.0, 1.0),
        Parameter::amplitude("free_after_um", 100.0, 1.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "an external reference while the axis accelerates",
    build: |target, values| {
        Box::new(LoadDeflection {
            axis: target.axis(),
            compliance_s2: [0, 1, 2].map(|k| values[k] * 1e-3 / STATED_AT_MM_S2),
        })
    },
};

/// Acceleration at which the deflection is stated, mm/s2.
const STATED_AT_MM_S2: f64 = 1000.0;

struct LoadDeflection {
    axis: Axis,
    /// Along the axis, the next and the one after it.
    compliance_s2: [f64; 3],
}

impl Effect for LoadDeflection {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let acceleration = &scene.run.motion.driven[self.axis];
        for (step, compliance_s2) in self.compliance_s2.into_iter().enumerate() {
            if compliance_s2.abs() > 0.0 {
                let sums = &mut response.tip_mm[(self.axis.index() + step) % 3];
                for (sum, acceleration) in sums.iter_mut().zip(acceleration) {
                    *sum -= compliance_s2 * acceleration; // (1)
                }
            }
        }
    }
}
