//! One trial: a machine, what is hidden in it, and how large that is.
//!
//! Every trial follows from (seed, arm, number) alone. Sizes are drawn as D, log-uniform from 2 to 200: the programme is
//! run on the plant without the effect and with it at a middle size, and the size is scaled until D is what was drawn
//! or the end of its physical range is reached.

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sequencer::Step;

use crate::arm::Arm;
use crate::commissioning::Commissioning;
use crate::effect::{Class, Hidden};
use crate::error::TrialError;
use crate::measurement::measure;
use crate::rig::{Rig, STATE_RATE_HZ};
use crate::size::Deviations;
use crate::truth::{TrueEffect, Truth};

/// Range of D.
const D: [f64; 2] = [2.0, 200.0];
/// Range of D of effects that should be named in any case.
const LARGE_D: [f64; 2] = [20.0, 200.0];
/// Shares of machines with none, one and two effects; the rest has three.
const HOW_MANY: [f64; 3] = [0.2, 0.4, 0.25];

/// A trial before it is measured.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Everything that its session follows from.
    pub rig: Rig,
    /// The same before anything was hidden.
    pub bare: Rig,
    /// What is to be found.
    pub truth: Truth,
}

impl Trial {
    /// Draws the trial of a number in an arm of a series.
    ///
    /// # Errors
    /// When what is drawn breaks a rule, or cannot be measured.
    pub fn draw(arm: Arm, seed: u64, index: u64) -> Result<Self, TrialError> {
        let mut random = stream(arm, seed, index);
        let mut rig = Rig::draw(&mut random, arm == Arm::HeavyNull)?;
        let wanted = wanted(&mut random, arm, index);
        if arm == Arm::Foreign {
            rig.shake(&mut random);
        }
        let bare = commissioned(&mut rig)?;
        let mut effects = Vec::new();
        for (hidden, d) in wanted {
            let (sized, true_d) = scaled(&rig, &bare, hidden, d)?;
            effects.push((sized, true_d));
        }
        let unspoilt = rig.clone();
        for (hidden, _) in &effects {
            hidden.hide(&mut rig)?;
        }
        let left_out = effects.first().filter(|_| arm == Arm::LeftOut);
        let truth = Truth {
            arm,
            index,
            seed,
            left_out: left_out.map(|(hidden, _)| hidden.class.id().to_owned()),
            effects: effects
                .iter()
                .map(|(hidden, d)| TrueEffect::of(hidden, *d))
                .collect(),
            between_runs_um: rig.scatter.between_runs_mm * 1e3,
            white_um: rig.scatter.white_mm * 1e3,
            has_outliers: rig.scatter.outliers > 0.0,
            has_motors: rig.has_motors,
            bare_um: None,
        };
        Ok(Self {
            rig,
            bare: unspoilt,
            truth,
        })
    }
}

fn stream(arm: Arm, seed: u64, index: u64) -> Pcg64Mcg {
    let mut key = [0_u8; 16];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8..].copy_from_slice(&((arm as u64) << 48 | index).to_le_bytes());
    let mut random = Pcg64Mcg::from_seed(key);
    // The first outputs of a multiplicative generator still resemble its seed.
    for _ in 0..16 {
        let _: u64 = random.random();
    }
    random
}

/// What is hidden, with the D that it is to have.
fn wanted(random: &mut Pcg64Mcg, arm: Arm, index: u64) -> Vec<(Hidden, f64)> {
    let count = match arm {
        Arm::Null | Arm::HeavyNull => 0,
        Arm::LeftOut | Arm::Confusable | Arm::TwoRounds | Arm::Alone => 1,
        Arm::Catalogue | Arm::Foreign => how_many(random),
    };
    let mut effects = Vec::<(Hidden, f64)>::new();
    while effects.len() < count {
        let class = match arm {
            // Every class equally often.
            Arm::LeftOut | Arm::Alone => Class::ALL[(index % Class::ALL.len() as u64) as usize],
            Arm::Confusable | Arm::TwoRounds => {
                Class::CONFUSABLE[(index % Class::CONFUSABLE.len() as u64) as usize].0
            }
            _ => *Class::ALL.choose(random).unwrap_or(&Class::Backlash),
        };
        let mut hidden = draw(random, class, arm == Arm::Foreign);
        if arm == Arm::Alone {
            let round = (index / Class::ALL.len() as u64) as usize;
            hidden.axis = class.axes()[round % class.axes().len()];
        }
        let is_new =
            |(other, _): &(Hidden, f64)| other.class != hidden.class || other.axis != hidden.axis;
        if effects.iter().all(is_new) {
            let range = if arm == Arm::Alone { LARGE_D } else { D };
            let d = log_uniform(random, range);
            effects.push((hidden, d));
        }
    }
    effects
}

fn how_many(random: &mut Pcg64Mcg) -> usize {
    let mut left: f64 = random.random();
    for (count, share) in HOW_MANY.iter().enumerate() {
        if left < *share {
            return count;
        }
        left -= share;
    }
    HOW_MANY.len()
}

fn log_uniform(random: &mut Pcg64Mcg, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(random.random())
}

fn draw(random: &mut Pcg64Mcg, class: Class, is_foreign: bool) -> Hidden {
    let ([low, high], _) = class.sizes();
    let is_negative = class.has_both_signs() && random.random::<bool>();
    let middle = (low * high).sqrt();
    Hidden {
        class,
        axis: class.axes().choose(random).unwrap_or(&""),
        size: if is_negative { -middle } else { middle },
        is_foreign,
        shape: [random.random(), random.random()],
    }
}

/// The effect at the size whose D is `wanted`, or at the end of its range; with its true D.
fn scaled(
    rig: &Rig,
    bare: &Deviations,
    hidden: Hidden,
    wanted: f64,
) -> Result<(Hidden, f64), TrialError> {
    let d_of = |hidden: &Hidden| -> Result<f64, TrialError> {
        let mut with = rig.clone();
        hidden.hide(&mut with)?;
        Ok(deviations(&with)?.d_against(bare, &rig.scatter, rig.shaking_mm2()))
    };
    let middle_d = d_of(&hidden)?;
    let ([low, high], _) = hidden.class.sizes();
    let factor = wanted / middle_d.max(1e-6);
    let size = (hidden.size.abs() * factor).max(low).min(high);
    let sized = hidden.sized(size.copysign(hidden.size));
    let d = d_of(&sized)?;
    Ok((sized, d))
}

/// The same machine and programme with the touches at the end: when a touch comes depends on what is hidden, and would
/// shift every reading behind it.
fn touched_last(rig: &Rig) -> Rig {
    let mut sorted = rig.clone();
    sorted.has_motors = true;
    let is_touch = |step: &Step| matches!(step, Step::Latency { .. });
    sorted.plan.steps.sort_by_key(is_touch);
    sorted
}

/// Adds what its maker knows of the loops to the machine file; the session without an effect.
fn commissioned(rig: &mut Rig) -> Result<Deviations, TrialError> {
    let mut deviations = Deviations::default();
    let mut commissioning = Commissioning::new(&rig.machine, STATE_RATE_HZ);
    measure(&touched_last(rig), &mut |at, sample| {
        commissioning.take(&sample);
        deviations.take(at, &sample);
    })?;
    commissioning.tune(&mut rig.machine);
    Ok(deviations)
}

fn deviations(rig: &Rig) -> Result<Deviations, TrialError> {
    let mut deviations = Deviations::default();
    measure(&touched_last(rig), &mut |at, sample| {
        deviations.take(at, &sample);
    })?;
    Ok(deviations)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_effects_have_their_shares_and_d_its_range() {
        let mut random = stream(Arm::Catalogue, 1, 0);
        let mut counts = [0_u32; 4];
        for index in 0..4000 {
            let effects = wanted(&mut random, Arm::Catalogue, index);
            counts[effects.len()] += 1;
            assert!(effects.iter().all(|(_, d)| (D[0]..=D[1]).contains(d)));
        }
        for (count, share) in counts.into_iter().zip([0.2, 0.4, 0.25, 0.15]) {
            assert!(
                (f64::from(count) / 4000.0 - share).abs() < 0.03,
                "{counts:?}"
            );
        }
    }

    #[test]
    fn late_stamps_have_a_size_that_grows_with_them() {
        let mut random = stream(Arm::Catalogue, 2, 0);
        let rig = Rig::draw(&mut random, false).unwrap();
        let bare = deviations(&rig).unwrap();
        let d = |late_ms: f64| {
            let hidden = draw(&mut Pcg64Mcg::seed_from_u64(1), Class::ClockOffset, false);
            let mut with = rig.clone();
            hidden.sized(late_ms).hide(&mut with).unwrap();
            let with = deviations(&with).unwrap();
            with.d_against(&bare, &rig.scatter, 0.0)
        };
        let (small, large) = (d(0.05), d(0.1));
        assert!(
            small > 2.0 && (large / small - 2.0).abs() < 0.1,
            "{small} {large}"
        );
    }

    #[test]
    fn a_class_that_is_left_out_comes_as_often_as_every_other() {
        let mut random = stream(Arm::LeftOut, 1, 0);
        for (index, class) in (0..).zip(Class::ALL) {
            assert_eq!(wanted(&mut random, Arm::LeftOut, index)[0].0.class, class);
        }
    }
}
