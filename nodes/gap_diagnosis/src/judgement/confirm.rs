//! Whether an effect that was found holds in every part of the recording.
//!
//! # Model
//!
//! Each member has its whitened signature f_g at the values found. A run is left out, the sizes of all
//! members are fitted on the others with it (a) and without it (b), and the gain of g on the run that was left out is
//!
//! ```text
//!   gain_g = |z - sum_(h != g) b_h f_h|^2 - |z - sum_h a_h f_h|^2         (1)
//! ```
//!
//! It must be above its standard error in all, and above zero in four of five runs in which g changes what is told, or of all that show it
//! where fewer than two do. A cause has
//! one size under all conditions, a surrogate does not: g is split by condition and the gain of separate
//! sizes is a score of Wilson and Hilferty's (`localise`):
//!
//! ```text
//!   z - sum_h J_h d_h - sum_level e_level f_g 1[level],   e_level = e?    (2)
//! ```
//!
//! An effect passes where the score stays below `constancy_z` or its sizes differ by less than
//! `constancy_spread` of the mean, or by less than its kind may wander.

use std::collections::BTreeMap;

use metrology::sample::Sense;
use nalgebra::{DMatrix, DVector};
use twin::Run;
use twin::effects::Kind;

use crate::config::GapConfig;
use crate::judgement::rule::Rule;
use crate::judgement::{Check, CheckId, Verdict};
use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::report::Constancy;
use crate::report::localise::wilson_hilferty;
use crate::search::field;
use crate::search::nuisance::plane_name;
use crate::search::rows::{Block, Row, count, position, time_s};

/// A level of a condition needs this D of the effect to say something of its size.
const MIN_D_TO_COUNT_LEVEL: f64 = 3.0;

/// The checks of (1) of each signature.
pub fn held_out_gains(stack: &Stack<'_>, parts: &[DVector<f64>]) -> Vec<Vec<Check>> {
    held_out_gains_of(stack, &stack.z, parts)
}

/// The same on other numbers of the stack's rows.
pub fn held_out_gains_of(
    stack: &Stack<'_>,
    z: &DVector<f64>,
    parts: &[DVector<f64>],
) -> Vec<Vec<Check>> {
    let Some(columns) = (!parts.is_empty()).then(|| DMatrix::from_columns(parts)) else {
        return vec![];
    };
    let folds: Vec<Vec<std::ops::Range<usize>>> = stack
        .runs
        .iter()
        .map(|run| {
            let own = stack.rows.blocks.iter().filter(|block| block.run == *run);
            own.map(Block::range).collect()
        })
        .collect();
    let whole = Normal::new(&columns, z);
    let normals: Vec<Normal> = folds.iter().map(|fold| within(&columns, z, fold)).collect();
    (0..parts.len())
        .map(|member| {
            let shows = |fold: &&Normal| {
                fold.gram[(member, member)] > MIN_D_TO_COUNT_LEVEL * MIN_D_TO_COUNT_LEVEL
            };
            let gains: Vec<Gain> = normals
                .iter()
                .filter(shows)
                .map(|fold| gain(&whole, fold, member))
                .collect();
            checks(&gains)
        })
        .collect()
}

fn within(columns: &DMatrix<f64>, z: &DVector<f64>, ranges: &[std::ops::Range<usize>]) -> Normal {
    let n = columns.ncols();
    let mut sum = Normal {
        gram: DMatrix::zeros(n, n),
        along: DVector::zeros(n),
    };
    for range in ranges {
        let part = columns.rows(range.start, range.len());
        sum.gram += part.tr_mul(&part);
        sum.along += part.tr_mul(&z.rows(range.start, range.len()));
    }
    sum
}

/// (1) of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gain {
    gain: f64,
    /// Whether leaving the member out there changes what is told by more than a level of a condition needs: where the others
    /// tell the same without it, whether a little is gained or lost says nothing of it.
    tells: bool,
}

/// (1) of one run.
fn gain(whole: &Normal, fold: &Normal, member: usize) -> Gain {
    let rest = Normal {
        gram: &whole.gram - &fold.gram,
        along: &whole.along - &fold.along,
    };
    let all: Vec<usize> = (0..whole.gram.ncols()).collect();
    let others: Vec<usize> = all.iter().copied().filter(|k| *k != member).collect();
    let sizes = |chosen: &[usize]| {
        let mut sizes = DVector::zeros(all.len());
        for (size, place) in rest.solve(chosen).sizes.iter().zip(chosen) {
            sizes[*place] = *size;
        }
        sizes
    };
    let (with, without) = (sizes(&all), sizes(&others));
    let told =
        |sizes: &DVector<f64>| 2.0 * sizes.dot(&fold.along) - sizes.dot(&(&fold.gram * sizes));
    let change = &with - &without;
    let changed = change.dot(&(&fold.gram * &change));
    Gain {
        gain: told(&with) - told(&without),
        tells: changed > MIN_D_TO_COUNT_LEVEL * MIN_D_TO_COUNT_LEVEL,
    }
}

/// Whether the runs confirm a member: those that tell of it, or all where fewer than two do.
fn checks(gains: &[Gain]) -> Vec<Check> {
    let of = |all: bool| -> Vec<f64> {
        let counted = gains.iter().filter(|one| all || one.tells);
        counted.map(|one| one.gain).collect()
    };
    let telling = of(false);
    checks_of(&if telling.len() < 2 { of(true) } else { telling })
}

/// Gain over its standard error, and share of the runs with a gain, that confirm a member.
const MIN_GAIN_TO_CONFIRM: f64 = 1.0;
const MIN_SHARE_OF_RUNS: f64 = 0.8;

fn checks_of(gains: &[f64]) -> Vec<Check> {
    if gains.len() < 2 {
        let alone = Check::new(CheckId::HeldOutGain, true);
        let name = "gain on runs left out, where two or more runs show it";
        return vec![alone.named(name.to_owned()).not_tried()];
    }
    let n = count(gains.len());
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let positive = count(gains.iter().filter(|gain| **gain > 0.0).count());
    let error = (variance / n).sqrt();
    vec![
        Check::new(CheckId::HeldOutGain, mean > MIN_GAIN_TO_CONFIRM * error)
            .with(mean / error, MIN_GAIN_TO_CONFIRM),
        Check::new(CheckId::HeldOutShare, positive >= MIN_SHARE_OF_RUNS * n)
            .with(positive / n, MIN_SHARE_OF_RUNS),
    ]
}

type Level = fn(&Run, &Block, &Row) -> String;

/// What an effect is split by.
const SPLITS: [(&str, Level); 7] = [
    ("channel", |_, block, _| block.channel.to_string()),
    ("feed", |run, _, row| {
        let touch = row.touch.and_then(|touch| run.touches.get(touch));
        format!(
            "{:.2}",
            touch.map_or(run.segment.feed_mm_s, |t| t.feed_mm_s)
        )
    }),
    ("sense", |run, _, _| match run.segment.sense {
        Sense::None => String::new(),
        Sense::Clockwise => "clockwise".to_owned(),
        Sense::CounterClockwise => "counterclockwise".to_owned(),
    }),
    ("plane", |run, _, _| {
        plane_name(run.segment.plane).to_owned()
    }),
    ("radius", |run, _, _| {
        format!("{:.1}", run.segment.radius_mm)
    }),
    ("stylus", |run, _, _| run.segment.stylus.clone()),
    ("side of the travel", |run, block, row| {
        field::leading_axis(run, block).map_or_else(String::new, |(axis, low, high)| {
            (position(run, row, axis) > 0.5 * (low + high)).to_string()
        })
    }),
];

/// (2) of one member whose signature before whitening is `raw`; `jacobian` holds what all members may change.
pub fn constancy(
    stack: &Stack<'_>,
    raw: &[f64],
    jacobian: &[DVector<f64>],
    left: &DVector<f64>,
    limits: Limits,
) -> (Constancy, Check) {
    constancy_of(
        stack,
        raw,
        &|part| stack.whitened(part),
        jacobian,
        left,
        limits,
    )
}

/// What sizes may differ by.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Standard score.
    z: f64,
    /// Share of the mean.
    spread: f64,
}

impl Limits {
    /// For effects of a kind; anything goes where the rule is switched off.
    pub fn of(config: &GapConfig, kind: &Kind) -> Self {
        Self {
            z: config.constancy_z,
            spread: if config.applies(Rule::Constancy) {
                config.constancy_spread.max(kind.wanders)
            } else {
                f64::INFINITY
            },
        }
    }

    /// Whether sizes with this standard score and spread are one size.
    fn hold(self, z: f64, spread: f64) -> bool {
        z < self.z || spread < self.spread
    }
}

/// The same with another way from a part of a signature to its column.
pub fn constancy_of(
    stack: &Stack<'_>,
    raw: &[f64],
    column: &dyn Fn(Vec<f64>) -> DVector<f64>,
    jacobian: &[DVector<f64>],
    left: &DVector<f64>,
    limits: Limits,
) -> (Constancy, Check) {
    let mut worst = Constancy {
        passed: true,
        worst_z: 0.0,
        split_by: String::new(),
    };
    let mut decisive = Decisive::default();
    let halves =
        |run: &Run, _: &Block, row: &Row| (time_s(run, row) > middle_time(stack)).to_string();
    let times = ("time", split(stack, raw, column, halves));
    let by_condition = SPLITS
        .iter()
        .map(|(name, level)| (*name, split(stack, raw, column, level)));
    for (name, levels) in by_condition.chain([times]) {
        let levels: Vec<DVector<f64>> = levels
            .into_iter()
            .filter(|level| level.norm() > MIN_D_TO_COUNT_LEVEL)
            .collect();
        if levels.len() < 2 {
            continue;
        }
        let (z, spread) = split_score(&levels, jacobian, left);
        if z > worst.worst_z || worst.split_by.is_empty() {
            worst.worst_z = z;
            worst.split_by = name.to_owned();
        }
        worst.passed &= limits.hold(z, spread);
        decisive.take(limits, name, z, spread);
    }
    let check = decisive.check(limits, worst.passed);
    (worst, check)
}

/// The split that comes nearest to two sizes, by the nearer of its two limits.
#[derive(Default)]
struct Decisive {
    /// Value over limit, with the check as it would pass.
    nearest: Option<(f64, Check)>,
}

impl Decisive {
    fn take(&mut self, limits: Limits, split_by: &str, z: f64, spread: f64) {
        let check = |name: &str, value: f64, limit: f64| {
            let check = Check::new(CheckId::OneSize, true).with(value, limit);
            (value / limit, check.named(format!("{name} by {split_by}")))
        };
        let score = check("standard score of different sizes", z, limits.z);
        let spread = check("spread of sizes over their mean", spread, limits.spread);
        let nearer = if spread.0 < score.0 { spread } else { score };
        if self
            .nearest
            .as_ref()
            .is_none_or(|(known, _)| nearer.0 > *known)
        {
            self.nearest = Some(nearer);
        }
    }

    fn check(self, limits: Limits, passed: bool) -> Check {
        let untried = Check::new(CheckId::OneSize, true);
        match self.nearest {
            None => untried.not_tried(),
            // The rule is switched off.
            Some(_) if limits.spread.is_infinite() => untried.not_tried(),
            Some((_, check)) if passed => check,
            Some((_, check)) => Check {
                verdict: Verdict::Failed,
                ..check
            },
        }
    }
}

fn middle_time(stack: &Stack<'_>) -> f64 {
    let starts = stack.runs.iter().map(|run| {
        let motion = &stack.session.runs[*run].motion;
        motion.time_s.first().copied().unwrap_or(0.0)
    });
    let mut starts: Vec<f64> = starts.collect();
    starts.sort_by(f64::total_cmp);
    starts.get(starts.len() / 2).map_or(0.0, |t| t - 1e-9)
}

/// The signature in each level of a condition.
fn split(
    stack: &Stack<'_>,
    raw: &[f64],
    column: &dyn Fn(Vec<f64>) -> DVector<f64>,
    level: impl Fn(&Run, &Block, &Row) -> String,
) -> Vec<DVector<f64>> {
    let mut levels = BTreeMap::<String, Vec<f64>>::new();
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        for (place, row) in block.range().zip(&block.rows) {
            let part = levels
                .entry(level(run, block, row))
                .or_insert_with(|| vec![0.0; stack.rows.len]);
            part[place] = raw[place];
        }
    }
    if levels.len() < 2 || levels.len() > 8 {
        return vec![];
    }
    levels.into_values().map(column).collect()
}

/// Score and spread of separate sizes.
fn split_score(
    levels: &[DVector<f64>],
    jacobian: &[DVector<f64>],
    left: &DVector<f64>,
) -> (f64, f64) {
    // What is not proportional to its size has a derivative that is not along the signature: one size for all levels
    // is a column of its own.
    let whole = levels
        .iter()
        .fold(DVector::zeros(left.len()), |sum, level| sum + level);
    let free = jacobian.len() + 1;
    let columns: Vec<DVector<f64>> = jacobian
        .iter()
        .chain([&whole])
        .chain(levels)
        .cloned()
        .collect();
    let normal = Normal::new(&DMatrix::from_columns(&columns), left);
    let common: Vec<usize> = (0..free).collect();
    let more: Vec<usize> = (0..columns.len()).collect();
    let gain = normal.solve(&more).gain - normal.solve(&common).gain;
    let freedom = count(levels.len() - 1);
    let alone: Vec<usize> = (free..columns.len()).collect();
    let apart = normal.solve(&alone).sizes;
    let mean = apart.iter().sum::<f64>() / count(apart.len());
    let spread = apart.iter().map(|e| (e - mean).abs()).fold(0.0, f64::max);
    (
        wilson_hilferty(gain, freedom),
        spread / (1.0 + mean).abs().max(0.1),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_may_be_late_by_half_more_or_less_and_a_play_has_one_width() {
        let mut config = GapConfig::default();
        let holds = |config: &GapConfig, id: &str, spread: f64| {
            Limits::of(config, twin::effects::kind(id).unwrap()).hold(6.0, spread)
        };
        assert!(holds(&config, "clock_offset", 0.4));
        assert!(!holds(&config, "clock_offset", 0.6));
        assert!(holds(&config, "backlash", 0.05));
        assert!(!holds(&config, "backlash", 0.4));
        config.ablated = [Rule::Constancy].into();
        assert!(holds(&config, "backlash", 4.0));
    }

    /// Two levels of 200 rows in which a signature is alike.
    fn levels() -> [DVector<f64>; 2] {
        [0, 1].map(|level| {
            DVector::from_fn(400, |row, _| {
                let own = row / 200 == level;
                if own { (0.1 * row as f64).sin() } else { 0.0 }
            })
        })
    }

    /// What [`gain`] of the first of two signatures is in each of five runs of 200 rows, of which the second one is seen in
    /// `runs` and there is what the first is.
    fn gains(runs: std::ops::Range<usize>, z: impl Fn(&DMatrix<f64>) -> DVector<f64>) -> Vec<Gain> {
        let columns = DMatrix::from_fn(1000, 2, |row, member| {
            let is_seen = member == 0 || runs.contains(&(row / 200));
            if is_seen {
                (0.1 * row as f64).sin()
            } else {
                0.0
            }
        });
        let z = z(&columns);
        let whole = Normal::new(&columns, &z);
        (0..5)
            .map(|run| 200 * run..200 * (run + 1))
            .map(|fold| gain(&whole, &within(&columns, &z, &[fold]), 0))
            .collect()
    }

    fn sum_of(sizes: [f64; 2]) -> impl Fn(&DMatrix<f64>) -> DVector<f64> {
        move |columns| columns * DVector::from_row_slice(&sizes)
    }

    fn holds(gains: &[Gain]) -> bool {
        !checks(gains).iter().any(Check::has_failed)
    }

    #[test]
    fn eq1_runs_that_another_member_tells_alike_say_nothing() {
        let told = gains(3..5, sum_of([1.0, 0.2]));
        let tells = |one: &Gain| one.tells && one.gain > 9.0;
        assert!(told[..3].iter().all(tells), "{told:?}");
        assert!(told[3..].iter().all(|one| !one.tells), "{told:?}");
        assert!(holds(&told));
    }

    #[test]
    fn eq1_one_run_that_tells_against_a_member_is_not_outvoted_by_what_says_nothing() {
        // Told in the first run alone, and there the other way round than beside the other member.
        let told = gains(1..5, |columns| {
            DVector::from_fn(1000, |row, _| {
                columns[(row, 0)] * if row < 200 { -1.0 } else { 1.0 }
            })
        });
        assert!(!holds(&told), "{told:?}");
        let lost = Gain {
            gain: -50.0,
            tells: true,
        };
        assert!(!holds(&[lost, lost, lost]));
    }

    #[test]
    fn eq1_what_no_other_member_tells_is_gained_everywhere() {
        let told = gains(0..0, sum_of([1.0, 0.0]));
        assert!(
            told.iter().all(|one| one.tells && one.gain > 9.0),
            "{told:?}"
        );
    }

    #[test]
    fn eq2_one_size_that_is_off_everywhere_is_no_second_size() {
        let [a, b] = levels();
        // A size that was sought along a derivative which is not the signature itself is off everywhere alike.
        let derivative = DVector::from_fn(400, |row, _| (0.037 * row as f64).cos());
        let (z, spread) = split_score(
            &[&a, &b].map(Clone::clone),
            &[derivative],
            &((&a + &b) * 0.8),
        );
        assert!(z < 1.0 && spread < 1e-6, "{z} {spread}");
    }

    #[test]
    fn eq2_two_sizes_are_told() {
        let [a, b] = levels();
        let left = &a * 0.8 - &b * 0.8;
        let (z, spread) = split_score(&[a, b], &[], &left);
        assert!(z > 4.0 && spread > 0.5, "{z} {spread}");
    }
}
