//! One value of a figure at one time.

/// Seconds of a Julian year, the unit in which people read a slope.
pub const YEAR_S: f64 = 365.25 * 86_400.0;

/// A value of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Time of the measurement, s since 1970 (UTC).
    pub at_s: f64,
    /// Value, in the figure's unit.
    pub value: f64,
    /// Its standard uncertainty, in the same unit; `None`: not known.
    pub standard_uncertainty: Option<f64>,
}

/// Weights of points, 1/u² where every point has an uncertainty above 0, otherwise 1 each; and whether they are weighted.
pub(crate) fn weights(points: &[Point]) -> (Vec<f64>, bool) {
    let of = |point: &Point| {
        let u = point.standard_uncertainty?;
        let weight = 1.0 / (u * u);
        (u > 0.0 && weight.is_finite() && weight > 0.0).then_some(weight)
    };
    let known: Option<Vec<f64>> = points.iter().map(of).collect();
    match known {
        Some(weights) => (weights, true),
        None => (vec![1.0; points.len()], false),
    }
}
