//! What share of the gap is closed on runs that were judged, with its interval.
//!
//! # Model
//!
//! ```text
//!   G2 = rms2 - floor2,   closed = 1 - G2_after / G2_before               (1)
//!   floor2 = sum over channels of  w f_w + b f_b                          (2)
//! ```
//!
//! with w and b what noise within and between runs adds (`gap`). The interval draws whole runs with replacement, the
//! same before and after (`bootstrap`), and with them how well a few repeats know the floor: f = nu / chi2(nu), drawn for
//! each channel and either part with its degrees of freedom nu. What is told is at most one. Where less is left than the
//! floor, the floor was taken with more caution than these runs need (`noise`): the interval is then made with
//!
//! ```text
//!   floor2 c,   c = min(1, sum rms2_after / sum floor2)                   (3)
//! ```
//!
//! so that what is left is the middle of the draws. With the floor as it is, every draw would be closed whole, and
//! what is not known of the noise would be no doubt.
//!
//! The interval is absent where the gap before cannot be told from none, and where fewer than [`MIN_RUNS_CLOSED`] runs were judged:
//! what one or two runs have alike says nothing of others.

use std::collections::BTreeMap;

use rand::{Rng, SeedableRng};
use rand_distr::{ChiSquared, Distribution};
use rand_pcg::Pcg64Mcg;
use twin::Channel;

use crate::config::GapConfig;
use crate::noise::Noise;
use crate::noise::bootstrap;
use crate::noise::stack::Stack;
use crate::report::Interval;
use crate::shrink::gap::Size;

/// Fewest runs that are drawn from.
pub const MIN_RUNS_CLOSED: usize = 3;

/// Sums of one run, one entry a channel.
type Sums = Vec<Sum>;

/// Sums over some rows, mm².
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    before: f64,
    after: f64,
    /// Within runs and between them.
    floor: [f64; 2],
}

/// (1) with its interval; `sizes` are those of every block before and after.
pub fn closed(
    stack: &Stack<'_>,
    noise: &BTreeMap<Channel, Noise>,
    judged: &[usize],
    sizes: &[Vec<Size>; 2],
    config: &GapConfig,
) -> Option<Interval> {
    let channels: Vec<&Channel> = noise.keys().collect();
    let runs: Vec<Sums> = judged
        .iter()
        .map(|run| of_run(stack, &channels, *run, sizes))
        .collect();
    let freedom: Vec<[f64; 2]> = noise
        .values()
        .map(|noise| [noise.freedom, noise.field_freedom])
        .collect();
    interval(&runs, &freedom, config)
}

fn of_run(stack: &Stack<'_>, channels: &[&Channel], run: usize, sizes: &[Vec<Size>; 2]) -> Sums {
    let mut sums = vec![Sum::default(); channels.len()];
    let blocks = stack.rows.blocks.iter().zip(&sizes[0]).zip(&sizes[1]);
    for ((block, before), after) in blocks.filter(|((block, _), _)| block.run == run) {
        let Some(place) = channels.iter().position(|c| **c == block.channel) else {
            continue;
        };
        sums[place].before += before.squares();
        sums[place].after += after.squares();
        for (own, floor) in sums[place].floor.iter_mut().zip(before.floor_squares()) {
            *own += floor;
        }
    }
    sums
}

fn interval(runs: &[Sums], freedom: &[[f64; 2]], config: &GapConfig) -> Option<Interval> {
    if runs.len() < MIN_RUNS_CLOSED {
        return None;
    }
    let told = share(runs.iter(), &vec![[1.0; 2]; freedom.len()])?;
    let caution = caution(runs);
    let known = vec![[caution; 2]; freedom.len()];
    let value = share(runs.iter(), &known)?;
    let mut random = Pcg64Mcg::seed_from_u64(config.seed ^ 0x7);
    let draw = |_| {
        let factors: Vec<[f64; 2]> = freedom
            .iter()
            .map(|pair| pair.map(|nu| caution * factor(nu, &mut random)))
            .collect();
        let drawn = (0..runs.len()).map(|_| &runs[random.random_range(0..runs.len())]);
        share(drawn, &factors)
    };
    let draws: Vec<f64> = (0..config.bootstrap_draws).filter_map(draw).collect();
    if draws.len() * 40 < config.bootstrap_draws * 39 {
        return None;
    }
    let without_each: Vec<f64> = (0..runs.len())
        .filter_map(|out| {
            let others = runs.iter().enumerate().filter(|(run, _)| *run != out);
            share(others.map(|(_, run)| run), &known)
        })
        .collect();
    let [low, high] = bootstrap::bca(value, draws, &without_each);
    Some(Interval {
        value: told.min(1.0),
        low: low.min(told).min(1.0),
        high: high.max(told).min(1.0),
    })
}

/// (3).
fn caution(runs: &[Sums]) -> f64 {
    let sum = |of: &dyn Fn(&Sum) -> f64| runs.iter().flatten().map(of).sum::<f64>();
    let floor = sum(&|sum| sum.floor[0] + sum.floor[1]);
    (sum(&|sum| sum.after) / floor.max(f64::MIN_POSITIVE)).min(1.0)
}

/// What a variance that is known with some degrees of freedom may be, over what it was found to be.
fn factor(freedom: f64, random: &mut impl Rng) -> f64 {
    let law = ChiSquared::new(freedom.max(1.0)).ok();
    law.map_or(1.0, |law| freedom.max(1.0) / law.sample(random))
}

/// (1) of some runs, the floor of each channel times its factors (2); none where there is no gap before.
fn share<'s>(runs: impl Iterator<Item = &'s Sums>, factors: &[[f64; 2]]) -> Option<f64> {
    let (mut before, mut after) = (0.0, 0.0);
    for (sum, factors) in runs.flat_map(|run| run.iter().zip(factors)) {
        let floor = sum.floor[0] * factors[0] + sum.floor[1] * factors[1];
        before += sum.before - floor;
        after += sum.after - floor;
    }
    (before > 0.0).then(|| 1.0 - after / before)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(after: [f64; 6]) -> Vec<Sums> {
        let run = |after: f64| {
            vec![Sum {
                before: 5.0,
                after,
                floor: [0.6, 0.4],
            }]
        };
        after.map(run).to_vec()
    }

    #[test]
    fn a_gap_that_is_closed_to_below_its_floor_is_still_closed_with_doubt() {
        let runs = runs([0.7, 1.2, 0.8, 1.1, 0.9, 1.0]);
        let found = interval(&runs, &[[200.0, 12.0]], &GapConfig::default()).unwrap();
        assert!((found.value - 1.0).abs() < 1e-12, "{found:?}");
        assert!(found.low < 0.97 && found.low > 0.8, "{found:?}");
        assert!((found.high - 1.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn eq3_where_less_is_left_than_a_cautious_floor_what_is_not_known_of_noise_stays_a_doubt() {
        let runs = runs([0.35, 0.6, 0.4, 0.55, 0.45, 0.5]);
        let found = interval(&runs, &[[200.0, 12.0]], &GapConfig::default()).unwrap();
        assert!((found.value - 1.0).abs() < 1e-12, "{found:?}");
        assert!(found.low < 0.99 && found.low > 0.85, "{found:?}");
    }

    #[test]
    fn one_run_or_two_have_no_interval() {
        let runs = runs([0.7, 1.2, 0.8, 1.1, 0.9, 1.0]);
        let of = |n: usize| interval(&runs[..n], &[[200.0, 12.0]], &GapConfig::default());
        assert!(of(1).is_none() && of(2).is_none() && of(3).is_some());
    }

    #[test]
    fn a_floor_that_is_known_less_widens_the_interval() {
        let runs = runs([2.1, 2.3, 1.9, 2.2, 2.0, 2.05]);
        let width = |nu: f64| {
            let found = interval(&runs, &[[nu, nu]], &GapConfig::default()).unwrap();
            assert!(
                (found.value - (1.0 - 1.0917 / 4.0)).abs() < 1e-3,
                "{found:?}"
            );
            found.high - found.low
        };
        assert!(width(5.0) > 2.0 * width(5000.0));
    }
}
