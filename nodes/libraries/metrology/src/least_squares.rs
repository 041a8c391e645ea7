//! Weighted linear least squares that says what it cannot know.
//!
//! # Model
//!
//! With observations y of known standard uncertainty u, design X and W = diag(1/u):
//!
//! ```text
//!   W X D = U Σ Vᵀ                      D: column norms, so that units do not decide the rank   (1)
//!   β = D V Σ⁺ Uᵀ W y                   minimum-norm member of all solutions                    (2)
//!   cov(β) = D V Σ⁺² Vᵀ D                                                                       (3)
//!   χ² = |W (y − X β)|²,  ν = n − rank                                                          (4)
//!   parameter j is estimable  ⇔  (V_r V_rᵀ)_jj = 1                                              (5)
//! ```
//!
//! Singular values under max(n, p)·ε·σ₁ count as zero. A column of zeros keeps its length: rounding
//! in it, scaled up, would count as rank.
//!
//! # References
//! \[1\] G. H. Golub, C. F. Van Loan, Matrix Computations, 5.5. \[2\] JCGM 100:2008 (GUM), H.3.

use nalgebra::{DMatrix, DVector};

/// Why a fit is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Rows of design, observations and uncertainties differ in number.
    #[error(
        "design has {n_rows} rows, but {n_observations} observations and {n_uncertainties} uncertainties were given"
    )]
    Shape {
        /// Rows of the design.
        n_rows: usize,
        /// Observations.
        n_observations: usize,
        /// Uncertainties.
        n_uncertainties: usize,
    },
    /// There is nothing to fit.
    #[error("nothing to fit: {n_rows} observations, {n_columns} parameters")]
    Empty {
        /// Observations.
        n_rows: usize,
        /// Parameters.
        n_columns: usize,
    },
    /// A number is not finite or an uncertainty is not above 0.
    #[error("row {row} has a number that is not finite or an uncertainty that is not above 0")]
    NotUsable {
        /// The row.
        row: usize,
    },
    /// The singular value decomposition did not converge.
    #[error("singular value decomposition did not converge")]
    NoDecomposition,
}

/// A weighted least-squares fit.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedFit {
    /// β of (2), in the parameters' own units.
    pub parameters: DVector<f64>,
    /// Covariance of β for the given uncertainties, (3).
    pub covariance: DMatrix<f64>,
    /// Observed minus fitted, in the observations' unit.
    pub residuals: DVector<f64>,
    /// Number of singular values that count.
    pub rank: usize,
    /// Singular values of the scaled, weighted design, greatest first.
    pub singular_values: DVector<f64>,
    /// Sum of squared weighted residuals, (4).
    pub chi_square: f64,
    /// Observations minus rank.
    pub degrees_of_freedom: usize,
    /// Whether each parameter is estimable alone, (5).
    pub estimable: Vec<bool>,
}

/// How near to 1 the diagonal of (5) must be.
const ESTIMABLE_TOLERANCE: f64 = 1e-8;

/// Fits `observations` ≈ `design` β with the given standard uncertainties.
///
/// # Errors
/// When shapes differ, nothing is given or a number is unusable; never for a rank deficiency.
pub fn solve(
    design: &DMatrix<f64>,
    observations: &DVector<f64>,
    standard_uncertainties: &DVector<f64>,
) -> Result<WeightedFit, FitError> {
    check(design, observations, standard_uncertainties)?;
    let (n, p) = design.shape();
    let weighted = DMatrix::from_fn(n, p, |i, j| design[(i, j)] / standard_uncertainties[i]);
    let scale = DVector::from_fn(p, |j, _| match weighted.column(j).norm() {
        norm if norm > 0.0 => 1.0 / norm,
        _ => 1.0,
    });
    let scaled = DMatrix::from_fn(n, p, |i, j| weighted[(i, j)] * scale[j]);
    let svd = scaled
        .try_svd(true, true, f64::EPSILON, 0)
        .ok_or(FitError::NoDecomposition)?;
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Err(FitError::NoDecomposition);
    };
    let limit = n.max(p) as f64 * f64::EPSILON * svd.singular_values.max();
    let inverse = svd
        .singular_values
        .map(|s| if s > limit { 1.0 / s } else { 0.0 });
    let rank = inverse.iter().filter(|s| **s > 0.0).count();
    let weighted_y = observations.component_div(standard_uncertainties);
    let projected = (u.transpose() * &weighted_y).component_mul(&inverse);
    let parameters = (v_t.transpose() * projected).component_mul(&scale);
    let half = DMatrix::from_fn(p, inverse.len(), |j, k| scale[j] * v_t[(k, j)] * inverse[k]);
    let residuals = observations - design * &parameters;
    let estimable = (0..p)
        .map(|j| {
            let seen: f64 = (0..inverse.len())
                .filter(|&k| inverse[k] > 0.0)
                .map(|k| v_t[(k, j)] * v_t[(k, j)])
                .sum();
            seen > 1.0 - ESTIMABLE_TOLERANCE
        })
        .collect();
    Ok(WeightedFit {
        covariance: &half * half.transpose(),
        chi_square: residuals
            .component_div(standard_uncertainties)
            .norm_squared(),
        parameters,
        residuals,
        rank,
        singular_values: svd.singular_values,
        degrees_of_freedom: n - rank,
        estimable,
    })
}

fn check(design: &DMatrix<f64>, y: &DVector<f64>, u: &DVector<f64>) -> Result<(), FitError> {
    let (n_rows, n_columns) = design.shape();
    if n_rows != y.len() || n_rows != u.len() {
        return Err(FitError::Shape {
            n_rows,
            n_observations: y.len(),
            n_uncertainties: u.len(),
        });
    }
    if n_rows == 0 || n_columns == 0 {
        return Err(FitError::Empty { n_rows, n_columns });
    }
    let usable = |row: usize| {
        design.row(row).iter().all(|x| x.is_finite())
            && y[row].is_finite()
            && u[row].is_finite()
            && u[row] > 0.0
    };
    match (0..n_rows).find(|&row| !usable(row)) {
        Some(row) => Err(FitError::NotUsable { row }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_eq3_a_weighted_mean_has_the_textbook_uncertainty() {
        let design = DMatrix::from_element(2, 1, 1.0);
        let fit = solve(
            &design,
            &DVector::from_vec(vec![1.0, 4.0]),
            &DVector::from_vec(vec![1.0, 2.0]),
        )
        .unwrap();
        assert!((fit.parameters[0] - 1.6).abs() < 1e-12);
        assert!((fit.covariance[(0, 0)] - 0.8).abs() < 1e-12);
        assert!((fit.chi_square - 1.8).abs() < 1e-12);
        assert_eq!((fit.rank, fit.degrees_of_freedom), (1, 1));
    }

    #[test]
    fn eq5_two_equal_columns_are_not_estimable_but_a_third_is() {
        let design = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 2.0, 2.0, 1.0, 3.0, 3.0, -1.0]);
        let y = DVector::from_vec(vec![2.0, 5.0, 5.0]);
        let fit = solve(&design, &y, &DVector::from_element(3, 1.0)).unwrap();
        assert_eq!(fit.rank, 2);
        assert_eq!(fit.estimable, [false, false, true]);
        assert!((fit.parameters[0] - 1.0).abs() < 1e-12 && (fit.parameters[1] - 1.0).abs() < 1e-12);
        assert!((fit.parameters[2] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn units_of_the_columns_do_not_decide_the_rank() {
        let design = DMatrix::from_row_slice(3, 2, &[1.0, 1e-14, 1.0, 2e-14, 1.0, 3e-14]);
        let y = DVector::from_vec(vec![1.0, 2.0, 3.0]);
        let fit = solve(&design, &y, &DVector::from_element(3, 1.0)).unwrap();
        assert_eq!(fit.rank, 2);
        assert!((fit.parameters[1] - 1e14).abs() < 1e4);
    }

    #[test]
    fn a_column_of_zeros_is_not_estimable() {
        let design = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 1.0, 0.0]);
        let fit = solve(
            &design,
            &DVector::from_element(2, 3.0),
            &DVector::from_element(2, 1.0),
        )
        .unwrap();
        assert_eq!((fit.rank, fit.estimable), (1, vec![true, false]));
    }

    #[test]
    fn unusable_numbers_name_their_row() {
        let design = DMatrix::from_element(2, 1, 1.0);
        let y = DVector::from_vec(vec![1.0, f64::NAN]);
        let u = DVector::from_element(2, 1.0);
        assert_eq!(solve(&design, &y, &u), Err(FitError::NotUsable { row: 1 }));
        assert!(matches!(
            solve(&design, &DVector::zeros(1), &u),
            Err(FitError::Shape { .. })
        ));
    }
}
