//! Greatest and least of a list, and the checks that come before them.

use super::Iso230Error;

/// Greatest value; minus infinity of nothing.
pub fn greatest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// Least value; infinity of nothing.
pub fn least(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}

/// Greatest minus least.
pub fn range(values: impl IntoIterator<Item = f64> + Clone) -> f64 {
    greatest(values.clone()) - least(values)
}

/// Arithmetic mean; NaN of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation of one observation, from n − 1 degrees of freedom.
pub fn standard_deviation(values: &[f64]) -> f64 {
    let centre = mean(values);
    let sum: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    (sum / (values.len() as f64 - 1.0)).sqrt()
}

/// Refuses what is no number; `row` is the run or channel in which it stands.
pub fn check_finite(place: &'static str, row: usize, values: &[f64]) -> Result<(), Iso230Error> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(Iso230Error::NotFinite {
            place,
            row,
            index,
            value: values[index],
        }),
        None => Ok(()),
    }
}

/// Refuses what is no number or not above 0.
pub fn check_positive(place: &'static str, value: f64) -> Result<(), Iso230Error> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Iso230Error::NotPositive { place, value })
}

/// Refuses what is no number or below 0.
pub fn check_not_negative(place: &'static str, value: f64) -> Result<(), Iso230Error> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(Iso230Error::Negative { place, value })
}

/// Refuses a list that is not strictly ascending.
pub fn check_ascending(place: &'static str, values: &[f64]) -> Result<(), Iso230Error> {
    let falls = |pair: &[f64]| matches!(pair, [before, after] if after <= before);
    match values.windows(2).position(falls) {
        Some(before) => Err(Iso230Error::NotAscending {
            place,
            index: before + 1,
            value: values[before + 1],
            previous: values[before],
        }),
        None => Ok(()),
    }
}

/// Refuses fewer points than are needed.
pub const fn check_points(place: &'static str, n: usize, least: usize) -> Result<(), Iso230Error> {
    if n < least {
        return Err(Iso230Error::TooFewPoints { place, n, least });
    }
    Ok(())
}

/// Refuses a list whose length is not that of the list it belongs to.
pub const fn check_length(
    place: &'static str,
    row: usize,
    n: usize,
    expected: usize,
) -> Result<(), Iso230Error> {
    if n != expected {
        return Err(Iso230Error::Lengths {
            place,
            row,
            n,
            expected,
        });
    }
    Ok(())
}
