//! Noise of a single run that came to its targets from both sides.
//!
//! # Model
//!
//! At a target the readings y from below and from above share the error of the place, whatever its form along the axis. What
//! they differ by is the lost motion b, smooth along the axis, and noise:
//!
//! ```text
//!   d_i = (y_i(up) - y_i(down)) / sqrt 2 = sum_k b_k P_k(x_i) / sqrt 2 + e_i,   k = 0 .. K - 1    (1)
//! ```
//!
//! e has the variance of a reading. K is a third of the targets, three at most; what varies faster counts as noise.
//!
//! # Holds when
//! The places are targets: stops, or places farther apart than the axis' periodic errors are long. Waves along a path are taken out
//! by smooth modes better.

use metrology::Axis;
use nalgebra::DMatrix;

use super::{Difference, Readings};
use crate::search::field::{self, Mode};
use crate::search::rows::{Block, count, position};

/// Places nearer than this share of a lead are one target.
const ONE_TARGET: f64 = 0.02;
/// Targets of a run without stops are farther apart than this share of a lead.
const LEAST_APART: f64 = 0.45;
/// Fewest targets.
const FEWEST_PAIRS: usize = 4;
/// Targets for each b of (1).
const TARGETS_OF_A_MODE: usize = 3;
/// Most b of (1).
const MOST_MODES: usize = 3;

/// (1) of a block; `None` where its rows are no targets read from both sides.
pub(super) fn difference(readings: Readings<'_>, raw: &[f64], block: &Block) -> Option<Difference> {
    let run = &readings.session.runs[block.run];
    let (axis, low_mm, high_mm) = field::leading_axis(run, block)?;
    let lead_mm = readings.machine.linear(axis)?.lead_mm;
    let places = |row: usize| position(run, &block.rows[row], axis);
    let least_apart_mm = if run.segment.stations > 0 {
        0.0
    } else {
        LEAST_APART * lead_mm
    };
    let pairs = pairs(
        block.rows.len(),
        &places,
        [ONE_TARGET * lead_mm, least_apart_mm],
    )?;
    let raw = &raw[block.range()];
    let values = pairs
        .iter()
        .map(|[first, second]| (raw[*first] - raw[*second]) * std::f64::consts::FRAC_1_SQRT_2);
    let used = (pairs.len() / TARGETS_OF_A_MODE).clamp(1, MOST_MODES);
    let share = |row: usize| 2.0 * (places(row) - low_mm) / (high_mm - low_mm) - 1.0;
    let modes = DMatrix::from_fn(pairs.len(), used, |pair, mode| {
        let x = share(pairs[pair][0]);
        [1.0, x, 1.5 * x * x - 0.5][mode]
    });
    Some(Difference {
        paced: None,
        values: values.collect::<Vec<f64>>().into(),
        kinds: vec![Mode::Offset; used],
        open: DMatrix::zeros(pairs.len(), 0),
        modes,
    })
}

/// Rows of each target, the earlier one first; `None` where four fifths of the rows are no such pairs or a fourth of the targets
/// are nearer than the second limit. Places nearer than the first are one target.
fn pairs(
    rows: usize,
    place_mm: &dyn Fn(usize) -> f64,
    [one_mm, least_apart_mm]: [f64; 2],
) -> Option<Vec<[usize; 2]>> {
    let mut sorted: Vec<usize> = (0..rows).collect();
    sorted.sort_by(|a, b| place_mm(*a).total_cmp(&place_mm(*b)));
    let is_one = |a: &usize, b: &usize| place_mm(*b) - place_mm(*a) < one_mm;
    let targets: Vec<&[usize]> = sorted.chunk_by(is_one).collect();
    let at = |target: &&[usize]| target.first().map_or(f64::NAN, |row| place_mm(*row));
    let gaps = targets.windows(2).map(|two| at(&two[1]) - at(&two[0]));
    let close = gaps.filter(|gap| *gap < least_apart_mm).count();
    let pairs: Vec<[usize; 2]> = { targets.iter() }
        .filter_map(|target| match target[..] {
            [a, b] => Some([a.min(b), a.max(b)]),
            _ => None,
        })
        .collect();
    let is_enough = pairs.len() >= FEWEST_PAIRS && count(2 * pairs.len()) >= 0.8 * count(rows);
    (is_enough && 4 * close < targets.len()).then_some(pairs)
}

/// Whether an axis is read along, as targets of positioning are.
pub(super) fn is_along(channel: &twin::Channel) -> bool {
    use twin::Channel::{Length, Motor, Scale};
    match channel {
        Length(_) => true,
        Scale(axis) | Motor(axis) => Axis::LINEAR.contains(axis),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS_MM: [f64; 2] = [0.2, 4.5];

    #[test]
    fn targets_from_both_sides_are_pairs_and_other_rows_are_not() {
        // Up and down over targets that scatter by a micrometre.
        let up = [0.0, 40.0, 81.0, 120.0, 160.0];
        let both: Vec<f64> = { up.iter().copied() }
            .chain(up.iter().rev().map(|at| at + 1e-3))
            .collect();
        let found = pairs(both.len(), &|row| both[row], LIMITS_MM).unwrap();
        let wanted: Vec<[usize; 2]> = (0..5).map(|k| [k, 9 - k]).collect();
        assert_eq!(found, wanted);
        // One way; thrice at each; a path that is read everywhere; too few targets.
        assert_eq!(pairs(5, &|row| up[row], LIMITS_MM), None);
        let thrice: Vec<f64> = [up, up, up].concat();
        assert_eq!(pairs(15, &|row| thrice[row], LIMITS_MM), None);
        let path = |row: usize| 0.5 * count(row.min(39 - row));
        assert_eq!(pairs(40, &path, LIMITS_MM), None);
        assert!(pairs(40, &path, [0.2, 0.0]).is_some(), "close stops are");
        let three = |row: usize| 40.0 * count(row.min(5 - row));
        assert_eq!(pairs(6, &three, LIMITS_MM), None);
    }
}
