//! How surely the share of a place is known: whole runs drawn with replacement.
//!
//! # Model
//!
//! The share that only a place explains (`localise`, 4), of runs that count w times each:
//!
//! ```text
//!   G = sum_run w U_run' U_run,   a = sum_run w U_run' z_run                                   (1)
//! ```
//!
//! solved as `localise` solves them, columns that others span left out alike: a ridge instead would take what noise there is in
//! them for something that a place explains.
//!
//! What only a place explains is no more than what it explains by itself, T_F: columns that oppose each other lose more
//! together than either tells.
//!
//! The interval is that of `bootstrap`. Of few runs a draw lacks some, and what goes with time is told from the rest by fewer, so
//! that most draws have a greater share than all runs together: where the interval does not hold the share it is not told. Those
//! that are told are therefore no unselected 95 %.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::config::GapConfig;
use crate::noise::bootstrap;
use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::report::localise::Score;
use crate::report::places;
use crate::search::families::Slot;
use crate::search::rows::count;

/// Fewest runs that are drawn from.
const MIN_RUNS_DRAWN: usize = 5;
/// Draws.
const BOOTSTRAP_DRAWS: usize = 200;

/// One run in one slot.
struct Part {
    gram: DMatrix<f64>,
    along: DVector<f64>,
    square: f64,
    rows: f64,
}

/// One slot under some weights.
struct Drawn {
    normal: Normal,
    all: f64,
    beyond_noise: f64,
}

/// Interval of each place that the report lists; none where too few runs were read, or draws of them do not hold the share.
pub fn of_places(
    stack: &Stack<'_>,
    slots: &[Slot],
    scores: &[Score],
    config: &GapConfig,
) -> Vec<Option<[f64; 2]>> {
    let listed: Vec<&Score> = places::listed(scores).collect();
    let runs = stack.runs.len();
    if runs < MIN_RUNS_DRAWN {
        return vec![None; listed.len()];
    }
    let parts: Vec<Vec<Part>> = slots.iter().map(|slot| parts(stack, slot)).collect();
    let shares = |weights: &[f64]| shares(slots, &parts, &listed, weights);
    let mut random = Pcg64Mcg::seed_from_u64(config.seed ^ 0x54);
    let draws: Vec<Vec<f64>> = (0..BOOTSTRAP_DRAWS)
        .filter_map(|_| {
            let mut weights = vec![0.0; runs];
            for _ in 0..runs {
                weights[random.random_range(0..runs)] += 1.0;
            }
            shares(&weights)
        })
        .collect();
    let without_each: Vec<Vec<f64>> = (0..runs)
        .filter_map(|out| {
            let mut weights = vec![1.0; runs];
            weights[out] = 0.0;
            shares(&weights)
        })
        .collect();
    let of = |(place, score): (usize, &&Score)| {
        let column = |of: &[Vec<f64>]| of.iter().map(|shares| shares[place]).collect::<Vec<_>>();
        let [low, high] = bootstrap::bca(score.unique, column(&draws), &column(&without_each));
        (low <= score.unique && score.unique <= high).then_some([low, high])
    };
    listed.iter().enumerate().map(of).collect()
}

fn parts(stack: &Stack<'_>, slot: &Slot) -> Vec<Part> {
    let k = slot.basis.ncols();
    let empty = || Part {
        gram: DMatrix::zeros(k, k),
        along: DVector::zeros(k),
        square: 0.0,
        rows: 0.0,
    };
    let mut parts: Vec<Part> = stack.runs.iter().map(|_| empty()).collect();
    let mut first = 0;
    for &index in &slot.blocks {
        let block = &stack.rows.blocks[index];
        let n = block.rows.len();
        if let Some(run) = stack.runs.iter().position(|run| *run == block.run) {
            let basis = slot.basis.rows(first, n);
            let z = stack.z.rows(block.start, n);
            parts[run].gram += basis.tr_mul(&basis);
            parts[run].along += basis.tr_mul(&z);
            parts[run].square += z.norm_squared();
            parts[run].rows += count(n);
        }
        first += n;
    }
    parts
}

/// The share of every listed place over what is beyond noise in all slots, as `localise` takes it.
fn shares(
    slots: &[Slot],
    parts: &[Vec<Part>],
    listed: &[&Score],
    weights: &[f64],
) -> Option<Vec<f64>> {
    let drawn: Vec<Drawn> = parts
        .iter()
        .map(|parts| drawn(parts, weights))
        .collect::<Option<_>>()?;
    let structured = drawn.iter().map(|drawn| drawn.beyond_noise).sum::<f64>();
    let structured = structured.max(1.0);
    let share = |score: &&Score| {
        let own = slots[score.slot].families[score.family].columns.clone();
        let drawn = &drawn[score.slot];
        let columns = count(drawn.normal.along.len());
        let most = (drawn.all - columns).max(0.0);
        let whole = (told(drawn, &own) - count(own.len())).clamp(0.0, most);
        (lost(drawn, &own) - count(own.len())).clamp(0.0, whole) / structured
    };
    Some(listed.iter().map(share).collect())
}

/// (1).
fn drawn(parts: &[Part], weights: &[f64]) -> Option<Drawn> {
    let k = parts.first()?.along.len();
    let (mut gram, mut along) = (DMatrix::zeros(k, k), DVector::zeros(k));
    let (mut square, mut rows) = (0.0, 0.0);
    for (part, weight) in parts
        .iter()
        .zip(weights)
        .filter(|(_, weight)| **weight > 0.0)
    {
        gram += &part.gram * *weight;
        along.axpy(*weight, &part.along, 1.0);
        square += weight * part.square;
        rows += weight * part.rows;
    }
    let normal = Normal { gram, along };
    let every: Vec<usize> = (0..k).collect();
    let all = normal.solve(&every).gain;
    let columns = count(k);
    let told = (all - columns).max(0.0);
    let beyond_noise = told + (square - all - (rows - columns).max(0.0)).max(0.0);
    Some(Drawn {
        normal,
        all,
        beyond_noise,
    })
}

/// What some columns tell by themselves.
fn told(drawn: &Drawn, own: &Range<usize>) -> f64 {
    let own: Vec<usize> = own.clone().collect();
    drawn.normal.solve(&own).gain
}

/// What is lost without some columns.
fn lost(drawn: &Drawn, own: &Range<usize>) -> f64 {
    let columns = 0..drawn.normal.along.len();
    let others: Vec<usize> = columns.filter(|k| !own.contains(k)).collect();
    drawn.all - drawn.normal.solve(&others).gain
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four columns over six rows, and what is read there.
    fn part(seed: u32) -> Part {
        let value =
            |row: usize, k: usize| (f64::from(seed) + 1.7 * count(row) + 0.6 * count(k * k)).sin();
        let basis = DMatrix::from_fn(6, 4, value);
        let z = DVector::from_fn(6, |row, _| 3.0 * value(row, 1) + value(row, 7));
        Part {
            gram: basis.tr_mul(&basis),
            along: basis.tr_mul(&z),
            square: z.norm_squared(),
            rows: 6.0,
        }
    }

    #[test]
    fn eq1_what_is_lost_is_what_a_fit_without_these_columns_lacks() {
        let parts = [part(1), part(2), part(5)];
        let drawn = drawn(&parts, &[1.0, 2.0, 0.0]).unwrap();
        let normal = crate::noise::normal::Normal {
            gram: &parts[0].gram + &parts[1].gram * 2.0,
            along: &parts[0].along + &parts[1].along * 2.0,
        };
        let whole = normal.solve(&[0, 1, 2, 3]).gain;
        assert!((drawn.all - whole).abs() < 1e-6 * whole);
        for (own, others) in [(1..3, vec![0, 3]), (3..4, vec![0, 1, 2])] {
            let wanted = whole - normal.solve(&others).gain;
            assert!(
                (lost(&drawn, &own) - wanted).abs() < 1e-6 * whole,
                "{wanted}"
            );
            let alone = normal.solve(&own.clone().collect::<Vec<_>>()).gain;
            assert!((told(&drawn, &own) - alone).abs() < 1e-6 * whole, "{alone}");
        }
    }

    /// Time in a run that goes once round is the angle but for a ten-thousandth.
    #[test]
    fn what_others_span_explains_nothing_alone_although_noise_lies_in_what_they_lack() {
        let basis = DMatrix::from_fn(6, 2, |row, k| if row < 5 { 1.0 } else { 1e-4 * count(k) });
        let z = DVector::from_column_slice(&[20.0, 20.0, 20.0, 20.0, 20.0, 5.0]);
        let part = Part {
            gram: basis.tr_mul(&basis),
            along: basis.tr_mul(&z),
            square: z.norm_squared(),
            rows: 6.0,
        };
        let drawn = drawn(&[part], &[1.0]).unwrap();
        assert!((drawn.all - 2000.0).abs() < 1e-6, "{}", drawn.all);
        assert!(lost(&drawn, &(1..2)).abs() < 1e-6);
    }
}
