//! Least squares of any length in the memory of a triangle: rows are folded in block by block.
//!
//! # Model
//!
//! ```text
//!   [ R ]              [ R' ]
//!   [ A ]  =  Q        [ 0  ],   Q a product of Householder reflections            (1)
//! ```
//!
//! A carries the right-hand side as its last column. After the last block R is the triangle of the
//! whole design, its last column Qᵀy, and its last diagonal entry the norm of the residual. Singular
//! values of R are those of the design: the condition is not squared as by normal equations.
//!
//! Columns that only a few blocks touch, such as the offsets of one zero, are reflected first: so they do
//! not fill up when others are, and what is zero in a block is passed over.
//!
//! # Agreement
//! `val_numpy_singular_values_and_pseudoinverse` in tests/numpy.rs.
//!
//! # References
//! \[1\] G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., 5.2 (Householder), 6.5.3 (appending rows).

use nalgebra::{DMatrix, DVector};

/// Rows folded at once: a block of 60 columns stays in the second cache level.
pub(crate) const BLOCK_ROWS: usize = 128;

/// The triangle of all rows folded in so far.
#[derive(Clone, Debug)]
pub struct Triangle {
    n_columns: usize,
    /// Place of each unknown in the order of reflection.
    place: Vec<usize>,
    /// Column-major; the last column is the right-hand side.
    r: Vec<f64>,
    /// Rows of the block that is being filled, column-major.
    block: Vec<f64>,
    n_filled: usize,
    n_rows: usize,
}

impl Triangle {
    /// For `n_columns` unknowns, of which the first `n_last` are reflected last.
    #[must_use]
    pub fn new(n_columns: usize, n_last: usize) -> Self {
        let width = n_columns + 1;
        let n_first = n_columns.saturating_sub(n_last);
        Self {
            n_columns,
            place: (0..n_columns)
                .map(|j| if j < n_last { n_first + j } else { j - n_last })
                .collect(),
            r: vec![0.0; width * width],
            block: vec![0.0; width * BLOCK_ROWS],
            n_filled: 0,
            n_rows: 0,
        }
    }

    /// Rows folded in so far.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Adds one equation `row · β = y`, both multiplied by `weight`; `row` has an entry per unknown.
    pub fn push(&mut self, row: &[f64], y: f64, weight: f64) {
        for (value, place) in row.iter().zip(&self.place) {
            self.block[place * BLOCK_ROWS + self.n_filled] = value * weight;
        }
        self.block[self.n_columns * BLOCK_ROWS + self.n_filled] = y * weight;
        self.n_filled += 1;
        self.n_rows += 1;
        if self.n_filled == BLOCK_ROWS {
            self.fold();
        }
    }

    /// (1) for the rows that wait.
    fn fold(&mut self) {
        let width = self.n_columns + 1;
        let n = self.n_filled;
        let columns = self.block.chunks_exact(BLOCK_ROWS);
        let mut is_filled: Vec<bool> = columns
            .map(|column| column[..n].iter().any(|x| x.abs() > 0.0))
            .collect();
        for j in 0..width {
            if !is_filled[j] {
                continue;
            }
            let (done, rest) = self.block.split_at_mut((j + 1) * BLOCK_ROWS);
            let x = &done[j * BLOCK_ROWS..j * BLOCK_ROWS + n];
            let below = dot(x, x);
            if below <= 0.0 {
                continue;
            }
            let diagonal = self.r[j * width + j];
            let norm = (diagonal * diagonal + below).sqrt();
            let reflected = if diagonal > 0.0 { -norm } else { norm };
            let head = diagonal - reflected;
            let factor = 2.0 / (head * head + below);
            for (k, column) in (j + 1..width).zip(rest.chunks_exact_mut(BLOCK_ROWS)) {
                let column = &mut column[..n];
                let top = &mut self.r[k * width + j];
                if !is_filled[k] && top.abs() <= 0.0 {
                    continue;
                }
                is_filled[k] = true;
                let share = factor * (head * *top + dot(x, column));
                *top -= share * head;
                for (value, x) in column.iter_mut().zip(x) {
                    *value -= share * x;
                }
            }
            self.r[j * width + j] = reflected;
        }
        self.n_filled = 0;
    }

    /// Triangle R with its columns in the order of the unknowns, Qᵀy and the norm of the residual.
    #[must_use]
    pub fn finish(mut self) -> (DMatrix<f64>, DVector<f64>, f64) {
        self.fold();
        let (p, width) = (self.n_columns, self.n_columns + 1);
        let entry = |i: usize, j: usize| {
            let place = self.place[j];
            if i <= place {
                self.r[place * width + i]
            } else {
                0.0
            }
        };
        let r = DMatrix::from_fn(p, p, entry);
        let y = DVector::from_fn(p, |i, _| self.r[p * width + i]);
        (r, y, self.r[p * width + p].abs())
    }
}

/// Eight sums side by side, so that the processor can add them at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_parts, b_parts) = (a.chunks_exact(8), b.chunks_exact(8));
    let (a_rest, b_rest) = (a_parts.remainder(), b_parts.remainder());
    for (a, b) in a_parts.zip(b_parts) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(i: usize, j: usize) -> f64 {
        ((i * 7 + j * 13) % 17) as f64 - 8.0 + 0.1 * (j as f64)
    }

    #[test]
    fn eq1_the_triangle_has_the_gram_matrix_of_the_design() {
        let (n, p) = (300, 5);
        let mut triangle = Triangle::new(p, 2);
        for i in 0..n {
            let row: Vec<f64> = (0..p).map(|j| entry(i, j)).collect();
            triangle.push(&row, (i % 3) as f64, 2.0);
        }
        assert_eq!(triangle.n_rows(), n);
        let (r, y, residual) = triangle.finish();
        let design = DMatrix::from_fn(n, p, |i, j| 2.0 * entry(i, j));
        let right = DVector::from_fn(n, |i, _| 2.0 * (i % 3) as f64);
        let gram = design.transpose() * &design;
        assert!((r.transpose() * &r - &gram).norm() < 1e-9 * gram.norm());
        assert!((r.transpose() * &y - design.transpose() * &right).norm() < 1e-9 * gram.norm());
        let total = y.norm_squared() + residual * residual;
        assert!((total - right.norm_squared()).abs() < 1e-9 * total);
    }

    #[test]
    fn fewer_rows_than_columns_are_no_trouble() {
        let mut triangle = Triangle::new(3, 3);
        triangle.push(&[1.0, 2.0, 3.0], 4.0, 1.0);
        let (r, y, residual) = triangle.finish();
        assert!((r[(0, 0)].abs() - 1.0).abs() < 1e-15);
        assert!((y[0].abs() - 4.0).abs() < 1e-15);
        assert!(residual.abs() < 1e-15);
    }
}
