//! Whether the places of a recording resolve the period of an effect.
//!
//! # Model
//!
//! Of a wave of frequency f over the places x_i, and of one of another frequency g, with the columns
//! c(f) = (cos 2 pi f x, sin 2 pi f x) less their means:
//!
//! ```text
//!   r^2(f, g) = greatest eigenvalue of (c_f'c_f)^-1 c_f'c_g (c_g'c_g)^-1 c_g'c_f    (1)
//! ```
//!
//! A period is resolved where enough neighbouring places in a row lie closer than half of it, over two periods. Where they do not, as at the
//! targets of ISO 230-2, every wave is also a longer one: it is resolved only by many uneven places, at which (1) stays
//! small for every other frequency. Any curve fits a few targets, and so does a wave.
//!
//! # Holds when
//! The readings are of the places: what a row averages over is short beside the period.
//!
//! # References
//! \[1\] ISO 230-2:2014, 4.3 (targets at uneven distances, so that periodic errors are not sampled in step). \[2\] L. Eyer,
//! P. Bartholdi, Astron. Astrophys. Suppl. 135, 1999 (the frequencies that uneven places resolve).

use std::f64::consts::TAU;

use metrology::Axis;
use nalgebra::{DVector, Matrix2};
use twin::Channel;
use twin::effects::{Role, Target};

use crate::noise::stack::Stack;
use crate::search::rows::{Block, count, position};
use crate::search::signature::Instance;

/// Places nearer than this share of a period are one.
const ONE_PLACE: f64 = 0.02;
/// Neighbours closer than this share of a period show how it goes on between them.
const CLOSE: f64 = 0.45;
/// So many close neighbours in a row resolve a period, where they span so many of it: less of a wave is a curve.
const ENOUGH_CLOSE: usize = 16;
const MIN_PERIODS: f64 = 1.9;
/// With fewer places than this a curve of any form (17 heights) fits as well as a wave.
const FEWEST_PLACES: usize = 40;
/// A curve needs so many targets.
const FEWEST_TARGETS: usize = 5;
/// (1) from which two frequencies look alike at the places.
const MIN_LIKENESS_ALIASED: f64 = 0.75;
/// Most places that (1) is taken over, and most other frequencies.
const MAX_COMPARED: usize = 400;
/// A run shows signatures from this share of their squares on.
const MIN_SHARE_SEEN: f64 = 1e-4;
/// An axis moved in a run where it went further.
const MOVED_MM: f64 = 1.0;
/// Name of the parameter that is a period by itself, of an encoder's signal.
const PERIOD_UM: &str = "period_um";

/// Whether a recording resolves the period of an effect at some values; true of what has none.
pub fn shows(stack: &Stack<'_>, instance: &Instance, values: &[f64]) -> bool {
    let Target::Axis(axis) = instance.target else {
        return true;
    };
    period_mm(stack, instance, axis, values).is_none_or(|period_mm| {
        let compute = || resolves(&places_mm(stack, axis), period_mm);
        stack.resolves(axis, period_mm, compute)
    })
}

/// Whether an axis was read at some targets only, which resolve no turn of its screw, and nothing but positions along axes was
/// read: its errors between them are unknown, and a curve of any form goes through them.
pub fn is_coarse(stack: &Stack<'_>, axis: Axis) -> bool {
    if !is_along_axes(stack) {
        return false;
    }
    let Some(linear) = stack.twin.machine().linear(axis) else {
        return false;
    };
    let mut places = places_mm(stack, axis);
    let is_read = places.len() > 1;
    let is_resolved = resolves(&places, linear.lead_mm);
    places.dedup_by(|next, kept| *next - *kept < ONE_PLACE * linear.lead_mm);
    is_read && !is_resolved && places.len() >= FEWEST_TARGETS
}

/// Whether an axis was read at targets, and nothing but positions along axes: far apart (`is_coarse`), or where it stood still. A
/// curve of any form goes through them.
pub fn is_at_targets(stack: &Stack<'_>, axis: Axis) -> bool {
    if is_coarse(stack, axis) {
        return true;
    }
    let run = |block: &Block| &stack.session.runs[block.run];
    let mut blocks = stack.rows.blocks.iter();
    is_along_axes(stack)
        && blocks.all(|block| run(block).segment.stations > 0)
        && targets(stack, axis).is_some_and(|targets| targets.len() >= FEWEST_TARGETS)
}

/// Whether nothing but positions along axes was read.
pub fn is_along_axes(stack: &Stack<'_>) -> bool {
    let is_along = |channel: &Channel| {
        matches!(
            channel,
            Channel::Length(_) | Channel::Scale(_) | Channel::Motor(_)
        )
    };
    let mut blocks = stack.rows.blocks.iter();
    blocks.all(|block| is_along(&block.channel))
}

/// The least and the greatest place at which an axis was read, mm.
pub fn extent_mm(stack: &Stack<'_>, axis: Axis) -> Option<[f64; 2]> {
    let places = places_mm(stack, axis);
    Some([*places.first()?, *places.last()?])
}

/// The same over the runs in which it moved while an instrument followed that shows some signatures; none where that is at targets.
pub fn seen_mm(stack: &Stack<'_>, axis: Axis, shown: &[&DVector<f64>]) -> Option<[f64; 2]> {
    if is_at_targets(stack, axis) {
        return None;
    }
    let squares = |from: usize, len: usize| -> f64 {
        shown
            .iter()
            .map(|column| column.rows(from, len).norm_squared())
            .sum()
    };
    let least = MIN_SHARE_SEEN * squares(0, stack.rows.len);
    let is_followed = |block: &&Block| {
        !matches!(block.channel, Channel::Touch | Channel::Thermometer(_))
            && squares(block.start, block.rows.len()) > least
    };
    let ends_of = |block: &Block| {
        let run = &stack.session.runs[block.run];
        let places = block.rows.iter().map(|row| position(run, row, axis));
        let ends = |ends: [f64; 2], at: f64| [ends[0].min(at), ends[1].max(at)];
        places.fold([f64::INFINITY, f64::NEG_INFINITY], ends)
    };
    let followed = stack.rows.blocks.iter().filter(is_followed).map(ends_of);
    let moved = followed.filter(|[low, high]| high - low > MOVED_MM);
    moved.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// Rows of each target along an axis, by its place: readings nearer than a share of a lead are of one target.
pub fn targets(stack: &Stack<'_>, axis: Axis) -> Option<Vec<Vec<usize>>> {
    let lead_mm = stack.twin.machine().linear(axis)?.lead_mm;
    let mut placed: Vec<(f64, usize)> = vec![];
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        let rows = block.rows.iter().zip(block.range());
        placed.extend(rows.map(|(row, place)| (position(run, row, axis), place)));
    }
    placed.retain(|(at_mm, _)| at_mm.is_finite());
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_one = |a: &(f64, usize), b: &(f64, usize)| b.0 - a.0 < ONE_PLACE * lead_mm;
    let rows = |target: &[(f64, usize)]| target.iter().map(|(_, row)| *row).collect();
    Some(placed.chunk_by(is_one).map(rows).collect())
}

/// The period along an axis, mm; none of what has no period.
pub fn period_mm(
    stack: &Stack<'_>,
    instance: &Instance,
    axis: Axis,
    values: &[f64],
) -> Option<f64> {
    let parameters = instance.kind.parameters.iter().zip(values);
    parameters.into_iter().find_map(|(parameter, value)| {
        if matches!(parameter.role, Role::Frequency { .. }) {
            let linear = stack.twin.machine().linear(axis)?;
            Some(linear.lead_mm / value)
        } else {
            (parameter.name == PERIOD_UM).then_some(value * 1e-3)
        }
    })
}

/// Where an axis stood when something was read, mm, growing.
fn places_mm(stack: &Stack<'_>, axis: Axis) -> Vec<f64> {
    let blocks = stack.rows.blocks.iter();
    let mut places: Vec<f64> = blocks
        .flat_map(|block| {
            let run = &stack.session.runs[block.run];
            block.rows.iter().map(move |row| position(run, row, axis))
        })
        .filter(|place| place.is_finite())
        .collect();
    places.sort_by(f64::total_cmp);
    places
}

/// Whether places, growing, resolve a period.
fn resolves(places_mm: &[f64], period_mm: f64) -> bool {
    let mut apart = places_mm.to_vec();
    apart.dedup_by(|next, kept| *next - *kept < ONE_PLACE * period_mm);
    let mut rows = apart.chunk_by(|before, next| next - before < CLOSE * period_mm);
    let shows = |row: &[f64]| match row {
        [first, .., last] => row.len() > ENOUGH_CLOSE && last - first > MIN_PERIODS * period_mm,
        _ => false,
    };
    if rows.any(shows) {
        return true;
    }
    apart.truncate(MAX_COMPARED);
    apart.len() >= FEWEST_PLACES && is_alone(&apart, 1.0 / period_mm)
}

/// Whether no other frequency looks like this one at the places.
fn is_alone(places_mm: &[f64], per_mm: f64) -> bool {
    let (Some(first), Some(last)) = (places_mm.first(), places_mm.last()) else {
        return false;
    };
    let finest = 1.0 / (last - first);
    let own = Wave::new(places_mm, per_mm);
    let others = others(places_mm, per_mm, finest);
    others
        .into_iter()
        .filter(|other| (other - per_mm).abs() > 1.5 * finest)
        .all(|other| own.likeness(&Wave::new(places_mm, other)) < MIN_LIKENESS_ALIASED)
}

/// Other frequencies: longer waves, evenly, and those that even spacing makes the same.
fn others(places_mm: &[f64], per_mm: f64, finest: f64) -> Vec<f64> {
    let highest = (1.5 * per_mm).min(2.0 * count(places_mm.len()) * finest);
    let step = (0.25 * finest).max(highest / count(MAX_COMPARED));
    let even = std::iter::successors(Some(0.5 * finest), |f| Some(f + step));
    let mut others: Vec<f64> = even
        .take_while(|f| *f < highest)
        .take(MAX_COMPARED)
        .collect();
    let mut gaps: Vec<f64> = places_mm.windows(2).map(|two| two[1] - two[0]).collect();
    gaps.sort_by(f64::total_cmp);
    if let Some(gap) = gaps.get(gaps.len() / 2).filter(|gap| **gap > 0.0) {
        // The wave of at most half a period from place to place.
        let folded = (per_mm - (per_mm * gap).round() / gap).abs();
        others.extend([folded, 1.0 / gap - folded]);
    }
    others
}

/// Cosine and sine over the places, less their means.
struct Wave {
    columns: [Vec<f64>; 2],
    gram: Matrix2<f64>,
}

impl Wave {
    fn new(places_mm: &[f64], per_mm: f64) -> Self {
        let turns = places_mm.iter().map(|x| (TAU * per_mm * x).sin_cos());
        let (sin, cos): (Vec<f64>, Vec<f64>) = turns.unzip();
        let columns = [cos, sin].map(|column| {
            let mean = column.iter().sum::<f64>() / count(column.len().max(1));
            column
                .iter()
                .map(|value| value - mean)
                .collect::<Vec<f64>>()
        });
        let gram = products(&columns, &columns);
        Self { columns, gram }
    }

    /// (1); of a wave that has nothing at the places it is one.
    fn likeness(&self, other: &Self) -> f64 {
        let (Some(own), Some(theirs)) = (inverse(self.gram), inverse(other.gram)) else {
            return 1.0;
        };
        let between = products(&self.columns, &other.columns);
        let product = own * between * theirs * between.transpose();
        let (half, det) = (0.5 * product.trace(), product.determinant());
        half + (half * half - det).max(0.0).sqrt()
    }
}

/// Inverse of a Gram matrix; none where its columns are alike or nothing.
fn inverse(gram: Matrix2<f64>) -> Option<Matrix2<f64>> {
    let least = 1e-6 * gram.trace().powi(2);
    (gram.determinant() > least).then(|| gram.try_inverse())?
}

fn products(a: &[Vec<f64>; 2], b: &[Vec<f64>; 2]) -> Matrix2<f64> {
    Matrix2::from_fn(|i, j| a[i].iter().zip(&b[j]).map(|(x, y)| x * y).sum())
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn even(n: usize, spacing_mm: f64) -> Vec<f64> {
        (0..n).map(|k| count(k) * spacing_mm).collect()
    }

    fn uneven(n: usize, extent_mm: f64) -> Vec<f64> {
        let mut random = Pcg64Mcg::seed_from_u64(17);
        let mut places: Vec<f64> = (0..n)
            .map(|_| random.random_range(0.0..extent_mm))
            .collect();
        places.sort_by(f64::total_cmp);
        places
    }

    #[test]
    fn targets_farther_apart_than_half_a_period_resolve_none() {
        // 13 targets 46 mm apart and 5 targets 5 mm apart, a lead of 10 and of 2 mm; even ones, however many.
        for (places, period_mm) in [
            (even(13, 46.0), 10.0),
            (uneven(13, 560.0), 10.0),
            (even(5, 5.0), 2.0),
            (even(41, 12.0), 10.0),
            (even(200, 12.0), 10.0),
            (even(13, 46.0), 0.004),
            // A turn and a half; gaps of about half a period, some closer and some not.
            (even(31, 0.5), 10.0),
            (uneven(36, 180.0), 10.0),
        ] {
            assert!(
                !resolves(&places, period_mm),
                "{} {period_mm}",
                places.len()
            );
        }
    }

    #[test]
    fn close_targets_and_many_uneven_ones_resolve_a_period() {
        // 21 targets over two turns of the screw, as ISO 230-2 has them for periodic errors; a path read everywhere.
        for (places, period_mm) in [
            (even(21, 1.0), 10.0),
            (even(2000, 0.3), 10.0),
            (uneven(60, 600.0), 10.0),
            (uneven(300, 600.0), 4.0),
        ] {
            assert!(resolves(&places, period_mm), "{} {period_mm}", places.len());
        }
    }

    #[test]
    fn eq1_is_one_for_a_frequency_that_even_places_fold_onto() {
        let places = even(30, 12.0);
        let [own, folded, other] = [0.1, 1.0 / 12.0 - 0.1, 0.031].map(|f| Wave::new(&places, f));
        assert!((own.likeness(&folded) - 1.0).abs() < 1e-6);
        assert!(own.likeness(&other) < 0.1);
    }
}
