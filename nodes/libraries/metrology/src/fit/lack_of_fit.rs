//! Whether what a fit leaves is noise: the χ² test, and the F test against pure error.
//!
//! # Model
//!
//! With repeated observations at K levels and p parameters:
//!
//! ```text
//!   S_pure = Σ_levels Σ w (r − r̄_level)²            ν = N − K                   (1)
//!   S_lack = Σ_levels (Σ w) r̄_level²                ν = K − p                   (2)
//!   F = [S_lack/(K − p)] / [S_pure/(N − K)],  p value = P(F_{K−p, N−K} > F)      (3)
//! ```
//!
//! (3) needs no stated uncertainty: repeats tell what noise is. Without repeats only
//! P(χ²_ν > χ²) is left, which is as good as the stated uncertainties.
//!
//! # References
//! \[1\] NIST/SEMATECH e-Handbook of Statistical Methods, 4.4.4.6.

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Noise and lack of fit, separated by repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PureError {
    /// Weighted sum of squares about the levels' means, (1).
    pub pure_sum: f64,
    /// Degrees of freedom of `pure_sum`.
    pub pure_freedom: usize,
    /// Weighted sum of squares of the levels' mean residuals, (2).
    pub lack_sum: f64,
    /// Degrees of freedom of `lack_sum`.
    pub lack_freedom: usize,
    /// p value of (3); NaN where either has no degree of freedom.
    pub p: f64,
}

/// Separates residuals into pure error and lack of fit; `levels[i]` numbers the level of row i.
///
/// Rows beyond the shortest list are not used.
#[must_use]
pub fn lack_of_fit(
    residuals: &[f64],
    standard_uncertainties: &[f64],
    levels: &[usize],
    n_parameters: usize,
) -> PureError {
    let rows = || {
        let weights = standard_uncertainties.iter().map(|u| 1.0 / (u * u));
        residuals.iter().zip(weights).zip(levels)
    };
    let n_levels = levels.iter().max().map_or(0, |last| last + 1);
    let mut weight = vec![0.0; n_levels];
    let mut mean = vec![0.0; n_levels];
    for ((residual, w), &level) in rows() {
        weight[level] += w;
        mean[level] += w * residual;
    }
    for (mean, weight) in mean.iter_mut().zip(&weight) {
        if *weight > 0.0 {
            *mean /= weight;
        }
    }
    let used = weight.iter().filter(|w| **w > 0.0).count();
    let pure_sum = rows().map(|((r, w), &k)| w * (r - mean[k]).powi(2)).sum();
    let lack_sum = weight.iter().zip(&mean).map(|(w, m)| w * m * m).sum();
    let pure_freedom = rows().count().saturating_sub(used);
    let lack_freedom = used.saturating_sub(n_parameters);
    PureError {
        pure_sum,
        pure_freedom,
        lack_sum,
        lack_freedom,
        p: f_test_p(lack_sum, lack_freedom, pure_sum, pure_freedom),
    }
}

/// Probability of an F above the ratio of two mean squares, (3); NaN where either has no degree of
/// freedom or the second is zero.
#[must_use]
pub fn f_test_p(lack_sum: f64, lack_freedom: usize, pure_sum: f64, pure_freedom: usize) -> f64 {
    let (lack, pure) = (lack_freedom as f64, pure_freedom as f64);
    match FisherSnedecor::new(lack, pure) {
        Ok(distribution) if pure_sum > 0.0 => {
            distribution.sf((lack_sum / lack) / (pure_sum / pure)) // (3)
        }
        _ => f64::NAN,
    }
}

/// Probability of a χ² above the one found; NaN without degrees of freedom.
#[must_use]
pub fn chi_square_p(chi_square: f64, degrees_of_freedom: usize) -> f64 {
    ChiSquared::new(degrees_of_freedom as f64)
        .map_or(f64::NAN, |distribution| distribution.sf(chi_square))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_tables_of_the_f_and_chi_square_distributions() {
        // 5 % points: F(3, 20) = 3.098, F(1, 10) = 4.965, chi-square(5) = 11.070.
        assert!((f_test_p(3.0 * 3.098, 3, 20.0, 20) - 0.05).abs() < 1e-4);
        assert!((f_test_p(4.965, 1, 10.0, 10) - 0.05).abs() < 1e-4);
        assert!((chi_square_p(11.070, 5) - 0.05).abs() < 1e-4);
    }

    #[test]
    fn eq1_eq2_split_the_sum_of_squares() {
        let residuals = [1.0, 3.0, -2.0, -2.0, 0.5, -0.5];
        let levels = [0, 0, 1, 1, 2, 2];
        let split = lack_of_fit(&residuals, &[1.0; 6], &levels, 2);
        assert!((split.pure_sum - 2.5).abs() < 1e-12);
        assert!((split.lack_sum - 16.0).abs() < 1e-12);
        let total: f64 = residuals.iter().map(|r| r * r).sum();
        assert!((split.pure_sum + split.lack_sum - total).abs() < 1e-12);
        assert_eq!((split.pure_freedom, split.lack_freedom), (3, 1));
    }

    #[test]
    fn without_repeats_or_spare_levels_there_is_no_p_value() {
        assert!(
            lack_of_fit(&[0.1, 0.2, 0.3], &[1.0; 3], &[0, 1, 2], 2)
                .p
                .is_nan()
        );
        assert!(
            lack_of_fit(&[0.1, 0.2, 0.3], &[1.0; 3], &[0, 0, 1], 2)
                .p
                .is_nan()
        );
        assert!(lack_of_fit(&[], &[], &[], 2).p.is_nan());
        assert!(chi_square_p(1.0, 0).is_nan());
    }
}
