//! Quantiles and chances of Student's distribution.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// The factor of a two-sided 95 % interval.
pub fn factor_95(degrees_of_freedom: f64) -> Option<f64> {
    let law = StudentsT::new(0.0, 1.0, degrees_of_freedom).ok()?;
    Some(law.inverse_cdf(0.975))
}

/// Chance of a value at least as far from zero in noise alone.
pub fn two_sided(value: f64, degrees_of_freedom: f64) -> Option<f64> {
    if value.is_infinite() {
        return Some(0.0);
    }
    let law = StudentsT::new(0.0, 1.0, degrees_of_freedom).ok()?;
    Some(2.0 * law.sf(value.abs()))
}
