//! How surely the share of a place is known: whole runs drawn with replacement.
//!
//! # Model
//!
//! The share that only a place explains (`localise`, 4), of runs that count w times each:
//!
//! ```text
//!   G = sum_run w U_run' U_run,   a = sum_run w U_run' z_run,   x = G^-1 a                     (1)
//!   T_all = a' x,   T_all - T_others = x_F' ((G^-1)_FF)^-1 x_F,   T_F = a_F' (G_FF)^-1 a_F     (2)
//! ```
//!
//! What only a place explains is no more than what it explains by itself, T_F: columns that oppose each other lose more
//! together than either tells.
//!
//! The interval is that of `bootstrap`.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::bootstrap;
use crate::config::GapConfig;
use crate::families::Slot;
use crate::localise::Score;
use crate::places;
use crate::rows::count;
use crate::stack::Stack;

/// Fewest runs that are drawn from.
const LEAST_RUNS: usize = 5;
/// Draws.
const DRAWS: usize = 200;
/// What is added to a diagonal, as a share of its greatest entry: families may span the same.
const RIDGE: f64 = 1e-9;

/// One run in one slot.
struct Part {
    gram: DMatrix<f64>,
    along: DVector<f64>,
    square: f64,
    rows: f64,
}

/// One slot under some weights.
struct Drawn {
    gram: DMatrix<f64>,
    along: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    sizes: DVector<f64>,
    all: f64,
    beyond_noise: f64,
}

/// Interval of each place that the report lists; none where too few runs were read.
pub fn of_places(
    stack: &Stack<'_>,
    slots: &[Slot],
    scores: &[Score],
    config: &GapConfig,
) -> Vec<Option<[f64; 2]>> {
    let listed: Vec<&Score> = places::listed(scores).collect();
    let runs = stack.runs.len();
    if runs < LEAST_RUNS {
        return vec![None; listed.len()];
    }
    let parts: Vec<Vec<Part>> = slots.iter().map(|slot| parts(stack, slot)).collect();
    let shares = |weights: &[f64]| shares(slots, &parts, &listed, weights);
    let mut random = Pcg64Mcg::seed_from_u64(config.seed ^ 0x54);
    let draws: Vec<Vec<f64>> = (0..DRAWS)
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
        (low.is_finite() && high.is_finite()).then_some([low, high])
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

/// (2) of every listed place over what is beyond noise in all slots, as `localise` takes it.
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
        let columns = count(drawn.sizes.len());
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
    let ridge = RIDGE * gram.diagonal().iter().copied().fold(1.0, f64::max);
    for place in 0..k {
        gram[(place, place)] += ridge;
    }
    let factor = Cholesky::new(gram.clone())?;
    let sizes = factor.solve(&along);
    let all = along.dot(&sizes);
    let columns = count(k);
    let told = (all - columns).max(0.0);
    let beyond_noise = told + (square - all - (rows - columns).max(0.0)).max(0.0);
    Some(Drawn {
        gram,
        along,
        factor,
        sizes,
        all,
        beyond_noise,
    })
}

/// What some columns tell by themselves.
fn told(drawn: &Drawn, own: &std::ops::Range<usize>) -> f64 {
    let (start, n) = (own.start, own.len());
    let gram = drawn.gram.view((start, start), (n, n)).into_owned();
    let along = drawn.along.rows(start, n).into_owned();
    Cholesky::new(gram).map_or(0.0, |factor| along.dot(&factor.solve(&along)))
}

/// What is lost without some columns.
fn lost(drawn: &Drawn, own: &std::ops::Range<usize>) -> f64 {
    let (k, q) = (drawn.sizes.len(), own.len());
    let mut units = DMatrix::zeros(k, q);
    for (column, row) in own.clone().enumerate() {
        units[(row, column)] = 1.0;
    }
    let inverse = drawn.factor.solve(&units).rows(own.start, q).into_owned();
    let sizes = drawn.sizes.rows(own.start, q).into_owned();
    Cholesky::new(inverse).map_or(0.0, |factor| sizes.dot(&factor.solve(&sizes)))
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
    fn eq2_what_is_lost_is_what_a_fit_without_these_columns_lacks() {
        let parts = [part(1), part(2), part(5)];
        let drawn = drawn(&parts, &[1.0, 2.0, 0.0]).unwrap();
        let normal = crate::normal::Normal {
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
}
