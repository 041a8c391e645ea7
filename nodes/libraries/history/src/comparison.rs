//! What changed between two dates: the difference of two values against its uncertainty.
//!
//! ```text
//!   d = y_2 − y_1,   U(d) = 2 √(u_1² + u_2²)                                      (1)
//! ```
//!
//! An error that both values share, such as that of one certificate, cancels in d and not in U(d): (1) is then too wide.

use crate::point::Point;

/// Coverage factor of U.
const COVERAGE_FACTOR: f64 = 2.0;

/// What a difference shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It exceeds its expanded uncertainty.
    Changed,
    /// It does not.
    WithinUncertainty,
    /// A value has no uncertainty.
    NotDecided,
}

/// The difference of two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The earlier value.
    pub before: Point,
    /// The later value.
    pub after: Point,
    /// Later minus earlier.
    pub change: f64,
    /// Its expanded uncertainty, k = 2; `None` where a value has none.
    pub expanded_uncertainty: Option<f64>,
    /// What it shows.
    pub verdict: Verdict,
}

/// The difference of two values.
#[must_use]
pub fn difference(before: Point, after: Point) -> Difference {
    let change = after.value - before.value;
    let both = before.standard_uncertainty.zip(after.standard_uncertainty);
    let expanded_uncertainty = both.map(|(a, b)| COVERAGE_FACTOR * a.hypot(b));
    let verdict = match expanded_uncertainty {
        None => Verdict::NotDecided,
        Some(expanded) if change.abs() > expanded => Verdict::Changed,
        Some(_) => Verdict::WithinUncertainty,
    };
    Difference {
        before,
        after,
        change,
        expanded_uncertainty,
        verdict,
    }
}

/// The latest of points in order of time that is not after a time.
#[must_use]
pub fn latest_until(points: &[Point], at_s: f64) -> Option<Point> {
    let after = points.partition_point(|point| point.at_s <= at_s);
    points.get(after.checked_sub(1)?).copied()
}
