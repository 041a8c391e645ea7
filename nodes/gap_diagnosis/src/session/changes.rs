//! What changed between repeats of a session: from which run on, by how much, and the chance of that in noise.
//!
//! # Model
//!
//! Every block in motion is described by the coefficients c of a few smooth patterns (`field`): offset, drift along the run, and
//! harmonics over its place. Repeats of one test have one coefficient each; over the session it may have steps,
//!
//! ```text
//!   c_gi = m_g + sum_k a_gk 1[i >= k] + e_gi,   e ~ N(0, s^2)             (1)
//! ```
//!
//! with g the group of repeats and i the run. A set-up has one place for all groups: a_gk = a_k of an offset and of the centre
//! of a ballbar. Where the steps lie is what makes the likelihood of all patterns greatest, over one step and over pairs,
//! then one more at a time. Their chance is that of F over all places and patterns that were tried:
//!
//! ```text
//!   F = ((R_0 - R_1) / q) / (R_1 / nu),   chance = n P(F_q,nu > F)        (2)
//! ```
//!
//! What goes on evenly is no step: steps must leave less than half of what as many powers of time leave.
//!
//! # Holds when
//! Repeats of one test between steps differ by independent draws. A step that only one run shows is an outlier, and not found:
//! without any one of the runs it is still there. Logs are not looked at; touches as `touched` has it.
//!
//! A set-up that moved once, and a reference point that shifted once, are one and the same in what instruments on the table
//! read: both are an offset from a run on. Effects may have it, and it is reported besides. What moved more often no single
//! return to a reference makes: each part of the session then has a set-up of its own.
//!
//! # References
//! \[1\] E. S. Page, Biometrika 42, 1955 (change at an unknown point). \[2\] J. Bai, P. Perron, Econometrica 66, 1998 (several).

pub mod evenly;
pub(crate) mod moved;
mod series;
mod touched;

use twin::{Channel, Session, Touch};

use crate::config::GapConfig;
use crate::search::rows::{Rows, count};
use crate::search::signature::{Begins, begin_s};
use series::{Series, series};

/// Chance in noise above which a step is not taken for one.
const MOST_CHANCE: f64 = 0.01;
/// Most steps of one session.
const MOST_STEPS: usize = 4;
/// Boundaries above which pairs are not gone through.
const MOST_IN_PAIRS: usize = 48;
/// Steps must be this many times what repeats between them differ by, and what every simulator is off by.
const LEAST_DEVIATIONS: f64 = 4.0;
const LEAST_FORM_ERRORS: f64 = 2.0;
/// Steps of touches must be more than this many of their last digit.
const LEAST_DIGITS: f64 = 1.5;
/// Most that steps leave of what as many powers of time leave.
const MOST_BESIDE_POWERS: f64 = 0.5;

/// One step of the session.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Place of the last run before it, and of the first one after, of those that show it.
    pub between: [usize; 2],
    /// Where it is largest.
    pub channel: Channel,
    /// What is touched there.
    pub feature: Option<String>,
    /// Its largest coefficient, mm.
    pub size_mm: f64,
    /// Chance in noise.
    pub chance: f64,
    /// Whether an offset, or the centre of a ballbar, or one thing that is touched, and nothing else changed: it moved.
    pub is_set_up: bool,
    /// Whether touches alone show it.
    pub is_touched_alone: bool,
    /// The touches that show it.
    pub touches: Vec<Touch>,
}

/// The steps of a session, in their order; `raw` is the residual of each row, mm.
pub fn find(session: &Session, rows: &Rows, raw: &[f64], config: &GapConfig) -> Vec<Change> {
    let all = series(session, rows, raw, &set_ups(session));
    let steps = steps(&all);
    let mut found: Vec<Change> = (0..steps.len())
        .filter_map(|at| change(&all, &steps, at, config))
        .collect();
    found.sort_by_key(|change| change.between[1]);
    found
}

/// Zero and set-up of each run, as they were recorded: the place of an instrument is the same only under the same.
pub fn set_ups(session: &Session) -> Vec<[u32; 2]> {
    let runs = session.runs.iter();
    runs.map(|run| [run.segment.zero_id, run.segment.setup_id])
        .collect()
}

/// What of the changes is in other numbers of the rows, by the largest coefficient in the same channel, mm.
pub fn left(
    session: &Session,
    rows: &Rows,
    rest: &[f64],
    changes: &[Change],
    set_ups: &[[u32; 2]],
) -> Vec<f64> {
    let all = series(session, rows, rest, set_ups);
    let steps: Vec<usize> = changes.iter().map(|change| change.between[1]).collect();
    let size = |at: usize, change: &Change| {
        let shows = |own: &&Series| match &own.touch {
            Some(touch) if !change.touches.is_empty() => change.touches.contains(touch),
            _ => own.channel == change.channel,
        };
        let own = all.iter().filter(shows);
        own.map(|own| own.size_mm(&steps, at)).fold(0.0, f64::max)
    };
    changes
        .iter()
        .enumerate()
        .map(|(at, change)| size(at, change))
        .collect()
}

/// Id of the effect that is as a set-up that moves once.
pub(crate) const MOVES_ONCE: &str = "homing_shift";

/// The session with a set-up of its own between steps at which the set-up moved; none where it did not, or only once and an
/// effect that is considered may have that.
pub fn set_up_anew(session: &Session, changes: &[Change], config: &GapConfig) -> Option<Session> {
    let moved: Vec<usize> = changes
        .iter()
        .filter(|change| change.is_set_up && !change.is_touched_alone)
        .map(|change| change.between[1])
        .collect();
    let is_offered = config.left_out.iter().all(|id| id != MOVES_ONCE);
    if moved.is_empty() || (moved.len() == 1 && is_offered) {
        return None;
    }
    let mut anew = session.clone();
    let zeros = anew.runs.iter().map(|run| run.segment.zero_id).max();
    let apart = zeros.unwrap_or(0).saturating_add(1);
    for (place, run) in anew.runs.iter_mut().enumerate() {
        for _ in moved.iter().filter(|at| place >= **at) {
            run.segment.zero_id = run.segment.zero_id.saturating_add(apart);
        }
    }
    Some(anew)
}

/// Time after the end of a run at which something is taken to happen that is there in the next one, s.
const AFTER_S: f64 = 1.0;

/// Instants at which the session changed, seconds since its start: as early as may be, so that what comes with a lag has come.
pub fn events_s(session: &Session, changes: &[Change]) -> Vec<f64> {
    let end_s = |change: &Change| {
        let run = &session.runs[change.between[0]];
        let moves = run.motion.time_s.last().copied();
        let touched = run.touches.last().map(|touch| touch.time_s);
        Some(moves.into_iter().chain(touched).reduce(f64::max)? + AFTER_S)
    };
    changes.iter().filter_map(end_s).collect()
}

/// Most changes from which on effects are tried.
const MOST_BEGINS: usize = 2;

/// First runs after the largest changes that no set-up explains.
pub fn begins(session: &Session, changes: &[Change]) -> Vec<Begins> {
    let is_own = |change: &&Change| !change.is_set_up;
    let mut own: Vec<&Change> = changes.iter().filter(is_own).collect();
    own.sort_by(|a, b| b.size_mm.total_cmp(&a.size_mm));
    let begin = |change: &&Change| {
        let run = &session.runs[change.between[1]];
        Some(Begins {
            run: run.segment.run,
            at_s: begin_s(run)?,
            is_touched_alone: change.is_touched_alone,
        })
    };
    own.iter().take(MOST_BEGINS).filter_map(begin).collect()
}

/// Places of the steps that the patterns have together, first runs after each.
fn steps(all: &[Series]) -> Vec<usize> {
    let mut runs: Vec<usize> = all
        .iter()
        .flat_map(|own| own.points.iter().map(|point| point.run))
        .collect();
    runs.sort_unstable();
    runs.dedup();
    if runs.len() < 4 {
        return vec![];
    }
    let boundaries = &runs[2..runs.len() - 1];
    let tried = count(all.len() * boundaries.len());
    let all = &touched::most_telling(all.to_vec(), boundaries);
    let total = |steps: &[usize]| all.iter().map(|own| own.gain(steps)).fold(0.0, f64::max);
    let best = |sets: Vec<Vec<usize>>| {
        let scored = sets.into_iter().map(|set| (total(&set), set));
        scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    };
    let single: Vec<Vec<usize>> = boundaries.iter().map(|at| vec![*at]).collect();
    let pairs: Vec<Vec<usize>> = if boundaries.len() > MOST_IN_PAIRS {
        vec![]
    } else {
        let later = |a: usize| boundaries.iter().filter(move |b| **b > a);
        let pair = |a: &usize| later(*a).map(|b| vec![*a, *b]).collect::<Vec<_>>();
        boundaries.iter().flat_map(pair).collect()
    };
    let mut found = Vec::<usize>::new();
    let doubled = best(pairs).filter(|pair| hold(all, pair, tried * count(boundaries.len()) / 2.0));
    if let Some(pair) = doubled {
        found = pair;
    } else if let Some(one) = best(single).filter(|one| hold(all, one, tried)) {
        found = one;
    }
    while !found.is_empty() && found.len() < MOST_STEPS {
        let free = boundaries.iter().filter(|at| !found.contains(at));
        let more = free.map(|at| [found.as_slice(), &[*at]].concat());
        match best(more.collect()).filter(|more| hold(all, more, tried)) {
            Some(more) => found = more,
            None => break,
        }
    }
    found.sort_unstable();
    found
}

/// Whether some pattern shows all of these steps, each beside the others, better than powers of time; of `tried` tries.
fn hold(all: &[Series], steps: &[usize], tried: f64) -> bool {
    let together = |own: &&Series| {
        own.chance(&[], steps) * tried < MOST_CHANCE
            && own.left(own.stepped(steps)).0
                < MOST_BESIDE_POWERS * own.left_by_time(steps.len() + 1).min(own.left_by_heat())
    };
    let shown: Vec<&Series> = all.iter().filter(together).collect();
    let each = |step: &usize| {
        let others: Vec<usize> = steps.iter().copied().filter(|at| at != step).collect();
        shown
            .iter()
            .filter(|own| own.around(*step).is_some())
            .filter(|own| own.chance(&others, steps) * tried < MOST_CHANCE)
            .any(|own| own.is_of_several_runs(&others, steps))
    };
    !shown.is_empty() && steps.iter().all(each)
}

/// One of the steps as it is reported; none where it is too small.
fn change(all: &[Series], steps: &[usize], at: usize, config: &GapConfig) -> Option<Change> {
    let others: Vec<usize> = steps.iter().copied().filter(|s| *s != steps[at]).collect();
    // Rounded touches flicker by one digit.
    let digits_mm = all.iter().map(Series::digit_mm).filter(|mm| *mm > 0.0);
    let digit_mm = digits_mm.fold(f64::INFINITY, f64::min);
    let digit_mm = if digit_mm.is_finite() { digit_mm } else { 0.0 };
    let large = |own: &&Series| {
        let of_form_mm = LEAST_FORM_ERRORS * 1e-3 * config.form_error_um;
        let of_digits_mm = if own.touch.is_some() {
            LEAST_DIGITS * digit_mm
        } else {
            0.0
        };
        let least_mm = of_form_mm.max(of_digits_mm);
        own.size_mm(steps, at) > least_mm.max(LEAST_DEVIATIONS * own.deviation_mm(steps))
    };
    let tried = count(all.len() * steps.len());
    let shown: Vec<(f64, &Series)> = all
        .iter()
        .filter(large)
        .map(|own| (own.chance(&others, steps) * tried, own))
        .filter(|(chance, _)| *chance < MOST_CHANCE)
        .collect();
    let size = |own: &Series| own.size_mm(steps, at);
    let largest = shown
        .iter()
        .max_by(|a, b| size(a.1).total_cmp(&size(b.1)))?;
    let of: Vec<&Series> = shown.iter().map(|(_, own)| *own).collect();
    let is_touched_alone = of.iter().all(|own| own.touch.is_some());
    Some(Change {
        between: largest.1.around(steps[at])?,
        channel: largest.1.channel.clone(),
        feature: largest.1.feature(),
        size_mm: size(largest.1),
        chance: shown.iter().map(|(chance, _)| *chance).fold(1.0, f64::min),
        is_set_up: if is_touched_alone {
            touched::is_of_one_that_moved(all, &of, steps, at)
        } else {
            of.iter().all(|own| own.is_shared)
        },
        is_touched_alone,
        touches: of.iter().filter_map(|own| own.touch.clone()).collect(),
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    use super::series::Point;
    use super::*;

    /// Runs of two tests in turn, ten patterns each; `of` gives what changes in the first pattern.
    pub(super) fn drawn(seed: u64, runs: usize, of: impl Fn(usize) -> f64) -> Vec<Series> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut pattern = |k: usize| Series {
            channel: Channel::GridU,
            touch: None,
            powers: 0,
            by_heat: vec![],
            is_shared: k == 0,
            points: (0..runs)
                .map(|run| {
                    let noise: f64 = StandardNormal.sample(&mut random);
                    Point {
                        group: run % 2,
                        run,
                        time_s: count(run) * 60.0,
                        value_mm: 2e-4 * noise + if k == 0 { of(run) } else { 0.0 },
                    }
                })
                .collect(),
        };
        (0..10).map(&mut pattern).collect()
    }

    #[test]
    fn eq2_noise_has_no_steps() {
        for runs in [6, 8, 12, 24] {
            let found = (0..150).filter(|seed| !steps(&drawn(*seed, runs, |_| 0.0)).is_empty());
            assert!(found.count() <= 4, "{runs}");
        }
    }

    #[test]
    fn eq1_two_slips_of_eight_runs_are_found_where_they_are() {
        let mut missed = vec![];
        for seed in 0..20 {
            let slips = |run: usize| f64::from(u8::from(run >= 3) + u8::from(run >= 6)) * 5e-3;
            let all = drawn(seed, 8, slips);
            let places = steps(&all);
            if places.is_empty() {
                missed.push(seed);
                continue;
            }
            assert_eq!(places, [3, 6], "{seed}");
            let found = change(&all, &places, 0, &GapConfig::default()).expect("a slip");
            assert!((found.size_mm - 5e-3).abs() < 1e-3, "{seed}: {found:?}");
            assert!(found.is_set_up && found.between == [2, 3], "{found:?}");
        }
        // Four readings are left to judge two slips of eight runs.
        assert!(missed.len() <= 3, "{missed:?}");
    }

    /// A step of every test, and one run that is off by itself: the rest of what is called a step beside it seldom agrees.
    #[test]
    fn eq1_a_run_that_is_off_alone_is_no_step_beside_one() {
        let mut wrong = vec![];
        for seed in 0..40 {
            for off in [10, 16, 17, 18, 22] {
                let mut all = drawn(seed, 32, |run| if run >= 16 { 3e-3 } else { 0.0 });
                all[0].is_shared = false;
                all[0].points[off].value_mm += 1.5e-3;
                let found = steps(&all);
                assert!(found.contains(&16), "{seed} {off}: {found:?}");
                if found != [16] {
                    wrong.push((seed, off, found));
                }
            }
        }
        assert!(wrong.len() <= 4, "{wrong:?}");
    }

    #[test]
    fn eq1_what_goes_on_evenly_is_no_step() {
        for seed in 0..40 {
            let even = |run: usize| count(run) * 4e-4;
            assert!(steps(&drawn(seed, 16, even)).is_empty(), "{seed}");
            let heats = |run: usize| 6e-3 * (1.0 - (-count(run) / 6.0).exp());
            assert!(steps(&drawn(seed, 16, heats)).is_empty(), "{seed}");
        }
    }
}
