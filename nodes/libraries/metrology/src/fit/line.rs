//! A straight line through points with known standard uncertainties.
//!
//! # Model
//!
//! ```text
//!   w_i = 1/u_i²,  x̄ = Σ w x / Σ w,  ȳ alike,  S = Σ w (x − x̄)²                    (1)
//!   slope = Σ w (x − x̄)(y − ȳ) / S,  intercept = ȳ − slope x̄                       (2)
//!   var(slope) = 1/S,  var(intercept) = 1/Σw + x̄²/S,  cov = −x̄/S                   (3)
//! ```
//!
//! Sums about the mean keep the digits that the normal equations would lose.
//!
//! # Agreement
//! `val_nist_strd_norris`: the certified parameters to 12 digits, their standard deviations to 11.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), H.3. \[2\] NIST StRD, linear regression, dataset Norris (public domain).

use nalgebra::Matrix2;

use super::{ShapeError, check_points};

/// A straight line.
#[derive(Clone, Debug, PartialEq)]
pub struct LineFit {
    /// Value at x = 0.
    pub intercept: f64,
    /// Change of y with x.
    pub slope: f64,
    /// Covariance of (intercept, slope) for the given uncertainties, (3).
    pub covariance: Matrix2<f64>,
    /// Observed minus fitted.
    pub residuals: Vec<f64>,
    /// Sum of squared weighted residuals.
    pub chi_square: f64,
    /// Observations minus 2.
    pub degrees_of_freedom: usize,
}

/// Fits y = intercept + slope x.
///
/// # Errors
/// Fewer than two points, points at one x, numbers that cannot be used.
pub fn fit_line(
    x: &[f64],
    y: &[f64],
    standard_uncertainties: &[f64],
) -> Result<LineFit, ShapeError> {
    if x.len() != y.len() {
        return Err(ShapeError::Lengths {
            n: x.len(),
            n_uncertainties: y.len(),
        });
    }
    let rows = x.iter().zip(y).map(|(x, y)| x.is_finite() && y.is_finite());
    check_points("line", 2, rows, standard_uncertainties)?;
    let weights: Vec<f64> = standard_uncertainties
        .iter()
        .map(|u| 1.0 / (u * u))
        .collect();
    let total: f64 = weights.iter().sum();
    let mean = |values: &[f64]| {
        let sum: f64 = weights.iter().zip(values).map(|(w, v)| w * v).sum();
        sum / total
    };
    let (mean_x, mean_y) = (mean(x), mean(y));
    let terms = || x.iter().zip(y).zip(&weights);
    let spread: f64 = terms().map(|((x, _), w)| w * (x - mean_x).powi(2)).sum();
    let scale = x.iter().fold(0.0_f64, |scale, x| scale.max(x.abs()));
    if spread <= total * (scale * f64::EPSILON).powi(2) {
        return Err(ShapeError::Degenerate {
            shape: "line",
            n: x.len(),
        });
    }
    let moment: f64 = terms()
        .map(|((x, y), w)| w * (x - mean_x) * (y - mean_y))
        .sum();
    let slope = moment / spread; // (2)
    let residuals: Vec<f64> = x
        .iter()
        .zip(y)
        .map(|(x, y)| (y - mean_y) - slope * (x - mean_x))
        .collect();
    let cross = -mean_x / spread;
    Ok(LineFit {
        intercept: mean_y - slope * mean_x,
        slope,
        covariance: Matrix2::new(1.0 / total - mean_x * cross, cross, cross, 1.0 / spread), // (3)
        chi_square: residuals.iter().zip(&weights).map(|(r, w)| w * r * r).sum(),
        residuals,
        degrees_of_freedom: x.len() - 2,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::least_squares::FitError;

    /// (y, x); source: NIST StRD, linear regression, Norris, 36 observations.
    const NORRIS: [(f64, f64); 36] = [
        (0.1, 0.2),
        (338.8, 337.4),
        (118.1, 118.2),
        (888.0, 884.6),
        (9.2, 10.1),
        (228.1, 226.5),
        (668.5, 666.3),
        (998.5, 996.3),
        (449.1, 448.6),
        (778.9, 777.0),
        (559.2, 558.2),
        (0.3, 0.4),
        (0.1, 0.6),
        (778.1, 775.5),
        (668.8, 666.9),
        (339.3, 338.0),
        (448.9, 447.5),
        (10.8, 11.6),
        (557.7, 556.0),
        (228.3, 228.1),
        (998.0, 995.8),
        (888.8, 887.6),
        (119.6, 120.2),
        (0.3, 0.3),
        (0.6, 0.3),
        (557.6, 556.8),
        (339.3, 339.1),
        (888.0, 887.2),
        (998.5, 999.0),
        (778.9, 779.0),
        (10.2, 11.1),
        (117.6, 118.3),
        (228.9, 229.2),
        (668.4, 669.1),
        (449.2, 448.9),
        (0.2, 0.5),
    ];

    fn near(found: f64, certified: f64, digits: i32) {
        let relative = ((found - certified) / certified).abs();
        assert!(relative < 10_f64.powi(-digits), "{found} {certified}");
    }

    #[test]
    fn val_nist_strd_norris() {
        let (y, x): (Vec<f64>, Vec<f64>) = NORRIS.into_iter().unzip();
        let fit = fit_line(&x, &y, &[1.0; 36]).unwrap();
        near(fit.intercept, -0.262_323_073_774_029, 12);
        near(fit.slope, 1.002_116_818_020_45, 13);
        near(fit.chi_square, 26.617_398_529_422_4, 12);
        let sigma = (fit.chi_square / fit.degrees_of_freedom as f64).sqrt();
        near(sigma, 0.884_796_396_144_373, 12);
        near(
            sigma * fit.covariance[(0, 0)].sqrt(),
            0.232_818_234_301_152,
            11,
        );
        near(
            sigma * fit.covariance[(1, 1)].sqrt(),
            0.429_796_848_199_937e-3,
            11,
        );
    }

    #[test]
    fn eq3_weights_are_inverse_variances() {
        // Two points determine the line; their uncertainties propagate by hand.
        let fit = fit_line(&[0.0, 2.0], &[1.0, 5.0], &[0.1, 0.3]).unwrap();
        assert!((fit.intercept - 1.0).abs() < 1e-14 && (fit.slope - 2.0).abs() < 1e-14);
        assert!((fit.covariance[(0, 0)] - 0.01).abs() < 1e-14);
        assert!((fit.covariance[(1, 1)] - 0.1 / 4.0).abs() < 1e-14);
        assert!((fit.covariance[(0, 1)] + 0.01 / 2.0).abs() < 1e-14);
    }

    #[test]
    fn lines_that_are_not_determined_are_refused() {
        assert_eq!(
            fit_line(&[3.0, 3.0], &[1.0, 2.0], &[1.0, 1.0]),
            Err(ShapeError::Degenerate {
                shape: "line",
                n: 2
            })
        );
        assert_eq!(
            fit_line(&[3.0], &[1.0], &[1.0]).unwrap_err().to_string(),
            "1 points were given: a line needs at least 2"
        );
        assert_eq!(
            fit_line(&[3.0, f64::NAN], &[1.0, 2.0], &[1.0, 1.0]),
            Err(FitError::NotUsable { row: 1 }.into())
        );
        assert_eq!(
            fit_line(&[3.0, 4.0], &[1.0, 2.0], &[0.0, 1.0]),
            Err(FitError::NotUsable { row: 0 }.into())
        );
        assert!(matches!(
            fit_line(&[3.0, 4.0], &[1.0], &[1.0, 1.0]),
            Err(ShapeError::Lengths { .. })
        ));
    }
}
