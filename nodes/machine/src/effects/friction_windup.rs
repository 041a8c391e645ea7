//! Friction wind-up: a screw that drags its slide is stretched by the friction, the more the longer it is.
//!
//! # Model
//!
//! With d the distance from the fixed bearing at the low end of the travel (d' from its high end) and s the
//! way since the last reversal:
//!
//! ```text
//!   E = -sgn(motion) (1 - 2 exp(-s/l)) (w d + w' d')                      (1)
//! ```
//!
//! w = F / (E A), friction over the stiffness of a metre of screw; the friction turns round within the way l.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | w, w' | `windup_um_per_m`, `free_from_high_um_per_m` | µm/m |
//! | l | `presliding_mm` | mm |
//!
//! # Holds when
//! The motor's encoder closes the loop. `backlash` is the same everywhere on the travel, this is not.
//!
//! # Agreement
//! `val_hooke_s_law_of_a_screw`: below 1e-6 µm, at three places.
//!
//! # References (from memory)
//! \[1\] ISO 230-2:2014, clause 3 (reversal value along the axis). \[2\] ISO 3408-4:2006 (axial rigidity of
//! ball screws).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::twin::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "friction_windup",
    title: "wind-up of a screw under friction",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("windup_um_per_m", 100.0, 5.0),
        Parameter::shape("presliding_mm", [0.001, 10.0], 0.05, &[0.01, 0.1, 1.0]),
    ],
    free: &[Parameter::amplitude("free_from_high_um_per_m", 100.0, 5.0)],
    moment: Moment::Mean,
    needs: "reversals of the axis at two places",
    build: |target, values| {
        Box::new(FrictionWindup {
            axis: target.axis(),
            from_low: values[0] * 1e-6,
            presliding_mm: values[1],
            from_high: values[2] * 1e-6,
        })
    },
};

struct FrictionWindup {
    axis: Axis,
    from_low: f64,
    presliding_mm: f64,
    from_high: f64,
}

impl Effect for FrictionWindup {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(linear) = scene.machine.linear(self.axis) else {
            return;
        };
        let [low_mm, high_mm] = linear.travel_mm;
        let motion = &scene.run.motion;
        let (sense, way) = (&motion.sense[self.axis], &motion.since_reversal[self.axis]);
        let position = &motion.position[self.axis];
        for (tick, sum) in response.drive[self.axis].iter_mut().enumerate() {
            let stretch_mm = self.from_low * (position[tick] - low_mm)
                + self.from_high * (high_mm - position[tick]);
            let turned = 1.0 - 2.0 * (-way[tick] / self.presliding_mm).exp();
            *sum -= f64::from(sense[tick]) * turned * stretch_mm; // (1)
        }
    }
}
