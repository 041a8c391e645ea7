//! Backlash: the slide follows its motor only after the play between them is taken up.
//!
//! # Model
//!
//! The play operator between motor m and slide q, of width b:
//!
//! ```text
//!   q - m = max(-b/2, min(b/2, (q - m) before - dm))                      (1)
//!   q - m = -(b/2) sgn(last motion) once the play is taken up             (2)
//! ```
//!
//! The slide stays where it is left only as far as the friction of its guides holds it. Where the machine file tells that
//! friction (`guide_friction`), a slide that the drive brakes harder than its guides do runs ahead across the play, and is
//! on the other flank before the axis turns round. With its speed u, F its friction over its mass, and v the motor's speed:
//!
//! ```text
//!   du/dt = -(c + k |u|) sgn u   while |q - m| < b/2                      (3)
//!   u = v                        where a flank pushes it                  (4)
//! ```
//!
//! Where the run begins before the axis has moved by b the slide stands in the middle of its play. A
//! negative width is a backlash that the control over-compensates: (1) with |b|, its sign turned.
//! The wider form adds steps that fade with the way since the reversal, hats in its logarithm of which the first
//! reaches back to the reversal, and plays with soft corners, which the slide crosses the further the more force F over
//! its mass carries it, half of the way at F_k, and a play that is another one along the axis, as a screw that is worn where
//! it works most has it, x the place within the travel, or within the part of it that is given, -1 to 1:
//!
//! ```text
//!   q - m += -sgn(last motion) sum_k f_k h_k(log10 s)                     (5)
//!   q - m += -sum_k (s_k / 2) F / (|F| + F_k),   F = a + c sgn(last motion) + k v    (6)
//!   q - m += -sgn(last motion) (w_1 P_1(x) + .. + w_6 P_6(x)) / 2         (7)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | b | `width_um`; the play in all is b with every s_k | µm |
//! | c, k | `coulomb_mm_s2`, `viscous_per_s` of the machine file | mm/s², 1/s |
//! | f_k | `free_0p01mm_um` .. `free_3mm_um` | µm |
//! | s | `since_reversal` | mm |
//! | s_k | `free_soft_3mm_s2_um` .. `free_soft_100mm_s2_um`, where the file tells the friction | µm |
//! | w_n | `free_by_place_um`, `free_by_place2_um` .. `free_by_place6_um`, of the width | µm |
//! | ends of the part | `free_from_mm`, `free_to_mm` | mm |
//! | a, v | acceleration and velocity | mm/s², mm/s |
//!
//! # Holds when
//! A flank takes the slide along without a rebound, and (3) changes little from one tick to the next. Not modelled:
//! elasticity within the play (presliding).
//!
//! # Agreement
//! `val_a_slide_dragged_through_a_gap`: 2.2 µm, which is how far the contact of that slide yields.
//! `val_a_light_slide_runs_ahead_of_its_drive`: of 4.1 µm 0.15 left; of a slide that stays where it is left, 5.2.
//! `val_the_wider_form_takes_presliding_friction`: of 4.7 µm a step leaves 2.2, with hats 0.43.
//! `val_the_wider_form_takes_soft_corners`: of 1.79 µm a step leaves 1.36, with soft corners 0.02.
//!
//! # References
//! \[1\] ISO 230-2:2014, clause 3 (reversal error). \[2\] A. Visintin, Differential Models of Hysteresis,
//! Springer 1994, ch. III (play operator).

use std::collections::BTreeSet;

use metrology::Axis;

use super::form::{FROM_MM, TO_MM, WAY_HATS, WidthByPlace, way_hats};
use super::{Effect, Kind, Moment, Parameter, Scene, Target, Targets};
use crate::Response;
use crate::following::{Follower, within};
use machine::file::{AxisEntry, GuideFrictionEntry};

/// Entry of the catalogue.
pub static KIND: Kind = Kind {
    id: "backlash",
    title: "backlash",
    targets: Targets::LinearAxes,
    parameters: &[Parameter::amplitude("width_um", 300.0, 4.0)],
    free: &[
        Parameter::amplitude("free_0p01mm_um", 300.0, 1.0),
        Parameter::amplitude("free_0p03mm_um", 300.0, 1.0),
        Parameter::amplitude("free_0p1mm_um", 300.0, 1.0),
        Parameter::amplitude("free_0p3mm_um", 300.0, 1.0),
        Parameter::amplitude("free_1mm_um", 300.0, 1.0),
        Parameter::amplitude("free_3mm_um", 300.0, 1.0),
        Parameter::share("free_soft_3mm_s2_um", 300.0, 1.0),
        Parameter::share("free_soft_10mm_s2_um", 300.0, 1.0),
        Parameter::share("free_soft_30mm_s2_um", 300.0, 1.0),
        Parameter::share("free_soft_100mm_s2_um", 300.0, 1.0),
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
    needs: "a reversal of the axis",
    build: |target, values| Box::new(Backlash::new(&target, values)),
};

/// Place of w_1 among the values.
const FIRST_BY_PLACE: usize = 1 + WAY_HATS + SOFT_MM_S2.len();

/// Nearer to the reversal the wider form stays at its first hat's height, as presliding begins there.
const FIRST_HAT_MM: f64 = 0.01;

/// F_k of (6), mm/s².
const SOFT_MM_S2: [f64; 4] = [3.0, 10.0, 30.0, 100.0];

/// Longest step of a slide in its play, s.
const LONGEST_S: f64 = 0.004;
/// Share of a step that stamps are rounded by.
const ROUNDED: f64 = 1e-3;
/// A motor this near to its command's velocity keeps it, mm/s.
const RESTS_MM_S: f64 = 1e-4;

struct Backlash {
    axis: Axis,
    width_mm: f64,
    free_mm: [f64; WAY_HATS],
    soft_mm: [f64; SOFT_MM_S2.len()],
    by_place: WidthByPlace,
}

impl Backlash {
    fn new(target: &Target, values: &[f64]) -> Self {
        Self {
            axis: target.axis(),
            width_mm: values[0] * 1e-3,
            free_mm: std::array::from_fn(|k| values[1 + k] * 1e-3),
            soft_mm: std::array::from_fn(|k| values[1 + WAY_HATS + k] * 1e-3),
            by_place: WidthByPlace::new(target.axis(), &values[FIRST_BY_PLACE..]),
        }
    }

    /// (6) under a force.
    fn soft_mm(&self, force_mm_s2: f64) -> f64 {
        let parts = self.soft_mm.iter().zip(SOFT_MM_S2);
        let crossed = |(width, half): (&f64, f64)| width / (force_mm_s2.abs() + half);
        -0.5 * force_mm_s2 * parts.map(crossed).sum::<f64>()
    }

    /// Adds (6) where the file tells the friction.
    fn add_soft(&self, scene: &Scene<'_>, response: &mut Response) {
        let linear = scene.machine.linear(self.axis);
        let friction = linear.and_then(|linear| linear.guide_friction);
        let Some(friction) = friction.filter(|_| self.soft_mm.iter().any(|width| *width != 0.0))
        else {
            return;
        };
        let motion = &scene.run.motion;
        let senses = motion.sense[self.axis].iter();
        let ticks = senses.zip(&motion.velocity[self.axis]);
        let ticks = ticks.zip(&motion.acceleration[self.axis]);
        for (sum, ((sense, v), a)) in response.drive[self.axis].iter_mut().zip(ticks) {
            let dragged = f64::from(*sense) * friction.coulomb_mm_s2 + friction.viscous_per_s * v;
            *sum += self.soft_mm(a + dragged);
        }
    }
}

/// A slide in its play.
struct Slide {
    half_mm: f64,
    friction: GuideFrictionEntry,
    /// q - m.
    lag_mm: f64,
    velocity_mm_s: f64,
}

impl Slide {
    /// One period in which the command's velocity changes evenly: `begin`, then `begin` + `change`.
    fn follow(&mut self, motor: &mut Follower, [begin, change]: [f64; 2], period_s: f64) {
        let steps = (period_s / LONGEST_S - ROUNDED).ceil().max(1.0);
        let step_s = period_s / steps;
        let mut done = 0.0;
        while done < steps {
            let from = begin + change * done / steps;
            let before_mm = motor.error();
            motor.advance(from, change / steps, step_s);
            let commanded_mm = (from + 0.5 * change / steps) * step_s;
            let by_mm = commanded_mm + motor.error() - before_mm;
            self.step(by_mm, step_s, motor.velocity());
            done += 1.0;
            // A motor that has come to rest, or goes evenly, does so until the period ends.
            let is_even = change == 0.0 && (motor.velocity() - begin).abs() < RESTS_MM_S;
            if is_even && done < steps {
                let rest_s = step_s * (steps - done);
                motor.advance(begin, 0.0, rest_s);
                self.step(begin * rest_s, rest_s, begin);
                return;
            }
        }
    }

    /// The motor has moved by `by_mm` in `period_s`, and is now this fast.
    fn step(&mut self, by_mm: f64, period_s: f64, motor_mm_s: f64) {
        let speed = self.velocity_mm_s.abs();
        let braking = self.friction.coulomb_mm_s2 + self.friction.viscous_per_s * speed;
        let runs_s = period_s.min(speed / braking);
        let sense = self.velocity_mm_s.signum();
        self.velocity_mm_s = sense * (speed - braking * runs_s); // (3)
        let coasted_mm = sense * (speed - 0.5 * braking * runs_s) * runs_s;
        let lag_mm = self.lag_mm + coasted_mm - by_mm;
        self.lag_mm = lag_mm.clamp(-self.half_mm, self.half_mm); // (1)
        if lag_mm.abs() > self.half_mm {
            self.velocity_mm_s = motor_mm_s; // (4)
        }
    }
}

impl Backlash {
    /// q - m at every tick.
    fn lags_mm(&self, scene: &Scene<'_>) -> Vec<f64> {
        let position = &scene.run.motion.position[self.axis];
        let half_mm = 0.5 * self.width_mm.abs();
        let entry = scene.machine.axes.get(&self.axis);
        let friction = scene
            .machine
            .linear(self.axis)
            .and_then(|linear| linear.guide_friction);
        match (entry, friction) {
            _ if half_mm <= 0.0 => vec![0.0; position.len()],
            (Some(entry), Some(friction)) => self.coasting_mm(scene, entry, friction, half_mm),
            _ => held(position, half_mm),
        }
    }

    /// (3) and (4), the motor creeping into its place as its loop lets it: that decides on which flank a slide stops.
    fn coasting_mm(
        &self,
        scene: &Scene<'_>,
        entry: &AxisEntry,
        friction: GuideFrictionEntry,
        half_mm: f64,
    ) -> Vec<f64> {
        let motion = &scene.run.motion;
        let mut slide = Slide {
            half_mm,
            friction,
            lag_mm: 0.0,
            velocity_mm_s: motion.velocity[self.axis].first().copied().unwrap_or(0.0),
        };
        let latches: BTreeSet<usize> = scene.run.touches.iter().filter_map(|t| t.tick).collect();
        let mut motor = Follower::new(entry, motion, self.axis);
        let follow = |tick: usize| {
            if tick > 0 {
                let period_s = motion.time_s[tick] - motion.time_s[tick - 1];
                let (begin, change) = if latches.contains(&tick) {
                    // The touch itself stops the axis within the tick: until then it went at its feed.
                    (motion.velocity[self.axis][tick], 0.0)
                } else {
                    within(motion, self.axis, tick, period_s)
                };
                slide.follow(&mut motor, [begin, change], period_s);
            }
            slide.lag_mm
        };
        (0..motion.len()).map(follow).collect()
    }
}

/// (1): what is driven stays where it is left.
pub(super) fn held(position: &[f64], half: f64) -> Vec<f64> {
    let mut lag = 0.0_f64;
    let mut last = position.first().copied().unwrap_or(0.0);
    let follow = |here: &f64| {
        lag = (lag - (here - last)).clamp(-half, half); // (1)
        last = *here;
        lag
    };
    position.iter().map(follow).collect()
}

impl Effect for Backlash {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        let motion = &scene.run.motion;
        let sense = &motion.sense[self.axis];
        let sums = response.drive[self.axis].iter_mut();
        for ((tick, sum), lag_mm) in sums.enumerate().zip(self.lags_mm(scene)) {
            let way = motion.since_reversal[self.axis][tick].max(FIRST_HAT_MM);
            let free_mm = way_hats(&self.free_mm, way);
            *sum += lag_mm * self.width_mm.signum() - f64::from(sense[tick]) * free_mm; // (5)
        }
        self.add_soft(scene, response);
        self.by_place.add_to(scene, response); // (7)
    }
}
