//! Sums of the runs of a log that are left out in turn, and what terms of one thermometer come to.

use std::rc::Rc;

use nalgebra::{DMatrix, DVector};

use super::Term;
use crate::search::rows::count;

/// Runs from which on each is left out as a whole, and parts of each of fewer runs.
const FEWEST_FOLDS: usize = 3;
/// Fewest rows of such a part: a third of what is left of the shortest log of which a third is held out, 60 rows.
const ROWS_OF_A_PART: usize = 13;

/// Sums of squares and products of one run.
pub(super) struct Fold {
    pub(super) gram: DMatrix<f64>,
    pub(super) along: DVector<f64>,
    pub(super) square: f64,
}

/// The same of every run, and of all together.
pub(super) struct Sums {
    pub(super) folds: Vec<Fold>,
    pub(super) gram: DMatrix<f64>,
    pub(super) along: DVector<f64>,
}

impl Sums {
    /// Sizes from all runs but one; none where they are not determined.
    pub(super) fn without(&self, fold: &Fold) -> Option<DVector<f64>> {
        let rest = (&self.gram - &fold.gram).cholesky()?;
        Some(rest.solve(&(&self.along - &fold.along)))
    }
}

/// Runs that are left out in turn: as they are from [`FEWEST_FOLDS`] on, of fewer the parts of each, and of too short ones those of
/// all together; `None` of too few rows.
pub(super) fn in_parts(runs: Vec<Vec<[f64; 2]>>) -> Option<Vec<Vec<[f64; 2]>>> {
    if runs.len() >= FEWEST_FOLDS {
        return Some(runs);
    }
    let is_short = |rows: &Vec<[f64; 2]>| rows.len() < FEWEST_FOLDS * ROWS_OF_A_PART;
    let runs = match runs.iter().any(is_short) {
        true => vec![runs.concat()],
        false => runs,
    };
    let parts = |rows: &Vec<[f64; 2]>| -> Vec<Vec<[f64; 2]>> {
        let size = rows.len().div_ceil(FEWEST_FOLDS).max(1);
        rows.chunks(size).map(<[_]>::to_vec).collect()
    };
    let is_long = !runs.iter().any(is_short);
    is_long.then(|| runs.iter().flat_map(parts).collect())
}

/// Each thermometer of some terms with its size, the sum of those of its lags, and their mean lag, s; `sizes` has that of the offset
/// first.
pub(super) fn merged<'s>(terms: &[Term<'s>], sizes: &[f64]) -> Vec<(&'s str, f64, f64)> {
    let mut all: Vec<(&str, f64, f64)> = vec![];
    for (place, (id, lag_s)) in terms.iter().enumerate() {
        let size = sizes.get(1 + place).copied().unwrap_or(0.0);
        match all.iter_mut().find(|(known, ..)| known == id) {
            Some((_, sum, mean_s)) => {
                let whole = *sum + size;
                if whole != 0.0 {
                    *mean_s = (*sum * *mean_s + size * lag_s) / whole;
                }
                *sum = whole;
            }
            None => all.push((id, size, *lag_s)),
        }
    }
    all
}

/// Sums of the rows of a run, the first of which is at `first` in the series.
pub(super) fn fold(rows: &[[f64; 2]], first: usize, series: &[Rc<[f64]>]) -> Fold {
    let columns = series.len() + 1;
    let mut fold = Fold {
        gram: DMatrix::zeros(columns, columns),
        along: DVector::zeros(columns),
        square: 0.0,
    };
    // Every run counts alike, however many rows it has.
    let weight = 1.0 / count(rows.len().max(1));
    for ([_, um], at) in rows.iter().zip(first..) {
        let told = series.iter().map(|series| series[at]);
        let row = DVector::from_iterator(columns, std::iter::once(1.0).chain(told));
        fold.gram.ger(weight, &row, &row, 1.0);
        fold.along.axpy(weight * um, &row, 1.0);
        fold.square += weight * um * um;
    }
    fold
}
