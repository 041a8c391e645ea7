//! Whether what is named has one size over the session, and what of its changes stays without a name.
//!
//! # Model
//!
//! Run r shows a named effect with the whitened signature f_r and leaves e_r of it; its size there, over that of all runs, is
//!
//! ```text
//!   a_r = 1 + f_r'e_r / |f_r|^2,   var a_r = s^2 / |f_r|^2                (1)
//! ```
//!
//! A step and a growth in time are fitted beside a mean of every condition, so that conditions that follow one another do not
//! pass for time; F of the better one, over all places that were tried, gives its chance in noise.
//!
//! # Holds when
//! A test was repeated at both ends of what changed.

use nalgebra::DVector;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use twin::Session;

use crate::config::GapConfig;
use crate::judgement::cause::{Found, Member};
use crate::noise::repeats::same_condition;
use crate::noise::stack::Stack;
use crate::report::figures::{Course, HeldOut, Note};
use crate::report::{DoesNotRepeat, OverSession, Status};
use crate::search::nuisance::orthonormal;
use crate::search::rows::count;
use crate::search::signature::begin_s;
use crate::session::changes::{self, Change, evenly};
use crate::shrink::Shrunk;

/// Chance in noise above which one size holds.
const MOST_CHANCE: f64 = 0.01;
/// D of an effect in a run that determines its size.
const LEAST_D_OF_A_RUN: f64 = 3.0;
/// Fewest such runs that show whether one size holds.
const FEWEST_RUNS: usize = 5;
/// What of a change may be left for it to be explained.
const MOST_LEFT: f64 = 0.5;
/// The same where touches alone show it: an effect of the machine takes half of a step that one of two blocks has.
const MOST_LEFT_OF_TOUCHES: f64 = 0.3;
/// Held-out runs are off by more than an effect explains where they are off by this many times what noise and the
/// simulator's error of form give.
const LEAST_REMAINDER: f64 = 2.0;
/// Least factor of a confidence beside a remainder.
const LEAST_FACTOR: f64 = 0.5;

/// Size (1) of an effect in one run.
struct Sized {
    run: usize,
    at_h: f64,
    size: f64,
    weight: f64,
}

/// One entry for each named member; `rest` is what all of them leave of the stack, mm.
pub(crate) fn of_named(
    stack: &Stack<'_>,
    found: &Found,
    rest: &[f64],
    config: &GapConfig,
) -> Vec<OverSession> {
    let left = stack.whitened(rest.to_vec());
    let of = |member: &Member| {
        let instance = found.instance(member);
        let part = stack.signature(&*instance.effect(&member.estimate.values));
        OverSession {
            effect: instance.kind.id.to_owned(),
            axis: instance.target.to_string(),
            from_run: instance.begins.map(|begins| begins.run),
            ..judged(stack.session, &sizes(stack, &part, &left), config)
        }
    };
    found.named().map(of).collect()
}

fn sizes(stack: &Stack<'_>, part: &DVector<f64>, left: &DVector<f64>) -> Vec<Sized> {
    let of_run = |run: &usize| {
        let own = stack.rows.blocks.iter().filter(|block| block.run == *run);
        let (mut weight, mut along) = (0.0, 0.0);
        for block in own {
            let [f, e] = [part, left].map(|rows| rows.rows(block.start, block.rows.len()));
            weight += f.norm_squared();
            along += f.dot(&e);
        }
        let at_h = begin_s(&stack.session.runs[*run])? / 3600.0;
        (weight > LEAST_D_OF_A_RUN.powi(2)).then(|| Sized {
            run: *run,
            at_h,
            size: 1.0 + along / weight,
            weight,
        })
    };
    stack.runs.iter().filter_map(of_run).collect()
}

/// Least squares of weighed sizes beside a mean of each condition.
struct Conditions<'s> {
    sizes: &'s [Sized],
    means: Vec<DVector<f64>>,
}

impl<'s> Conditions<'s> {
    fn new(session: &Session, sizes: &'s [Sized]) -> Self {
        let mut first = Vec::<usize>::new();
        for own in sizes {
            let is_same = |run: &usize| same_condition(&session.runs[*run], &session.runs[own.run]);
            if !first.iter().any(is_same) {
                first.push(own.run);
            }
        }
        let mean = |run: &usize| {
            column(sizes, |own| {
                let is_same = same_condition(&session.runs[*run], &session.runs[own.run]);
                f64::from(u8::from(is_same))
            })
        };
        let means = first.iter().map(mean).collect();
        Self { sizes, means }
    }

    fn left(&self, more: Option<&DVector<f64>>) -> (DVector<f64>, usize) {
        let n = self.sizes.len();
        let values = column(self.sizes, |own| own.size);
        let basis = orthonormal(n, self.means.iter().chain(more).cloned());
        let left = &values - &basis * basis.tr_mul(&values);
        (left, n.saturating_sub(basis.ncols()))
    }

    /// Size of a course beside the means, and its chance in noise over so many tries.
    fn of(&self, course: &DVector<f64>, tried: usize) -> Option<(f64, f64)> {
        let (before, free) = self.left(None);
        let (after, left) = self.left(Some(course));
        if left < 2 || left == free {
            return None;
        }
        let basis = orthonormal(self.sizes.len(), self.means.iter().cloned());
        let own = course - &basis * basis.tr_mul(course);
        let size = own.dot(&before) / own.norm_squared();
        let scatter = (after.norm_squared() / count(left)).max(1.0);
        let ratio = (before.norm_squared() - after.norm_squared()) / scatter;
        let law = FisherSnedecor::new(1.0, count(left)).ok()?;
        Some((size, (law.sf(ratio.max(0.0)) * count(tried)).min(1.0)))
    }
}

fn column(sizes: &[Sized], of: impl Fn(&Sized) -> f64) -> DVector<f64> {
    let values = sizes.iter().map(|own| own.weight.sqrt() * of(own));
    DVector::from_iterator(sizes.len(), values)
}

/// Whether one size holds, and what does where it does not.
fn judged(session: &Session, sizes: &[Sized], config: &GapConfig) -> OverSession {
    let mut entry = OverSession {
        effect: String::new(),
        axis: String::new(),
        from_run: None,
        holds: true,
        changes_from_run: None,
        change_share: None,
        growth_share_per_h: None,
        chance: None,
    };
    if sizes.len() < FEWEST_RUNS {
        return entry;
    }
    let conditions = Conditions::new(session, sizes);
    let tried = sizes.len();
    let steps = sizes[2..sizes.len() - 1].iter().filter_map(|first| {
        let after = column(sizes, |own| f64::from(u8::from(own.run >= first.run)));
        let (size, chance) = conditions.of(&after, tried)?;
        Some((first.run, size, chance))
    });
    let step = steps.min_by(|a, b| a.2.total_cmp(&b.2));
    let growth = conditions.of(&column(sizes, |own| own.at_h), tried);
    let hours = sizes[sizes.len() - 1].at_h - sizes[0].at_h;
    let [of_step, of_growth] = [step.map(|found| found.2), growth.map(|found| found.1)];
    entry.chance = of_step.into_iter().chain(of_growth).reduce(f64::min);
    let is_much = |share: f64| share.abs() > config.constancy_spread;
    match (step, growth) {
        (_, Some((size, chance)))
            if of_step.is_none_or(|step| chance <= step)
                && chance < MOST_CHANCE
                && is_much(size * hours) =>
        {
            entry.holds = false;
            entry.growth_share_per_h = Some(size);
        }
        (Some((run, size, chance)), _) if chance < MOST_CHANCE && is_much(size) => {
            entry.holds = false;
            entry.changes_from_run = Some(session.runs[run].segment.run);
            entry.change_share = Some(size);
        }
        _ => {}
    }
    entry
}

/// The changes that the named effects do not explain, and those that are no other than a set-up that moved; `rest` is what the
/// effects leave of the rows of all runs, mm.
pub(crate) fn not_repeated(
    stack: &Stack<'_>,
    rest: &[f64],
    (all, set_ups): (&[Change], &[[u32; 2]]),
    found: &Found,
    config: &GapConfig,
) -> Vec<DoesNotRepeat> {
    let sizes_mm = changes::left(stack.session, &stack.rows, rest, all, set_ups);
    let number = |run: usize| stack.session.runs[run].segment.run;
    // A shift of a reference point is what a set-up that moved makes as well; no other effect is.
    let is_shift = |member: &Member| found.instance(member).kind.id == changes::MOVES_ONCE;
    let has_shift = found.named().any(is_shift);
    let size_mm = |change: &Change, left_mm: f64| {
        let most_left = if change.is_touched_alone {
            MOST_LEFT_OF_TOUCHES
        } else {
            MOST_LEFT
        };
        if left_mm > most_left * change.size_mm {
            return Some(left_mm);
        }
        (change.is_set_up && has_shift).then_some(change.size_mm)
    };
    let of = |change: &Change, size_mm: f64, evenly: bool| DoesNotRepeat {
        channel: change.channel.to_string(),
        feature: change.feature.clone(),
        size_um: 1e3 * size_mm,
        last_run: number(change.between[0]),
        from_run: number(change.between[1]),
        of_set_up: change.is_set_up,
        evenly,
        chance: change.chance,
    };
    let steps = all.iter().zip(sizes_mm);
    let steps = steps.filter_map(|(change, left_mm)| Some((change, size_mm(change, left_mm)?)));
    let mut told: Vec<DoesNotRepeat> = steps
        .map(|(change, size_mm)| of(change, size_mm, false))
        .collect();
    // What a step leaves beside an effect that explains it pulls a slope with it.
    if all.is_empty() {
        let evenly = evenly::find(stack.session, &stack.rows, rest, set_ups, config);
        told.extend(evenly.iter().map(|change| of(change, change.size_mm, true)));
    }
    told
}

/// Says what changed where a page lists remarks.
pub(crate) fn notes(named: &[OverSession], changed: &[DoesNotRepeat]) -> Vec<Note> {
    let title = |own: &OverSession| format!("{} {}", own.effect, own.axis).trim_end().to_owned();
    let begun = named.iter().filter_map(|own| {
        Some(Course::Begins {
            effect: title(own),
            run: own.from_run?,
        })
    });
    let several = named
        .iter()
        .filter(|own| !own.holds)
        .map(|own| Course::NotOneSize {
            effect: title(own),
            run: own.changes_from_run,
            share: own.change_share.or(own.growth_share_per_h).unwrap_or(0.0),
        });
    let changed = changed.iter().map(|own| Course::DoesNotRepeat {
        channel: own.channel.clone(),
        feature: own.feature.clone(),
        size_um: own.size_um,
        runs: [own.last_run, own.from_run],
        of_set_up: own.of_set_up,
        evenly: own.evenly,
        chance: own.chance,
    });
    begun
        .chain(several)
        .chain(changed)
        .map(Note::Course)
        .collect()
}

/// What the named effects leave of the held-out runs, where it is much more than noise: the confidence of each falls by the
/// share of the gap that stays. Without a name only what the fitted runs do not show, which have no gap (`has_gap`).
pub(crate) fn remainder(
    found: &mut Found,
    shrunk: &Shrunk,
    has_gap: bool,
    config: &GapConfig,
) -> Option<Note> {
    let held_out = &shrunk.held_out;
    let is_named = found.named().next().is_some();
    if shrunk.shrink.held_out_runs.is_empty() || (has_gap && !is_named) {
        return None;
    }
    let mean = |of: fn(&HeldOut) -> f64| {
        held_out.iter().map(|run| of(run).powi(2)).sum::<f64>() / count(held_out.len())
    };
    let [before, after] = [mean(|run| run.before_um), mean(|run| run.after_um)];
    let floor = mean(|run| run.floor_um) + config.form_error_um.powi(2);
    if after <= LEAST_REMAINDER.powi(2) * floor {
        return None;
    }
    let share = ((after - floor) / (before - floor).max(after - floor)).sqrt();
    let mut effects = vec![];
    for place in 0..found.members.len() {
        if found.members[place].status() == Status::Surrogate {
            continue;
        }
        found.members[place].confidence *= (1.0 - share).max(LEAST_FACTOR);
        effects.push(found.instance(&found.members[place]).name());
    }
    let worst = held_out
        .iter()
        .max_by(|a, b| a.after_um.total_cmp(&b.after_um))?;
    Some(Note::Course(Course::Remainder {
        effects,
        size_um: after.sqrt(),
        floor_um: floor.sqrt(),
        run: worst.run,
        worst_um: worst.after_um,
    }))
}

#[cfg(test)]
mod tests {
    use metrology::sample::{TestKind, TestSegment};
    use metrology::{AxisSet, PerAxis, Stamp};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;
    use twin::Run;

    use super::*;

    /// Runs of one condition at three minutes' distance.
    fn session(runs: u32) -> Session {
        let run = |number: u32| {
            let at = Stamp::from_nanos(0);
            let motion = twin::Motion::new(
                vec![180.0 * f64::from(number)],
                AxisSet::XYZ,
                PerAxis([vec![0.0], vec![0.0], vec![0.0], vec![], vec![], vec![]]),
            );
            Run {
                segment: TestSegment::of_kind(TestKind::Circle, number, at),
                motion: motion.expect("a motion"),
                touches: vec![],
                readings: vec![],
            }
        };
        Session {
            runs: (1..=runs).map(run).collect(),
            ..Session::default()
        }
    }

    fn of(seed: u64, size: impl Fn(usize) -> f64) -> OverSession {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let session = session(16);
        let sized = |run: usize| {
            let noise: f64 = StandardNormal.sample(&mut random);
            Sized {
                run,
                at_h: 0.05 * count(run),
                size: size(run) + 0.05 * noise,
                weight: 400.0,
            }
        };
        let sizes: Vec<Sized> = (0..16).map(sized).collect();
        judged(&session, &sizes, &GapConfig::default())
    }

    #[test]
    fn eq1_one_size_holds_in_noise() {
        let broken = (0..200).filter(|seed| !of(*seed, |_| 1.0).holds).count();
        assert!(broken <= 6, "{broken}");
    }

    #[test]
    fn eq1_a_step_and_a_growth_are_told_apart() {
        for seed in 0..20 {
            let step = of(seed, |run| if run < 10 { 0.6 } else { 1.4 });
            assert_eq!(step.changes_from_run, Some(11), "{seed}: {step:?}");
            let grown = of(seed, |run| 0.4 + 0.08 * count(run));
            let per_h = grown.growth_share_per_h.expect("a growth");
            assert!((per_h - 1.6).abs() < 0.4 && !grown.holds, "{grown:?}");
        }
    }
}
