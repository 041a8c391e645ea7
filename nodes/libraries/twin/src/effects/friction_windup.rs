//! Friction wind-up: a screw that drags its slide is stretched by the friction, the more the longer it is.
//!
//! # Model
//!
//! With the axis at x, the middle of its travel at m, half of its travel h, and s the way since the last reversal:
//!
//! ```text
//!   E = -sgn(motion) (1 - 2 exp(-s/l)) w |x - (m + b h)|                  (1)
//! ```
//!
//! w = F / (E A), friction over the stiffness of a metre of screw; b says where the fixed bearing is: -1 at the low end
//! of the travel, 1 at its high end, beyond these where the screw is longer; the friction turns round within the way l.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | w | `windup_um_per_m` | µm/m |
//! | l | `presliding_mm` | mm |
//! | b | `bearing_half_travels` | half travels |
//!
//! # Holds when
//! The motor's encoder closes the loop; the screw is fixed at one end. `backlash` is the same everywhere on the travel, this
//! is not: no value of b makes it so.
//!
//! No wider form: the stretch of a uniform screw is a straight line from its bearing (Hooke), and the bearing's place and the
//! way in which the friction turns round are its shapes. What is alike all over the travel has its hats in `backlash`.
//!
//! # Agreement
//! `val_hooke_s_law_of_a_screw`: below 1e-6 µm, at three places.
//!
//! # References
//! \[1\] ISO 230-2:2014, clause 3 (reversal value along the axis). \[2\] ISO 3408-4:2006 (axial rigidity of
//! ball screws).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "friction_windup",
    title: "wind-up of a screw under friction",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("windup_um_per_m", 100.0, 5.0),
        Parameter::shape("presliding_mm", [0.001, 10.0], 0.05, &[0.01, 0.1, 1.0]),
        Parameter::shape("bearing_half_travels", [-1.6, 1.6], 1.0, &[-1.2, 1.2]),
    ],
    free: &[],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "reversals of the axis at two places",
    build: |target, values| {
        Box::new(FrictionWindup {
            axis: target.axis(),
            stretch: values[0] * 1e-6,
            presliding_mm: values[1],
            bearing_half_travels: values[2],
        })
    },
};

struct FrictionWindup {
    axis: Axis,
    stretch: f64,
    presliding_mm: f64,
    bearing_half_travels: f64,
}

impl Effect for FrictionWindup {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let Some(linear) = scene.machine.linear(self.axis) else {
            return;
        };
        let [low_mm, high_mm] = linear.travel_mm;
        let (middle_mm, half_mm) = (f64::midpoint(low_mm, high_mm), 0.5 * (high_mm - low_mm));
        let bearing_mm = middle_mm + self.bearing_half_travels * half_mm;
        let motion = &scene.run.motion;
        let (sense, way) = (&motion.sense[self.axis], &motion.since_reversal[self.axis]);
        let position = &motion.position[self.axis];
        for (tick, sum) in response.drive[self.axis].iter_mut().enumerate() {
            let stretch_mm = self.stretch * (position[tick] - bearing_mm).abs();
            let turned = 1.0 - 2.0 * (-way[tick] / self.presliding_mm).exp();
            *sum -= f64::from(sense[tick]) * turned * stretch_mm; // (1)
        }
    }
}
