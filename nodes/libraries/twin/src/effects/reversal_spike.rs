//! Reversal spike: an axis that turns round stays behind until its loop has overcome the friction.
//!
//! # Model
//!
//! Friction turns over on the way l (Dahl), and a loop with integral action whose dominant poles coincide at 1/w
//! answers what it changes by:
//!
//! ```text
//!   dz/ds = (sgn(motion) - z) / l                                         (1)
//!   w^2 e'' + 2 w e' + e = w z' exp(1) / 2                                (2)
//!   E = -(h + g |a_r| / 100 mm/s2) e - sgn(motion) sum_k f_k h_k(log10 s) - sum_j b_j e_j    (3)
//!   e_j: (2) with z exp(-|v| / v_j) in the place of z                     (4)
//! ```
//!
//! Of a reversal that is quick against w, e is the (t/w) exp(1 - t/w) of a step, with its peak of 1; the slower the axis
//! turns round, the lower is its spike. The wider form lets the height grow with the acceleration at the reversal, adds
//! hats over the logarithm of the way since, and a friction that falls with speed (Stribeck).
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | h | `height_um` | µm |
//! | w | `width_ms` | ms |
//! | l | `length_mm` | mm |
//! | g | `free_at_100mm_s2_um` | µm |
//! | f_k | `free_0p01mm_um` .. `free_3mm_um` | µm |
//! | b_j | `free_below_2mm_s_um`, `free_below_8mm_s_um`, of v_j | µm |
//! | s, v | way and velocity of the axis; in the hats `since_reversal` | mm, mm/s |
//!
//! # Holds when
//! Friction is of the commanded motion. Seen by the motor's encoder, as a servo error.
//!
//! # Agreement
//! `eq1_a_step_into_a_answerof_two_equal_poles`: 0.1 % of the height.
//! `val_lugre_friction_under_a_cascaded_loop`: of a LuGre drive under position and velocity loops, at two feeds
//! and radii with one height, (2) leaves 26 % of the rms, (3) 16 %.
//!
//! # References
//! \[1\] C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Autom. Control 40(3),
//! 1995, doi:10.1109/9.376053 (the friction of the test).

use std::f64::consts::E;

use metrology::Axis;

use super::form::{WAY_HATS, way_hats};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "reversal_spike",
    title: "reversal spike",
    targets: Targets::LinearAxes,
    parameters: &[
        Parameter::amplitude("height_um", 100.0, 3.0),
        Parameter::shape(
            "width_ms",
            [0.5, 200.0],
            15.0,
            &[3.0, 6.0, 12.0, 24.0, 48.0],
        ),
        Parameter::shape(
            "length_mm",
            [0.0001, 3.0],
            0.01,
            &[0.001, 0.004, 0.016, 0.06, 0.25],
        ),
    ],
    free: &[
        Parameter::amplitude("free_at_100mm_s2_um", 30.0, 1.0),
        Parameter::amplitude("free_0p01mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p03mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p1mm_um", 30.0, 1.0),
        Parameter::amplitude("free_0p3mm_um", 30.0, 1.0),
        Parameter::amplitude("free_1mm_um", 30.0, 1.0),
        Parameter::amplitude("free_3mm_um", 30.0, 1.0),
        Parameter::amplitude("free_below_2mm_s_um", 30.0, 1.0),
        Parameter::amplitude("free_below_8mm_s_um", 30.0, 1.0),
    ],
    moment: Moment::Mean,
    wanders: 0.0,
    needs: "a reversal of the axis in motion",
    build: |target, values| Box::new(ReversalSpike::new(&target, values)),
};

struct ReversalSpike {
    axis: Axis,
    height_mm: f64,
    width_s: f64,
    length_mm: f64,
    per_acceleration_s2: f64,
    free_mm: [f64; WAY_HATS],
    falling_mm: [f64; 2],
}

/// v_j, mm/s.
const FALLS_MM_S: [f64; 2] = [2.0, 8.0];

impl ReversalSpike {
    fn new(target: &Target, values: &[f64]) -> Self {
        let mut free_mm = [0.0; WAY_HATS];
        for (free, value) in free_mm.iter_mut().zip(&values[4..]) {
            *free = value * 1e-3;
        }
        Self {
            axis: target.axis(),
            height_mm: values[0] * 1e-3,
            width_s: values[1] * 1e-3,
            length_mm: values[2],
            per_acceleration_s2: values[3] * 1e-5,
            free_mm,
            falling_mm: std::array::from_fn(|j| values[4 + WAY_HATS + j] * 1e-3),
        }
    }
}

impl Effect for ReversalSpike {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let (sense, way) = (&motion.sense[self.axis], &motion.since_reversal[self.axis]);
        let (time_s, position) = (&motion.time_s, &motion.position[self.axis]);
        let turned_s = &motion.since_reversal_s[self.axis];
        let is_free = self.free_mm.iter().any(|free| *free != 0.0);
        let mut height_mm = self.height_mm;
        // Before it first moves the axis is held in the direction that it starts in: a start is no reversal.
        let first = sense.iter().find(|sense| **sense != 0);
        let first = first.copied().map_or(0.0, f64::from);
        let mut friction = Friction(first);
        let mut answer = Lags::at_rest(first);
        let mut falling = FALLS_MM_S.map(|_| Lags::at_rest(first));
        for (tick, sum) in response.servo[self.axis].iter_mut().enumerate() {
            let before = tick.saturating_sub(1);
            if turned_s[tick] < turned_s[before] {
                let turned_at = motion.acceleration[self.axis][tick].abs();
                height_mm = self.height_mm + self.per_acceleration_s2 * turned_at;
            }
            let moved_mm = (position[tick] - position[before]).abs();
            let sign = f64::from(sense[tick]);
            let level = friction.turn(sign, moved_mm / self.length_mm); // (1)
            let widths = (time_s[tick] - time_s[before]) / self.width_s;
            answer.follow(level, widths); // (2)
            *sum -= height_mm * answer.behind; // (3)
            for ((lags, fall_mm_s), fallen_mm) in
                falling.iter_mut().zip(FALLS_MM_S).zip(self.falling_mm)
            {
                if fallen_mm != 0.0 {
                    let speed_mm_s = motion.velocity[self.axis][tick].abs();
                    lags.follow(level * (-speed_mm_s / fall_mm_s).exp(), widths); // (4)
                    *sum -= fallen_mm * lags.behind;
                }
            }
            if is_free {
                *sum -= sign * way_hats(&self.free_mm, way[tick]);
            }
        }
    }
}

/// z of (1).
struct Friction(f64);

impl Friction {
    /// A tick of even speed over so many l in the direction `sign`; gives the mean of z in it.
    fn turn(&mut self, sign: f64, lengths: f64) -> f64 {
        let off = self.0 - sign;
        if off == 0.0 {
            return sign;
        }
        let lost = -(-lengths).exp_m1();
        self.0 = sign + off * (1.0 - lost);
        if lengths < 1e-9 {
            self.0
        } else {
            sign + off * lost / lengths
        }
    }
}

/// (2) as two lags: w s / (w s + 1)^2 = (1 - 1 / (w s + 1)) / (w s + 1).
struct Lags {
    lagging: f64,
    behind: f64,
}

impl Lags {
    const fn at_rest(level: f64) -> Self {
        Self {
            lagging: level,
            behind: 0.0,
        }
    }

    /// A tick of so many w at a level.
    fn follow(&mut self, level: f64, widths: f64) {
        let off = self.lagging - level;
        // What is left of a peak of 1 is below what a sum of floats can show.
        if off == 0.0 && self.behind.abs() < 1e-24 {
            self.behind = 0.0;
            return;
        }
        let kept = (-widths).exp();
        self.behind = kept * (self.behind - 0.5 * E * off * widths);
        self.lagging = level + off * kept;
    }
}
