//! Least squares on the Gram matrix, so that thousands of sets of columns cost nothing.
//!
//! # Model
//!
//! ```text
//!   beta = (A'A)^-1 A'z,   gain = z'A beta                                (1)
//!   M~ = M_cc - M_cs M_ss^-1 M_sc,   b~ = b_c - M_cs M_ss^-1 b_s          (2)
//! ```
//!
//! A column that the ones before it already span (its pivot is below 1e-7 of its square) gets no share.

use nalgebra::{DMatrix, DVector};

/// A'A and A'z of a list of columns.
#[derive(Clone, Debug)]
pub struct Normal {
    /// A'A.
    pub gram: DMatrix<f64>,
    /// A'z.
    pub along: DVector<f64>,
}

/// A least-squares fit of some columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Amplitudes, in the order of the columns.
    pub sizes: Vec<f64>,
    /// What it takes from the square of z.
    pub gain: f64,
}

/// Least pivot, as a share of the column's square.
const LEAST_PIVOT: f64 = 1e-7;

/// Lower triangle of a Cholesky factor with dropped columns as zero rows.
struct Factor {
    lower: Vec<Vec<f64>>,
    kept: Vec<bool>,
}

impl Normal {
    /// Of some columns and a right side.
    pub fn new(columns: &DMatrix<f64>, z: &DVector<f64>) -> Self {
        Self {
            gram: gram(columns),
            along: columns.tr_mul(z),
        }
    }

    fn factor(&self, columns: &[usize]) -> Factor {
        let n = columns.len();
        let mut lower = vec![vec![0.0; n]; n];
        let mut kept = vec![true; n];
        for i in 0..n {
            for j in 0..i {
                let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                if kept[j] {
                    lower[i][j] = (self.gram[(columns[i], columns[j])] - sum) / lower[j][j];
                }
            }
            let square = self.gram[(columns[i], columns[i])];
            let pivot = square - lower[i][..i].iter().map(|v| v * v).sum::<f64>();
            kept[i] = pivot > LEAST_PIVOT * square && pivot > 0.0;
            lower[i][i] = if kept[i] { pivot.sqrt() } else { 1.0 };
            if !kept[i] {
                lower[i][..i].fill(0.0);
            }
        }
        Factor { lower, kept }
    }

    /// (1).
    pub fn solve(&self, columns: &[usize]) -> Fit {
        let factor = self.factor(columns);
        let half = factor.forward(|i| self.along[columns[i]]);
        let gain = half.iter().map(|v| v * v).sum();
        Fit {
            sizes: factor.backward(half),
            gain,
        }
    }

    /// The part of the square of a column that some others explain.
    pub fn explained_square(&self, column: usize, by: &[usize]) -> f64 {
        let factor = self.factor(by);
        let half = factor.forward(|i| self.gram[(by[i], column)]);
        half.iter().map(|v| v * v).sum()
    }

    /// Inverse of the Gram matrix of some columns; dropped ones have none.
    pub fn inverse(&self, columns: &[usize]) -> DMatrix<f64> {
        let factor = self.factor(columns);
        let n = columns.len();
        let mut inverse = DMatrix::zeros(n, n);
        for column in 0..n {
            let half = factor.forward(|i| if i == column { 1.0 } else { 0.0 });
            inverse.set_column(column, &DVector::from_vec(factor.backward(half)));
        }
        inverse
    }

    /// Gain of a few columns beside others whose half solution is known: (2) without the whole matrix.
    pub fn gains_beside<'f>(
        &self,
        columns: &[usize],
        groups: impl Iterator<Item = &'f [usize]>,
    ) -> Vec<f64> {
        let factor = self.factor(columns);
        let base = factor.forward(|i| self.along[columns[i]]);
        let mut gains = Vec::new();
        for group in groups {
            let halves: Vec<Vec<f64>> = group
                .iter()
                .map(|c| factor.forward(|i| self.gram[(columns[i], *c)]))
                .collect();
            let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
            let q = group.len();
            let small = Self {
                gram: DMatrix::from_fn(q, q, |a, b| {
                    self.gram[(group[a], group[b])] - dot(&halves[a], &halves[b])
                }),
                along: DVector::from_fn(q, |a, _| self.along[group[a]] - dot(&halves[a], &base)),
            };
            let own: Vec<f64> = group.iter().map(|c| self.gram[(*c, *c)]).collect();
            let alive: Vec<usize> = (0..q)
                .filter(|a| small.gram[(*a, *a)] > LEAST_PIVOT * own[*a])
                .collect();
            gains.push(small.solve(&alive).gain);
        }
        gains
    }
}

/// Rows that are multiplied at once: their part of hundreds of columns stays in the cache.
const ROWS: usize = 512;

/// A'A. A product of matrices takes a tenth of the time of as many products of columns.
fn gram(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(columns.ncols(), columns.ncols());
    for first in (0..columns.nrows()).step_by(ROWS) {
        let part = columns.rows(first, ROWS.min(columns.nrows() - first));
        gram.gemm(1.0, &part.transpose(), &part, 1.0);
    }
    gram
}

impl Factor {
    fn forward(&self, right: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut half = Vec::<f64>::with_capacity(self.kept.len());
        for i in 0..self.kept.len() {
            let row = &self.lower[i];
            let sum: f64 = row[..i].iter().zip(&half).map(|(a, b)| a * b).sum();
            half.push(if self.kept[i] {
                (right(i) - sum) / row[i]
            } else {
                0.0
            });
        }
        half
    }

    fn backward(&self, mut half: Vec<f64>) -> Vec<f64> {
        for i in (0..half.len()).rev() {
            let sum: f64 = (i + 1..half.len())
                .map(|j| self.lower[j][i] * half[j])
                .sum();
            half[i] = if self.kept[i] {
                (half[i] - sum) / self.lower[i][i]
            } else {
                0.0
            };
        }
        half
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_and_eq2_agree_and_a_repeated_column_is_dropped() {
        let columns = DMatrix::from_row_slice(
            4,
            3,
            &[1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 3.0, 1.0],
        );
        let z = DVector::from_vec(vec![1.0, 3.0, 5.0, 7.0]);
        let normal = Normal::new(&columns, &z);
        let fit = normal.solve(&[0, 1]);
        assert!((fit.sizes[0] - 1.0).abs() < 1e-9 && (fit.sizes[1] - 2.0).abs() < 1e-9);
        assert!((fit.gain - 84.0).abs() < 1e-9);
        assert!((normal.solve(&[0, 1, 2]).gain - 84.0).abs() < 1e-9);
        let first = normal.solve(&[0]).gain;
        let second = normal.gains_beside(&[0], [&[1_usize][..]].into_iter())[0];
        assert!((first + second - 84.0).abs() < 1e-9);
    }
}
