//! Noise of a log whose neighbouring rows share part of it, as a drifting amplifier, air or a controller's ripple leaves it.
//!
//! # Model
//!
//! Over W rows what a log shows is a parabola of the time, and noise with the variance s^2 that falls by p from row to row:
//!
//! ```text
//!   e = M y,   M = 1 - H,   H the parabola's projection                          (1)
//!   E sum e_i^2       = s^2 tr(M R(p)),        R_ij = p^|i - j|                  (2)
//!   E sum e_i e_{i+1} = s^2 sum_i (M R(p) M)_{i,i+1}                             (3)
//! ```
//!
//! p is where (3)/(2) is the ratio that all windows show, s^2 then follows from (2). Windows with much more left than the middle
//! one are passed over: there the machine changes faster than a parabola.
//!
//! # Holds when
//! Rows follow one another evenly, and what the machine does changes little within W rows. A memory that lasts longer than a window
//! cannot be separated from what the machine does.
//!
//! # References
//! \[1\] G. E. P. Box, G. M. Jenkins, G. C. Reinsel, Time Series Analysis, 4th ed., Wiley 2008, 3.2 (autoregression).

use nalgebra::{DMatrix, DVector};
use twin::Session;

use crate::noise::whitener::Autoregression;
use crate::search::nuisance::orthonormal;
use crate::search::rows::{Block, count};
use crate::session::log;

/// W.
const WINDOW_ROWS: usize = 15;
/// Windows begin so many rows apart.
const STRIDE_ROWS: usize = 8;
/// Fewest windows.
const FEWEST_WINDOWS: usize = 4;
/// Steps of time within a window differ by this factor at most.
const MOST_UNEVEN: f64 = 1.5;
/// What is left in a window, over that of the middle one.
const MOST_LEFT_IN_WINDOW: f64 = 4.0;
/// Greatest p.
const MOST_SHARED: f64 = 0.95;
/// Least p that is taken: for white noise, neighbouring rows alone suffice.
const LEAST_SHARED: f64 = 0.15;
/// Standard errors by which the ratio exceeds that of white noise.
const MIN_SCORE: f64 = 3.0;

/// The noise of some logs of one channel, and the independent rows that it is known from; `None` where it is white, or where too
/// few rows follow one another.
pub(super) fn shared(
    session: &Session,
    blocks: &[&Block],
    raw: &[f64],
) -> Option<(Autoregression, f64)> {
    let left = left_of_parabola();
    let mut windows: Vec<[f64; 2]> = blocks
        .iter()
        .flat_map(|block| windows(session, block, raw, &left))
        .collect();
    if windows.len() < FEWEST_WINDOWS {
        return None;
    }
    let mut squares: Vec<f64> = windows.iter().map(|[square, _]| *square).collect();
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
    let most = MOST_LEFT_IN_WINDOW * *median;
    windows.retain(|[square, _]| *square <= most);
    let sum = |k: usize| windows.iter().map(|window| window[k]).sum::<f64>();
    let (square, product) = (sum(0), sum(1));
    let ratio = product / square;
    let rows = count(windows.len() * STRIDE_ROWS);
    let [white_square, white_product] = expected(&left, 0.0);
    if ratio <= white_product / white_square + MIN_SCORE / rows.sqrt() {
        return None;
    }
    let share = root(|share| {
        let [square, product] = expected(&left, share);
        product / square - ratio
    });
    if share < LEAST_SHARED {
        return None;
    }
    let variance = square / (count(windows.len()) * expected(&left, share)[0]);
    let freedom = rows * (1.0 - share) / (1.0 + share);
    Some((
        Autoregression::levinson(&[variance, share * variance]),
        freedom,
    ))
}

/// M of (1).
fn left_of_parabola() -> DMatrix<f64> {
    let power = |power: i32| {
        let middle = 0.5 * count(WINDOW_ROWS - 1);
        DVector::from_fn(WINDOW_ROWS, |row, _| (count(row) - middle).powi(power))
    };
    let basis = orthonormal(WINDOW_ROWS, (0..3).map(power));
    DMatrix::identity(WINDOW_ROWS, WINDOW_ROWS) - &basis * basis.transpose()
}

/// Sums of (2) and (3) of each window of a block.
fn windows(session: &Session, block: &Block, raw: &[f64], left: &DMatrix<f64>) -> Vec<[f64; 2]> {
    let times_s = log::since_s(session, block);
    let rows = raw.get(block.range()).unwrap_or(&[]);
    let starts = (0..rows.len().min(times_s.len())).step_by(STRIDE_ROWS);
    let of = |start: usize| {
        let own = start..start + WINDOW_ROWS;
        let (y, t) = (rows.get(own.clone())?, times_s.get(own)?);
        let steps = || t.windows(2).map(|two| two[1] - two[0]);
        let least = steps().fold(f64::INFINITY, f64::min);
        let most = steps().fold(0.0, f64::max);
        let is_even = least > 0.0 && most < MOST_UNEVEN * least;
        let e = left * DVector::from_column_slice(y);
        let products = e.as_slice().windows(2).map(|two| two[0] * two[1]);
        (is_even && e.norm_squared() > 0.0).then(|| [e.norm_squared(), products.sum()])
    };
    starts.filter_map(of).collect()
}

/// (2) and (3) for a variance of 1.
fn expected(left: &DMatrix<f64>, share: f64) -> [f64; 2] {
    let distance = |i: usize, j: usize| i32::try_from(i.abs_diff(j)).unwrap_or(i32::MAX);
    let noise = DMatrix::from_fn(WINDOW_ROWS, WINDOW_ROWS, |i, j| share.powi(distance(i, j)));
    let told = left * noise * left;
    let product = (1..WINDOW_ROWS).map(|i| told[(i - 1, i)]).sum();
    [told.trace(), product]
}

/// Where a rising function of p is zero, from none to the greatest.
fn root(rising: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, MOST_SHARED);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if rising(middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn told(share: f64, rows: usize, seed: u64) -> (f64, f64) {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let left = left_of_parabola();
        let (mut before, mut sums) = (draw(), [0.0, 0.0]);
        let windows = rows / WINDOW_ROWS;
        for _ in 0..windows {
            let y = DVector::from_fn(WINDOW_ROWS, |row, _| {
                before = share * before + (1.0 - share * share).sqrt() * draw();
                before + 3.0 * count(row) + 0.2 * count(row * row)
            });
            let e = &left * y;
            sums[0] += e.norm_squared();
            sums[1] += { e.as_slice().windows(2) }
                .map(|two| two[0] * two[1])
                .sum::<f64>();
        }
        let ratio = sums[1] / sums[0];
        let share = root(|share| {
            let [square, product] = expected(&left, share);
            product / square - ratio
        });
        (
            share,
            sums[0] / (count(windows) * expected(&left, share)[0]),
        )
    }

    #[test]
    fn eq3_what_neighbours_share_is_found_beside_a_parabola() {
        for (share, seed) in [(0.3, 1), (0.6, 2), (0.8, 3)] {
            let (found, variance) = told(share, 15_000, seed);
            assert!((found - share).abs() < 0.05, "{share}: {found}");
            // Of what lasts longer than a window little is seen.
            assert!((variance - 1.0).abs() < 0.35, "{share}: {variance}");
        }
    }
}
