//! One trial: a machine, what is hidden in it, and how large that is.
//!
//! Every trial follows from (seed, arm, number) alone. Sizes are drawn as D, log-uniform from 2 to 200: the programme is
//! run on the plant without the effect and with it at a middle size, and the size is scaled until D is what was drawn
//! or the end of its physical range is reached. Where the least D that can be named is sought, the range has no least size:
//! sharp effects have a D of 10 and more at theirs.

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sequencer::Step;

use crate::arm::Arm;
use crate::commissioning::Commissioning;
use crate::designed;
use crate::effect::{Class, Hidden};
use crate::error::TrialError;
use crate::measurement::{measure, timed};
use crate::own;
use crate::rig::{Rig, STATE_RATE_HZ};
use crate::shop::dice::{how_many, log_uniform};
use crate::size::Deviations;
use crate::truth::{MEASURE, TrueEffect, Truth};

/// Range of D.
const D: [f64; 2] = [2.0, 200.0];
/// Range of D of effects that should be named in any case.
const LARGE_D_RANGE: [f64; 2] = [20.0, 200.0];
/// Range of D about what can just be named.
const SMALL_D: [f64; 2] = [2.0, 40.0];
/// How near D is to what was drawn where that takes several steps, as a logarithm.
const NEAR_D: f64 = 0.3;

/// A trial before it is measured.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Everything that its session follows from.
    pub rig: Rig,
    /// The same before anything was hidden.
    pub bare: Rig,
    /// What is to be found.
    pub truth: Truth,
    /// What is hidden, in the order of the truth.
    pub(crate) hidden: Vec<Hidden>,
}

impl Trial {
    /// Draws the trial of a number in an arm of a series.
    ///
    /// # Errors
    /// When what is drawn breaks a rule, or cannot be measured.
    pub fn draw(arm: Arm, seed: u64, index: u64) -> Result<Self, TrialError> {
        let mut random = stream(arm, seed, index);
        let mut shared = designed::machines(arm, seed, index);
        let of_machine = shared.as_mut().unwrap_or(&mut random);
        let mut rig = Rig::draw(of_machine, arm == Arm::HeavyNull)?;
        let wanted = wanted(&mut random, arm, index);
        if is_foreign(arm, index) {
            rig.shake(shared.as_mut().unwrap_or(&mut random));
        }
        let own = wanted.first().filter(|_| has_own_programmes(arm));
        if let Some((hidden, _)) = own {
            own::prepare(&mut random, hidden, &mut rig)?;
        }
        let bare = match own {
            Some((hidden, _)) if !own::is_common(hidden.class) => deviations(&rig)?.0,
            _ => commissioned(&mut rig)?,
        };
        let wanted = if hides_nothing(arm, index) {
            vec![]
        } else {
            wanted
        };
        let mut effects = Vec::new();
        for (hidden, d) in wanted {
            let (sized, true_d) = scaled(&rig, &bare, hidden, d, (arm, index))?;
            effects.push((sized, true_d));
        }
        Self::hiding((arm, seed, index), rig, &effects)
    }

    /// A machine that hides effects of these D.
    fn hiding(
        (arm, seed, index): (Arm, u64, u64),
        mut rig: Rig,
        effects: &[(Hidden, f64)],
    ) -> Result<Self, TrialError> {
        let unspoilt = rig.clone();
        for (hidden, _) in effects {
            hidden.hide(&mut rig)?;
        }
        let left_out = effects.first().filter(|_| arm.leaves_out());
        let known = effects.iter();
        let truth = Truth {
            arm,
            index,
            seed,
            left_out: left_out.map(|(hidden, _)| hidden.class.id().to_owned()),
            effects: known
                .map(|(hidden, d)| TrueEffect::of(hidden, *d))
                .collect(),
            between_runs_um: rig.scatter.between_runs_mm * 1e3,
            white_um: rig.scatter.white_mm * 1e3,
            has_outliers: rig.scatter.outliers > 0.0,
            has_motors: rig.has_motors,
            bare_um: None,
            measure: MEASURE,
            shop: None,
            designed: None,
        };
        Ok(Self {
            rig,
            bare: unspoilt,
            truth,
            hidden: effects.iter().map(|(hidden, _)| *hidden).collect(),
        })
    }
}

pub(crate) fn stream(arm: Arm, seed: u64, index: u64) -> Pcg64Mcg {
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
        Arm::Catalogue | Arm::Foreign | Arm::Designed => how_many(random),
        _ => 1,
    };
    let mut effects = Vec::<(Hidden, f64)>::new();
    while effects.len() < count {
        let class = match arm {
            // Every class equally often.
            Arm::LeftOut | Arm::DesignedLeftOut | Arm::Alone | Arm::Limit => {
                in_turn(&Class::ALL, index)
            }
            Arm::Own | Arm::OwnLeftOut => in_turn(&Class::OWN, index),
            Arm::Confusable | Arm::TwoRounds => confusable(index),
            Arm::DesignedTwoRounds if !designed::is_small(arm, index) => confusable(index / 2),
            _ => *Class::ALL.choose(random).unwrap_or(&Class::Backlash),
        };
        let mut hidden = draw(random, class, is_foreign(arm, index));
        let classes = match arm {
            Arm::Alone | Arm::Limit => Some(Class::ALL.len()),
            Arm::Own => Some(Class::OWN.len()),
            _ => None,
        };
        if let Some(classes) = classes {
            let round = (index / classes as u64) as usize;
            hidden.axis = class.axes()[round % class.axes().len()];
        }
        let is_new =
            |(other, _): &(Hidden, f64)| other.class != hidden.class || other.axis != hidden.axis;
        if effects.iter().all(is_new) {
            let d = log_uniform(random, range_of(arm, index));
            effects.push((hidden, d));
        }
    }
    effects
}

fn in_turn(classes: &[Class], index: u64) -> Class {
    classes[(index % classes.len() as u64) as usize]
}

const fn confusable(index: u64) -> Class {
    Class::CONFUSABLE[(index % Class::CONFUSABLE.len() as u64) as usize].0
}

/// Whether forms are not quite the catalogue's.
const fn is_foreign(arm: Arm, index: u64) -> bool {
    matches!(arm, Arm::Foreign) || designed::is_foreign(arm, index)
}

const fn has_own_programmes(arm: Arm) -> bool {
    matches!(arm, Arm::Own | Arm::OwnLeftOut)
}

/// One of four machines with a programme of its own.
const fn hides_nothing(arm: Arm, index: u64) -> bool {
    matches!(arm, Arm::Own) && (index / Class::OWN.len() as u64) % 4 == 3
}

/// Whether effects are about as small as can just be named, whatever the least size that machines have.
const fn is_about_the_limit(arm: Arm, index: u64) -> bool {
    matches!(arm, Arm::Limit) || designed::is_small(arm, index)
}

const fn range_of(arm: Arm, index: u64) -> [f64; 2] {
    match arm {
        Arm::Alone => LARGE_D_RANGE,
        _ if is_about_the_limit(arm, index) => SMALL_D,
        _ => D,
    }
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
    (arm, index): (Arm, u64),
) -> Result<(Hidden, f64), TrialError> {
    let ([low, high], _) = hidden.class.sizes();
    let is_small = is_about_the_limit(arm, index);
    let low = if is_small { 0.0 } else { low };
    let mut found = (hidden, d_of(rig, bare, &hidden)?);
    // D grows with the size, if not always in proportion to it.
    for _ in 0..if has_own_programmes(arm) { 2 } else { 1 } {
        let (sized, d) = found;
        let size = (sized.size.abs() * wanted / d.max(1e-6)).max(low).min(high);
        let sized = sized.sized(size.copysign(hidden.size));
        found = (sized, d_of(rig, bare, &sized)?);
        if (found.1 / wanted).ln().abs() < NEAR_D {
            break;
        }
    }
    Ok(found)
}

/// D of an effect that is hidden in a machine, whose session without it is `bare`.
pub(crate) fn d_of(rig: &Rig, bare: &Deviations, hidden: &Hidden) -> Result<f64, TrialError> {
    if hidden.class == Class::LatencyJitter {
        return Ok(own::jitter_d(hidden.size));
    }
    let mut with = rig.clone();
    hidden.hide(&mut with)?;
    let (with, _) = deviations(&with)?;
    Ok(with.d_against(bare, &rig.scatter, rig.shaking_mm2()))
}

/// The same machine and programme with the touches at the end: when a touch comes depends on what is hidden, and would
/// shift every reading behind it. What warms or waits stays between the tests before it and those behind it.
fn touched_last(rig: &Rig) -> Rig {
    let mut sorted = rig.clone();
    sorted.has_motors = true;
    let is_touch = |step: &Step| matches!(step, Step::Latency { .. });
    let passes_time = |step: &Step| matches!(step, Step::Produce { .. } | Step::Wait { .. });
    let is_one = |a: &Step, b: &Step| !passes_time(a) && !passes_time(b);
    for stretch in sorted.plan.steps.chunk_by_mut(is_one) {
        stretch.sort_by_key(is_touch);
    }
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

/// A session by its deviations, and the time that its programs took, min.
pub(crate) fn deviations(rig: &Rig) -> Result<(Deviations, f64), TrialError> {
    let mut deviations = Deviations::default();
    let program_min = timed(&touched_last(rig), &mut |at, sample| {
        deviations.take(at, &sample);
    })?;
    Ok((deviations, program_min))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Sample;

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
        let (bare, _) = deviations(&rig).unwrap();
        let d = |late_ms: f64| {
            let hidden = draw(&mut Pcg64Mcg::seed_from_u64(1), Class::ClockOffset, false);
            let mut with = rig.clone();
            hidden.sized(late_ms).hide(&mut with).unwrap();
            let (with, _) = deviations(&with).unwrap();
            with.d_against(&bare, &rig.scatter, 0.0)
        };
        let (small, large) = (d(0.05), d(0.1));
        assert!(
            small > 2.0 && (large / small - 2.0).abs() < 0.1,
            "{small} {large}"
        );
    }

    #[test]
    fn about_the_limit_sharp_effects_are_smaller_than_machines_have_them() {
        let trial = Trial::draw(Arm::Limit, 3, 0).unwrap();
        let [play] = &trial.truth.effects[..] else {
            panic!("{:?}", trial.truth.effects);
        };
        assert_eq!(play.class, Class::Backlash);
        let ([least, _], _) = Class::Backlash.sizes();
        assert!(play.size < least && play.d < 20.0, "{play:?}");
    }

    #[test]
    fn a_class_that_is_left_out_comes_as_often_as_every_other() {
        let mut random = stream(Arm::LeftOut, 1, 0);
        for (index, class) in (0..).zip(Class::ALL) {
            assert_eq!(wanted(&mut random, Arm::LeftOut, index)[0].0.class, class);
        }
    }

    /// The machine before its programme, and what it was to hide.
    fn own_machine(seed: u64, index: u64) -> Rig {
        let mut random = stream(Arm::Own, seed, index);
        let mut rig = Rig::draw(&mut random, false).unwrap();
        let (hidden, _) = wanted(&mut random, Arm::Own, index)[0];
        own::prepare(&mut random, &hidden, &mut rig).unwrap();
        rig
    }

    /// In the series of this seed the ring of this machine stood where the stylus had to go down beside the sphere.
    #[test]
    fn a_sphere_near_a_ring_is_touched_to_the_end() {
        let mut rig = own_machine(12_609_568_478_819_048_098, 87);
        let is_sphere = |step: &Step| matches!(step, Step::Artefact { id, .. } if id == "ball");
        rig.plan.steps.retain(is_sphere);
        rig.plan.steps.truncate(1);
        let mut touches = 0;
        let counted = measure(&rig, &mut |_, sample| {
            touches += usize::from(matches!(sample, Sample::Trigger(_)));
        });
        assert!(counted.is_ok(), "{counted:?}");
        assert_eq!(touches, 25);
    }
}
