//! Feed-dependent lost motion: friction is greater at slow feeds, and the drive gives way to it by more.
//!
//! # Model
//!
//! The Stribeck part of the friction over the drive's stiffness, in the form of Bo and Pavelescu:
//!
//! ```text
//!   E = -(w/2) sgn(motion) exp(-|v|/v_s)                                  (1)
//!   E += -(w_c/2) (v/v_0),   v_0 = 100 mm/s                               (2)
//! ```
//!
//! (2) is the viscous part. The rest, Coulomb's part, is the same at every feed: `backlash`. The wider form has a friction that
//! is another one along the axis, x the place within the travel, or within the part of it that is given, -1 to 1:
//!
//! ```text
//!   E += -sgn(last motion) (w_1 P_1(x) + .. + w_6 P_6(x)) / 2             (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | w | `width_um`, between both senses at the slowest feed | µm |
//! | v_s | `speed_mm_s` | mm/s |
//! | w_c | `free_viscous_um`, at 100 mm/s | µm |
//! | w_n | `free_by_place_um`, `free_by_place2_um` .. `free_by_place6_um`, of the width | µm |
//! | ends of the part | `free_from_mm`, `free_to_mm` | mm |
//!
//! # Holds when
//! The feed is steady: after a reversal see `reversal_spike`. (3) is the same at every feed.
//!
//! # Agreement
//! `val_a_drive_with_stribeck_friction`: below 1e-10 µm once a drive of second order is steady, at five feeds.
//!
//! # References
//! \[1\] B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7), 1994,
//! doi:10.1016/0005-1098(94)90209-7 (friction models, section 2).

use metrology::Axis;

use super::form::{FROM_MM, TO_MM, WidthByPlace};
use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "feed_lost_motion",
    title: "lost motion that depends on the feed",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("width_um", 300.0, 2.0),
        Parameter::shape("speed_mm_s", [0.1, 100.0], 5.0, &[1.0, 3.0, 10.0, 30.0]),
    ],
    free: &[
        Parameter::amplitude("free_viscous_um", 300.0, 2.0),
        Parameter::amplitude("free_by_place_um", 300.0, 2.0),
        Parameter::amplitude("free_by_place2_um", 300.0, 2.0),
        Parameter::amplitude("free_by_place3_um", 300.0, 2.0),
        Parameter::amplitude("free_by_place4_um", 300.0, 2.0),
        Parameter::amplitude("free_by_place5_um", 300.0, 2.0),
        Parameter::amplitude("free_by_place6_um", 300.0, 2.0),
        FROM_MM,
        TO_MM,
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "motion at two feeds, one of them slow, in both senses",
    build: |target, values| {
        Box::new(FeedLostMotion {
            axis: target.axis(),
            half_mm: values[0] * 0.5e-3,
            speed_mm_s: values[1],
            viscous_s: values[2] * 0.5e-5,
            by_place: WidthByPlace::new(target.axis(), &values[3..]),
        })
    },
};

struct FeedLostMotion {
    axis: Axis,
    half_mm: f64,
    speed_mm_s: f64,
    viscous_s: f64,
    by_place: WidthByPlace,
}

impl Effect for FeedLostMotion {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let ticks = motion.velocity[self.axis]
            .iter()
            .zip(&motion.sense[self.axis]);
        for (sum, (v, sense)) in response.drive[self.axis].iter_mut().zip(ticks) {
            let stribeck_mm = self.half_mm * (-v.abs() / self.speed_mm_s).exp(); // (1)
            *sum -= f64::from(*sense) * stribeck_mm + self.viscous_s * v; // (2)
        }
        self.by_place.add_to(scene, response); // (3)
    }
}
