//! Stick-slip: below a critical feed an axis stands and jumps instead of creeping.
//!
//! # Model
//!
//! A saw-tooth of height h, whose phase does not repeat, has a variance of h2/12; the height goes to zero at
//! the critical feed:
//!
//! ```text
//!   variance = (h2 / 12) (1 - |v|/v_c)^2   for 0 < |v| < v_c              (1)
//!   variance += h_e2 / 12                  for 0 < |v| < v_c              (2)
//!   v_c <- (1 - s) v_c                     while the axis slows down      (3)
//! ```
//!
//! (2) and (3) are the wider form: jumps of one height up to the critical feed, where they end at once; and an axis that
//! slides goes on sliding at feeds at which one that jumps would go on jumping.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | h | `height_um` | µm |
//! | h_e | `free_even_um` | µm |
//! | v_c | `critical_mm_s` | mm/s |
//! | s | `free_hysteresis` | 1 |
//!
//! # Holds when
//! Each jump begins somewhere else, so that only the scatter shows it. An axis slows down where it loses more than a
//! twentieth of its speed in a second.
//!
//! # Agreement
//! `val_a_block_dragged_by_a_spring`: 2.1 % of the variance of a block with static and sliding friction.
//! `val_a_block_whose_friction_does_not_know_the_feed`: at four times the feed it jumps as high: (2), to 6 %.
//!
//! # References
//! \[1\] B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30(7), 1994,
//! doi:10.1016/0005-1098(94)90209-7 (stick-slip and the critical velocity).

use metrology::Axis;

use super::{Effect, Kind, Moment, Parameter, Scene, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "stick_slip",
    title: "stick-slip at slow feeds",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::size("height_um", 50.0, 2.0),
        Parameter::shape("critical_mm_s", [0.05, 50.0], 2.0, &[0.5, 2.0, 8.0]),
    ],
    free: &[
        Parameter::size("free_even_um", 50.0, 2.0),
        Parameter::shape(
            "free_hysteresis",
            [0.0, 0.8],
            0.2,
            &[0.0, 0.15, 0.3, 0.45, 0.6],
        ),
    ],
    moment: Moment::Variance,
    wanders: 0.0,
    needs: "motion of the axis below a few mm/s",
    build: |target, values| {
        Box::new(StickSlip {
            axis: target.axis(),
            variance_mm2: (values[0] * 1e-3).powi(2) / 12.0,
            critical_mm_s: values[1],
            even_mm2: (values[2] * 1e-3).powi(2) / 12.0,
            falling_mm_s: values[1] * (1.0 - values[3]),
        })
    },
};

struct StickSlip {
    axis: Axis,
    variance_mm2: f64,
    critical_mm_s: f64,
    even_mm2: f64,
    falling_mm_s: f64,
}

/// Share of its speed that an axis loses in a second where it slows down.
const SLOWING_PER_S: f64 = 0.05;

impl Effect for StickSlip {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let (velocity, acceleration) =
            (&motion.velocity[self.axis], &motion.acceleration[self.axis]);
        let sums = &mut response.tip_variance_mm2[self.axis.index()];
        for ((sum, v), a) in sums.iter_mut().zip(velocity).zip(acceleration) {
            let critical_mm_s = if a * v < -SLOWING_PER_S * v * v {
                self.falling_mm_s // (3)
            } else {
                self.critical_mm_s
            };
            let share = v.abs() / critical_mm_s;
            if share > 0.0 && share < 1.0 {
                *sum += self.variance_mm2 * (1.0 - share).powi(2) + self.even_mm2; // (1), (2)
            }
        }
    }
}
