//! What the axes of a machine do on a circle, as radial readings of an effect of size 1.
//!
//! Lost motion is a row of elements that stick up to their own way each. A reversal is a friction that turns over and a
//! loop of second order with an integrator that answers it, in steps of time. A slower axis is where it was a moment ago.

use std::f64::consts::TAU;

use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::dice::log_uniform;

/// Step of the integration, s.
const SERVO_STEP_S: f64 = 5e-4;
/// Elements of lost motion.
const ELEMENTS: usize = 5;

/// One circle of a ballbar.
#[derive(Clone, Debug)]
pub struct Circle {
    /// Axes of its plane, 0 to 2, the first at angle 0.
    pub axes: [usize; 2],
    /// Radius, mm.
    pub radius_mm: f64,
    /// Feed, mm/s.
    pub feed_mm_s: f64,
    /// Counter-clockwise.
    pub is_ccw: bool,
    /// Angles of the readings in their order, rad.
    pub angles: Vec<f64>,
}

/// A kind of hidden effect, with what its machine has of it.
#[derive(Clone, Debug)]
pub enum Motion {
    /// The second axis leans towards the first of its pair.
    Squareness([usize; 2]),
    /// An axis is longer than it should be.
    Scale(usize),
    /// Lost motion: ways of the elements, mm, and their shares.
    Backlash(usize, [f64; ELEMENTS], [f64; ELEMENTS]),
    /// Reversal: frequency of the loop, 1/s, its damping, and the time of its integrator, s.
    Reversal(usize, [f64; 3]),
    /// A loop that is slower than the others'.
    Slow(usize),
    /// Period, mm, and phase of a screw.
    Cyclic(usize, [f64; 2]),
}

impl Motion {
    /// Lost motion of an axis.
    pub fn lost_motion(random: &mut Pcg64Mcg, axis: usize) -> Self {
        let longest_mm = log_uniform(random, [0.02, 0.8]);
        let ways = [0, 1, 2, 3, 4].map(|k| longest_mm * 0.5_f64.powi(k));
        let drawn: [f64; ELEMENTS] = [(); ELEMENTS].map(|()| random.random_range(0.1..1.0));
        let whole: f64 = drawn.iter().sum();
        Self::Backlash(axis, ways, drawn.map(|share| share / whole))
    }

    /// Reversal of an axis.
    pub fn reversal(random: &mut Pcg64Mcg, axis: usize) -> Self {
        let loops = [
            log_uniform(random, [25.0, 120.0]),
            random.random_range(0.6..1.4),
            log_uniform(random, [0.01, 0.08]),
        ];
        Self::Reversal(axis, loops)
    }

    /// Radial readings of an effect of size 1 (µm, µm/m, µrad or ms).
    pub fn radial_um(&self, circle: &Circle) -> Vec<f64> {
        let along = |axis: usize, angle: f64| -> f64 {
            match circle.axes.iter().position(|own| *own == axis) {
                Some(0) => angle.cos(),
                Some(_) => angle.sin(),
                None => 0.0,
            }
        };
        let radius_mm = circle.radius_mm;
        let even = |of: &dyn Fn(f64) -> f64| circle.angles.iter().map(|angle| of(*angle)).collect();
        match self {
            Self::Squareness([first, second]) => {
                even(&|angle| 1e-3 * radius_mm * along(*first, angle) * along(*second, angle))
            }
            Self::Scale(axis) => even(&|angle| 1e-3 * radius_mm * along(*axis, angle).powi(2)),
            Self::Slow(axis) => {
                let turned = 1e-3 * circle.feed_mm_s / radius_mm * circle.sense();
                even(&|angle| {
                    let late_mm = radius_mm * (along(*axis, angle - turned) - along(*axis, angle));
                    1e3 * late_mm * along(*axis, angle)
                })
            }
            Self::Cyclic(axis, [period_mm, phase]) => even(&|angle| {
                let place_mm = radius_mm * along(*axis, angle);
                (TAU * place_mm / period_mm + phase).sin() * along(*axis, angle)
            }),
            Self::Backlash(axis, ways, shares) => {
                let mut held = [0.0; ELEMENTS];
                circle.followed(|before, now| {
                    let moved = radius_mm * (along(*axis, now) - along(*axis, before));
                    let parts = held.iter_mut().zip(ways).zip(shares);
                    let lost: f64 = { parts }
                        .map(|((held, way), share)| {
                            *held = (*held + moved).clamp(-way, *way);
                            share * *held / way
                        })
                        .sum();
                    -0.5 * lost * along(*axis, now)
                })
            }
            Self::Reversal(axis, [frequency, damping, integral_s]) => {
                let (mut off, mut speed, mut rest) = (0.0, 0.0, 0.0);
                let mut friction_before: Option<f64> = None;
                circle.followed(|before, now| {
                    let moved =
                        radius_mm * (along(*axis, now) - along(*axis, before)) / SERVO_STEP_S;
                    // Friction sticks a little harder while the axis is slow.
                    let friction =
                        moved / (moved.abs() + 0.05) * (1.0 + 0.4 * (-moved.abs() / 2.0).exp());
                    let change = friction - friction_before.unwrap_or(friction);
                    friction_before = Some(friction);
                    rest += change - rest * SERVO_STEP_S / integral_s;
                    let force = frequency * frequency * (-rest - off);
                    speed += SERVO_STEP_S * (force - 2.0 * damping * frequency * speed);
                    off += SERVO_STEP_S * speed;
                    off * along(*axis, now)
                })
            }
        }
    }
}

impl Circle {
    const fn sense(&self) -> f64 {
        if self.is_ccw { 1.0 } else { -1.0 }
    }

    /// Readings of what depends on the past: from a quarter of a turn before the first one, in steps of time.
    fn followed(&self, mut step: impl FnMut(f64, f64) -> f64) -> Vec<f64> {
        let turn = SERVO_STEP_S * self.feed_mm_s / self.radius_mm;
        let Some(first) = self.angles.first() else {
            return vec![];
        };
        let mut at = first - self.sense() * TAU / 4.0;
        let mut found = vec![];
        for angle in &self.angles {
            let left = ((angle - at).abs() / turn).round().max(1.0);
            let each = (angle - at) / left;
            let mut value = 0.0;
            for _ in 0..left as usize {
                value = step(at, at + each);
                at += each;
            }
            found.push(value);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn circle(is_ccw: bool) -> Circle {
        let angles = (0..=720).map(|k| f64::from(k).to_radians() * 0.5);
        let mut angles: Vec<f64> = angles.collect();
        if !is_ccw {
            angles.reverse();
        }
        Circle {
            axes: [0, 1],
            radius_mm: 100.0,
            feed_mm_s: 16.0,
            is_ccw,
            angles,
        }
    }

    #[test]
    fn lost_motion_has_its_whole_width_far_from_reversals() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let play = Motion::lost_motion(&mut random, 0);
        let forth = play.radial_um(&circle(true));
        // At 45 deg X moves down: half the width in front, times the cosine.
        assert!(
            (forth[90] - 0.5 * 0.5_f64.sqrt()).abs() < 1e-6,
            "{}",
            forth[90]
        );
        let back = play.radial_um(&circle(false));
        assert!((back[720 - 90] + 0.5 * 0.5_f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_reversal_is_over_after_a_moment() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let spike = Motion::reversal(&mut random, 0).radial_um(&circle(true));
        let most =
            |from: usize, to: usize| spike[from..to].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(
            most(355, 380) > 0.05 && most(200, 340) < 0.02,
            "{} {}",
            most(355, 380),
            most(200, 340)
        );
    }
}
