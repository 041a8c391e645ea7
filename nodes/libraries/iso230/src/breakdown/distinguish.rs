//! Which columns the recordings tell apart, and what would tell the others apart.
//!
//! # Model
//!
//! Columns are taken in order. With G = L Lᵀ the products of those so far:
//!
//! ```text
//!   sine_j² = 1 − |L⁻¹ Xᵀ x_j|² / |x_j|²                                      (1)
//!   sine_j ≥ least sine: kept;  else  x_j ≈ Σ a_ij x_i over the kept           (2)
//!   X β = Σ_kept x_i (β_i + Σ_j a_ij β_j)                                      (3)
//! ```
//!
//! So what is fitted for a kept column is the bracket of (3), whatever the single β are: it is the
//! estimable combination, and the only one to which the data give a number.

use std::cell::RefCell;

use nalgebra::DMatrix;

use super::columns::Columns;
use super::plane::Input;
use super::recording::{CircularRecording, CircularSample, CircularSense, ReferenceLength};
use super::report::Needed;
use super::scene::Scene;
use super::term::{RowKey, Term};

/// Shares of a column below this are rounding.
const NO_SHARE: f64 = 1e-6;
/// Samples of a recording that show which columns it tells apart.
const ENOUGH_SAMPLES: usize = 720;

/// A column that is a combination of kept ones, (2).
#[derive(Clone, Debug)]
pub(super) struct Dependent {
    /// Its place among the columns.
    pub column: usize,
    /// a of (2), by place of the kept column.
    pub aliases: Vec<(usize, f64)>,
}

/// Columns sorted into kept and dependent ones.
#[derive(Clone, Debug, Default)]
pub(super) struct Reduction {
    pub kept: Vec<usize>,
    pub dependent: Vec<Dependent>,
    /// Columns that are zero everywhere.
    pub unseen: Vec<usize>,
}

/// The triangle L of columns whose products are G = L Lᵀ, taken one by one.
#[derive(Clone, Debug, Default)]
pub(super) struct Triangle {
    /// Row k: products of the k-th column with the orthonormal ones, its own length last.
    rows: Vec<Vec<f64>>,
}

impl Triangle {
    /// L⁻¹ times the products of something with the columns so far.
    pub fn coordinates(&self, products: &[f64]) -> Vec<f64> {
        let mut found: Vec<f64> = Vec::with_capacity(products.len());
        for (row, product) in self.rows.iter().zip(products) {
            let known: f64 = row.iter().zip(&found).map(|(l, u)| l * u).sum();
            found.push((product - known) / row[found.len()]);
        }
        found
    }

    /// Takes a column by its products with those before and with itself, unless it is nearly in their
    /// span, (1): then its coefficients over them, (2).
    pub fn take(&mut self, products: &[f64], square: f64, least_sine: f64) -> Result<(), Vec<f64>> {
        let mut row = self.coordinates(products);
        let left = square - row.iter().map(|u| u * u).sum::<f64>();
        if left < least_sine * least_sine * square || left <= 0.0 {
            return Err(self.solve(&row));
        }
        row.push(left.sqrt());
        self.rows.push(row);
        Ok(())
    }

    /// Lᵀ⁻¹ times coordinates.
    fn solve(&self, coordinates: &[f64]) -> Vec<f64> {
        let mut found = coordinates.to_vec();
        for k in (0..found.len()).rev() {
            found[k] /= self.rows[k][k];
            for j in 0..k {
                found[j] -= self.rows[k][j] * found[k];
            }
        }
        found
    }
}

/// (1) and (2) for columns with these products.
pub(super) fn reduce(gram: &DMatrix<f64>, least_sine: f64) -> Reduction {
    let mut triangle = Triangle::default();
    let mut reduction = Reduction::default();
    let norms: Vec<f64> = gram.diagonal().iter().map(|square| square.sqrt()).collect();
    for column in 0..gram.ncols() {
        if norms[column] <= 0.0 {
            reduction.unseen.push(column);
            continue;
        }
        let kept = reduction.kept.iter();
        let products: Vec<f64> = kept.map(|kept| gram[(column, *kept)]).collect();
        match triangle.take(&products, gram[(column, column)], least_sine) {
            Ok(()) => reduction.kept.push(column),
            Err(shares) => {
                let counts = |kept: usize, share: f64| {
                    (share * norms[kept]).abs() > NO_SHARE.max(least_sine) * norms[column]
                };
                let aliases = reduction.kept.iter().copied().zip(shares);
                let aliases = aliases
                    .filter(|(kept, share)| counts(*kept, *share))
                    .collect();
                reduction.dependent.push(Dependent { column, aliases });
            }
        }
    }
    reduction
}

/// Which rows stay tied to others with some additions, found once for all rows.
#[derive(Debug, Default)]
pub(super) struct TiedRows(RefCell<Vec<(Vec<Needed>, Vec<RowKey>)>>);

/// Additions each of which, or which together, would tell a row apart from the others.
pub(super) fn needed(input: &Input, key: RowKey) -> Vec<Vec<Needed>> {
    let helps = |additions: &[Needed]| !tied_with(input, additions).contains(&key);
    let singles: Vec<Vec<Needed>> = Needed::ALL
        .into_iter()
        .map(|one| vec![one])
        .filter(|one| helps(one))
        .collect();
    if !singles.is_empty() {
        return singles;
    }
    let pairs = Needed::ALL.into_iter().enumerate().flat_map(|(i, one)| {
        Needed::ALL
            .into_iter()
            .skip(i + 1)
            .map(move |other| vec![one, other])
    });
    pairs.filter(|pair| helps(pair)).collect()
}

/// The linear rows that cannot be distinguished with some additions.
fn tied_with(input: &Input, additions: &[Needed]) -> Vec<RowKey> {
    let known = |(with, _): &&(Vec<Needed>, Vec<RowKey>)| with == additions;
    if let Some((_, rows)) = input.tied.0.borrow().iter().find(known) {
        return rows.clone();
    }
    let few = input.recordings.iter();
    let mut recordings: Vec<CircularRecording> =
        few.map(|(_, recording)| few_samples(recording)).collect();
    for addition in additions {
        add(&mut recordings, *addition);
    }
    let rows = tied(input, &recordings);
    let mut known = input.tied.0.borrow_mut();
    known.push((additions.to_vec(), rows.clone()));
    rows
}

/// The linear rows that cannot be distinguished from all others in some recordings.
fn tied(input: &Input, recordings: &[CircularRecording]) -> Vec<RowKey> {
    let listed: Vec<_> = recordings.iter().enumerate().collect();
    let scene = Scene::new(input.plane, &listed);
    let terms = Term::linear(&scene);
    let (_, gram) = Columns::new(&scene).gram(&terms);
    let reduction = reduce(&gram, input.config.least_sine);
    let with_aliases = |d: &Dependent| {
        let aliases = d.aliases.iter().map(|(kept, _)| *kept);
        std::iter::once(d.column).chain(aliases).collect::<Vec<_>>()
    };
    let dependent = reduction.dependent.iter().flat_map(with_aliases);
    let columns = reduction.unseen.iter().copied().chain(dependent);
    columns.map(|column| terms[column].row(&scene)).collect()
}

/// A recording with no more samples than the angles between columns need.
fn few_samples(recording: &CircularRecording) -> CircularRecording {
    let every = recording.samples.len().div_ceil(ENOUGH_SAMPLES).max(1);
    CircularRecording {
        samples: recording.samples.iter().step_by(every).copied().collect(),
        ..recording.clone()
    }
}

/// Adds a recording like the first one but for one thing, or changes what is known of all.
fn add(recordings: &mut Vec<CircularRecording>, addition: Needed) {
    let fresh = recordings
        .iter()
        .map(|r| r.zero_id)
        .max()
        .map_or(0, |last| last.wrapping_add(1));
    let Some(first) = recordings.first() else {
        return;
    };
    let mut new = CircularRecording {
        zero_id: fresh,
        ..first.clone()
    };
    match addition {
        Needed::OtherSense => {
            new.sense = first.sense.reversed();
            for sample in &mut new.samples {
                sample.angle_rad = -sample.angle_rad;
            }
        }
        Needed::OtherFeed => {
            new.zero_id = first.zero_id;
            new.feed_mm_s *= 0.5;
            for sample in &mut new.samples {
                sample.time_s *= 2.0;
            }
        }
        Needed::OtherRadius => new.radius_mm *= 0.5,
        Needed::OtherRadiusSameZero => {
            new.zero_id = first.zero_id;
            new.radius_mm *= 0.5;
        }
        Needed::FullCircle => new.samples = full_circle(first),
        Needed::CalibratedReference => {
            for recording in &mut *recordings {
                recording.reference = ReferenceLength::Calibrated {
                    standard_uncertainty_mm: 0.0,
                };
            }
            return;
        }
    }
    recordings.push(new);
}

fn full_circle(like: &CircularRecording) -> Vec<CircularSample> {
    let turn_s = std::f64::consts::TAU * like.radius_mm / like.feed_mm_s;
    let sense = match like.sense {
        CircularSense::Clockwise => -1.0,
        CircularSense::CounterClockwise => 1.0,
    };
    (0..=720)
        .map(|i| CircularSample {
            angle_rad: sense * (f64::from(i) * 0.5).to_radians(),
            radial_deviation_mm: 0.0,
            time_s: turn_s * f64::from(i) / 720.0,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_a_dependent_column_names_its_shares() {
        let design = DMatrix::from_row_slice(
            4,
            4,
            &[
                1.0, 0.0, 2.0, 0.0, 1.0, 1.0, 5.0, 0.0, 1.0, 2.0, 8.0, 0.0, 1.0, 3.0, 11.0, 0.0,
            ],
        );
        let reduction = reduce(&design.tr_mul(&design), 1e-6);
        assert_eq!(reduction.kept, [0, 1]);
        assert_eq!(reduction.unseen, [3]);
        let aliases = &reduction.dependent[0].aliases;
        assert_eq!((aliases[0].0, aliases[1].0), (0, 1));
        assert!((aliases[0].1 - 2.0).abs() < 1e-12 && (aliases[1].1 - 3.0).abs() < 1e-12);
    }

    #[test]
    fn eq1_the_limit_is_the_sine_of_the_angle() {
        let sine = 0.01_f64;
        let design =
            DMatrix::from_column_slice(2, 2, &[1.0, 0.0, (1.0 - sine * sine).sqrt(), sine]);
        let gram = design.tr_mul(&design);
        assert_eq!(reduce(&gram, 0.009).kept, [0, 1]);
        assert_eq!(reduce(&gram, 0.011).kept, [0]);
    }
}
