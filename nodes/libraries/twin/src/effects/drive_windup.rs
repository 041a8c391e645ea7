//! Drive wind-up: screw and coupling yield to the force that accelerates the slide.
//!
//! # Model
//!
//! ```text
//!   E = -(a + f) (c + c_u x) / a_0,   a_0 = 1000 mm/s2                    (1)
//!   f = sgn(last motion) f_0 + f_1 v                                      (2)
//! ```
//!
//! a is the acceleration of the axis behind its control loops. x is the place within the travel, -1 to 1: a screw that is held at one end is softer at the other. The screw drags the
//! slide through the friction of its guides as well: f is `guide_friction` of the machine file, zero where it tells none.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | c | `windup_um`, at 1000 mm/s²: m a_0 / k | µm |
//! | c_u | `free_by_place_um` | µm |
//! | f_0, f_1 | `coulomb_mm_s2`, `viscous_per_s` of the machine file | mm/s², 1/s |
//!
//! # Holds when
//! The motion is slow against the drive's natural frequency. The motor's encoder does not see it; `acceleration_lag`
//! it does.
//!
//! # Agreement
//! `val_a_mass_on_a_spring`: 0.45 % of the wind-up at a fifteenth of the natural frequency.
//! `val_a_spring_that_drags_its_mass_through_friction`: below 1e-5 µm of 5.56 once it is steady.
//!
//! # References
//! \[1\] Y. Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, ch. 6 (design and analysis of CNC systems:
//! feed drives).

use metrology::Axis;

use super::form::Travel;
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "drive_windup",
    title: "wind-up of a drive under acceleration",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("windup_um", 100.0, 2.0)],
    free: &[Parameter::amplitude("free_by_place_um", 100.0, 1.0)],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "readings while the axis accelerates, and its motor or scale",
    build: |target, values| {
        Box::new(DriveWindup {
            axis: target.axis(),
            per_acceleration_s2: values[0] * 1e-6,
            by_place_s2: values[1] * 1e-6,
        })
    },
};

struct DriveWindup {
    axis: Axis,
    per_acceleration_s2: f64,
    by_place_s2: f64,
}

impl Effect for DriveWindup {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let travel = Travel::of(scene, self.axis);
        let linear = scene.machine.linear(self.axis);
        let friction = linear.and_then(|linear| linear.guide_friction);
        let (velocity, sense) = (&motion.velocity[self.axis], &motion.sense[self.axis]);
        let ticks = motion.driven[self.axis]
            .iter()
            .zip(&motion.position[self.axis]);
        let sums = response.drive[self.axis].iter_mut();
        for (tick, (sum, (a, here))) in sums.zip(ticks).enumerate() {
            let compliance = self.per_acceleration_s2 + self.by_place_s2 * travel.share(*here);
            let dragged = friction.map_or(0.0, |friction| {
                let even = f64::from(sense[tick]) * friction.coulomb_mm_s2;
                even + friction.viscous_per_s * velocity[tick] // (2)
            });
            *sum -= (a + dragged) * compliance; // (1)
        }
    }
}
