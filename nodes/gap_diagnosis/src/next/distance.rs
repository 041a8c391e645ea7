//! How far an experiment would put two explanations apart.
//!
//! # Model
//!
//! S is the information (J'J, whitened, set-ups projected out) on the columns of both explanations, b the sizes of
//! the one that is taken to be true and V what is not known of them:
//!
//! ```text
//!   Delta = b' M b + tr(M V),   M = S_gg - S_gh S_hh^-1 S_hg              (1)
//! ```
//!
//! It is what the best sizes of the other explanation still leave of the first, in chi-square, on average over
//! what the sizes may be. The chance that the better fit is then the right one is Phi(sqrt(Delta) / 2).
//!
//! # References
//! \[1\] G. E. P. Box, W. J. Hill, Technometrics 9, 1967 (discrimination among mechanistic models).

use nalgebra::{DMatrix, DVector};

use crate::noise::normal::Normal;

/// An explanation: its columns among those of the information, their sizes, what is not known of them.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// Places of its columns.
    pub columns: Vec<usize>,
    /// b.
    pub sizes: DVector<f64>,
    /// V.
    pub doubt: DMatrix<f64>,
}

/// (1), with `from` taken to be true and `to` fitted.
pub fn distance(information: &DMatrix<f64>, from: &Explanation, to: &[usize]) -> f64 {
    let own = &from.columns;
    let between = information.select_rows(to).select_columns(own);
    let fitted = Normal {
        gram: information.clone(),
        along: DVector::zeros(information.nrows()),
    }
    .inverse(to);
    let left =
        information.select_rows(own).select_columns(own) - between.tr_mul(&(fitted * &between));
    let of_sizes = from.sizes.dot(&(&left * &from.sizes));
    let of_doubt = (&left * &from.doubt).trace();
    (of_sizes + of_doubt).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sure(columns: Vec<usize>, sizes: &[f64]) -> Explanation {
        let n = sizes.len();
        Explanation {
            columns,
            sizes: DVector::from_column_slice(sizes),
            doubt: DMatrix::zeros(n, n),
        }
    }

    /// Squareness is an oval at 45 degrees whichever way a circle is run; unequal lags turn theirs with the sense.
    /// With m rows of one sense and n of the other: g'g = h'h = m + n, g'h = m - n, so that
    /// Delta = b2 ((m + n) - (m - n)2 / (m + n)) = 4 b2 m n / (m + n).
    #[test]
    fn eq1_an_oval_that_turns_with_the_sense_is_told_by_the_harmonic_mean_of_both_senses() {
        for (m, n) in [(240, 0), (240, 240), (480, 120)] {
            let rows = m + n;
            let shape = |row: usize| {
                let angle = std::f64::consts::TAU * (row as f64 + 0.5) / 120.0;
                std::f64::consts::SQRT_2 * (2.0 * angle).sin()
            };
            let squareness = DVector::from_fn(rows, |row, _| shape(row));
            let lag = DVector::from_fn(
                rows,
                |row, _| if row < m { shape(row) } else { -shape(row) },
            );
            let columns = DMatrix::from_columns(&[squareness, lag]);
            let information = columns.tr_mul(&columns);
            let found = distance(&information, &sure(vec![0], &[0.7]), &[1]);
            let (m, n) = (m as f64, n as f64);
            let wanted = 4.0 * 0.49 * m * n / (m + n);
            assert!(
                (found - wanted).abs() < 1e-6 * wanted.max(1.0),
                "{found} {wanted}"
            );
        }
    }

    #[test]
    fn eq1_doubt_in_the_sizes_adds_its_share_and_what_the_other_spans_is_no_distance() {
        let columns = DMatrix::from_row_slice(3, 3, &[1.0, 0.0, 2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let information = columns.tr_mul(&columns);
        // The third column is twice the first and once the second.
        let mut third = sure(vec![2], &[4.0]);
        assert!(distance(&information, &third, &[0, 1]) < 1e-9);
        // Beside the first alone it keeps its second coordinate: 42 + V.
        third.doubt[(0, 0)] = 0.5;
        assert!((distance(&information, &third, &[0]) - 16.5).abs() < 1e-9);
    }
}
