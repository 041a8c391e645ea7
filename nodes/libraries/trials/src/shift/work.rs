//! What a machine does while nothing is measured: production, pauses, nights.
//!
//! ```text
//!   x_a(t) = c_a + h_a tri(v_a t / (4 h_a)),   tri from 0 to 1 to 0 to -1 to 0         (1)
//! ```
//!
//! Spells are simulated in coarse steps by the plant (`Plant::work`): heat and wear go on, loops do not.

use metrology::stamp::Span;
use metrology::{Axis, PerAxis};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use crate::shop::dice::log_uniform;

/// Time in which the axes come from where they stand, and go back at the end, s.
const APPROACH_S: f64 = 5.0;
/// Steps of time while something moves, and while nothing does, s.
const WORKING_STEP_S: f64 = 0.25;
const RESTING_STEP_S: f64 = 60.0;

/// Strokes of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stroke {
    /// c of (1), mm.
    pub middle_mm: f64,
    /// h of (1), mm; 0: the axis stands.
    pub half_mm: f64,
    /// v of (1), mm/s.
    pub speed_mm_s: f64,
}

/// A spell of time in which nothing is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spell {
    /// How long, s.
    pub length_s: f64,
    /// Strokes of X, Y, Z.
    pub strokes: [Stroke; 3],
    /// Spindle, 1/min.
    pub spindle_rpm: f64,
    /// Whether the machine is on.
    pub is_on: bool,
}

impl Stroke {
    /// (1).
    fn at_mm(&self, since_s: f64) -> f64 {
        if self.half_mm <= 0.0 {
            return self.middle_mm;
        }
        let turns = (self.speed_mm_s * since_s / (4.0 * self.half_mm)).fract();
        let triangle = if turns < 0.25 {
            4.0 * turns
        } else if turns < 0.75 {
            2.0 - 4.0 * turns
        } else {
            4.0 * turns - 4.0
        };
        self.middle_mm + self.half_mm * triangle
    }
}

impl Spell {
    /// A pause of a machine that is on or off.
    pub(super) fn rest(length_s: f64, is_on: bool) -> Self {
        Self {
            length_s,
            strokes: [Stroke::default(); 3],
            spindle_rpm: 0.0,
            is_on,
        }
    }

    /// A part that is produced within the travels, at a drawn speed.
    pub(super) fn part(random: &mut Pcg64Mcg, travels_mm: [[f64; 2]; 3]) -> Self {
        let strokes = travels_mm.map(|[low, high]| {
            let half_mm = random.random_range(0.15..0.35) * (high - low);
            Stroke {
                middle_mm: random.random_range(low + half_mm..high - half_mm),
                half_mm,
                speed_mm_s: log_uniform(random, [15.0, 80.0]),
            }
        });
        Self {
            length_s: 0.0,
            strokes,
            spindle_rpm: log_uniform(random, [2000.0, 11_000.0]),
            is_on: true,
        }
    }

    /// Its steps: where the slides are at the end of each, and how long it is.
    pub(crate) fn steps(
        &self,
        rest: &PerAxis<f64>,
    ) -> impl Iterator<Item = (PerAxis<f64>, Span)> + use<> {
        let step_s = self.step_s().max(f64::MIN_POSITIVE);
        let (spell, rest) = (*self, *rest);
        let mut before_s = 0.0;
        std::iter::from_fn(move || {
            let since_s = (before_s + step_s).min(spell.length_s);
            let own_s = since_s - before_s;
            before_s = since_s;
            (own_s > 0.0).then(|| (spell.slides(since_s, &rest), Span::from_secs_f64(own_s)))
        })
    }

    fn moves(&self) -> bool {
        self.strokes.iter().any(|stroke| stroke.half_mm > 0.0)
    }

    /// Length of a step, s.
    fn step_s(&self) -> f64 {
        if self.moves() || self.spindle_rpm > 0.0 {
            WORKING_STEP_S
        } else {
            RESTING_STEP_S
        }
    }

    /// Where the slides are that stood at `rest` before and stand there again afterwards.
    fn slides(&self, since_s: f64, rest: &PerAxis<f64>) -> PerAxis<f64> {
        if !self.moves() {
            return *rest;
        }
        let to_end_s = self.length_s - since_s;
        let share = (since_s.min(to_end_s) / APPROACH_S).clamp(0.0, 1.0);
        let mut slides = *rest;
        for (axis, stroke) in Axis::LINEAR.into_iter().zip(&self.strokes) {
            slides[axis] += share * (stroke.at_mm(since_s) - rest[axis]);
        }
        slides
    }
}

/// Production of a length with pauses, as parts, tool changes and coffee make them.
pub(super) fn production(random: &mut Pcg64Mcg, part: &Spell, length_s: f64) -> Vec<Spell> {
    let mut all = vec![];
    let mut left_s = length_s;
    while left_s > 1.0 {
        // Whole seconds are whole steps.
        let own_s = log_uniform(random, [180.0, 1200.0]).min(left_s).floor();
        let is_pause = random.random::<f64>() < 0.2;
        all.push(if is_pause {
            Spell::rest(own_s, true)
        } else {
            let share = random.random_range(0.5..1.0);
            Spell {
                length_s: own_s,
                strokes: part.strokes.map(|stroke| Stroke {
                    speed_mm_s: share * stroke.speed_mm_s,
                    ..stroke
                }),
                spindle_rpm: share * part.spindle_rpm,
                ..*part
            }
        });
        left_s -= own_s;
    }
    all
}

/// The day before and its night: production, off until the morning, on for a while.
pub(super) fn night_before(random: &mut Pcg64Mcg, part: &Spell) -> Vec<Spell> {
    let hour = 3600.0;
    let late_s = random.random_range(1.0..6.0) * hour;
    let is_weekend = random.random::<f64>() < 0.2;
    let off_s = if is_weekend {
        random.random_range(50.0..66.0) * hour
    } else {
        random.random_range(7.0..15.0) * hour
    };
    let mut all = production(random, part, late_s);
    all.push(Spell::rest(off_s, false));
    all.push(Spell::rest(random.random_range(60.0..1800.0), true));
    all
}

/// Length of spells one after another, s.
pub(super) fn length_s(spells: &[Spell]) -> f64 {
    spells.iter().map(|spell| spell.length_s).sum()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn eq1_a_stroke_of_100_mm_at_50_mm_s_turns_after_one_and_three_seconds() {
        let stroke = Stroke {
            middle_mm: 20.0,
            half_mm: 50.0,
            speed_mm_s: 50.0,
        };
        for (at_s, wanted_mm) in [
            (0.0, 20.0),
            (1.0, 70.0),
            (2.5, -5.0),
            (3.0, -30.0),
            (4.0, 20.0),
        ] {
            let off = stroke.at_mm(at_s) - wanted_mm;
            assert!(off.abs() < 1e-9, "{at_s}: {off}");
        }
    }

    #[test]
    fn slides_come_from_where_they_stood_and_go_back() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let travels = [[-300.0, 300.0], [-200.0, 200.0], [-60.0, 400.0]];
        let spell = Spell {
            length_s: 600.0,
            ..Spell::part(&mut random, travels)
        };
        let rest = PerAxis([10.0, 20.0, 240.0, 0.0, 0.0, 0.0]);
        assert_eq!(spell.slides(0.0, &rest), rest);
        assert_eq!(spell.slides(600.0, &rest), rest);
        for step in 0..2400 {
            let slides = spell.slides(0.25 * f64::from(step), &rest);
            for (axis, [low, high]) in Axis::LINEAR.into_iter().zip(travels) {
                assert!((low..=high).contains(&slides[axis]), "{axis}: {slides:?}");
            }
        }
    }

    #[test]
    fn a_night_is_off_and_production_has_its_length() {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let part = Spell::part(&mut random, [[-300.0, 300.0]; 3]);
        let made = production(&mut random, &part, 1500.0);
        assert!((length_s(&made) - 1500.0).abs() < 1.5, "{made:?}");
        let before = night_before(&mut random, &part);
        let off: Vec<&Spell> = before.iter().filter(|spell| !spell.is_on).collect();
        assert!(off.len() == 1 && off[0].length_s >= 7.0 * 3600.0);
        assert!(before.last().is_some_and(|spell| spell.is_on));
        let steps = off[0].steps(&PerAxis::default());
        let passed_s: f64 = steps.map(|(_, step)| step.as_secs_f64()).sum();
        assert!((passed_s - off[0].length_s).abs() < 1e-3, "{passed_s}");
    }
}
