//! The trend of a figure: a weighted straight line over time, with its uncertainty.
//!
//! # Model
//!
//! ```text
//!   y_i = a + b (t_i − t̄) + e_i,   w_i = 1/u_i²,   t̄ = Σ w t / Σ w            (1)
//!   a = Σ w y / Σ w,   b = Σ w (t − t̄) y / Σ w (t − t̄)²                       (2)
//!   s² = Σ w (y − ŷ)² / (n − 2);   k² = max(1, s²) with uncertainties, s² without   (3)
//!   u²(a) = k² / Σ w,   u²(b) = k² / Σ w (t − t̄)²,   u(a, b) = 0                (4)
//! ```
//!
//! Without an uncertainty of every point, w_i = 1. Intervals are 95 %, by Student's t with n − 2 degrees of freedom.
//! Where points scatter more than their uncertainties, (3) widens everything by the Birge ratio; less scatter narrows nothing.
//!
//! # Holds when
//! Errors of different points are independent. An error that all points share, such as that of one instrument's certificate,
//! shifts the line and leaves its slope.
//!
//! # Agreement
//! `val_numpy_polyfit`: 1e-9 of the values of `numpy.polyfit` with weights.
//!
//! # References
//! [1] R. T. Birge, Phys. Rev. 40, 207 (1932), doi:10.1103/PhysRev.40.207.

use crate::point::{Point, weights};
use crate::student;

/// Fewest points of a line with an uncertainty.
const LEAST_POINTS: usize = 3;
/// Chance in noise alone below which a slope is significant.
const SIGNIFICANT: f64 = 0.05;

/// A straight line over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Points that it was fitted to.
    pub n: usize,
    /// Time of the first point, s since 1970.
    pub first_s: f64,
    /// Time of the last point, s since 1970.
    pub last_s: f64,
    /// Weighted mean time, s since 1970: t̄ of (1).
    pub mean_at_s: f64,
    /// Value at that time: a of (2).
    pub mean_value: f64,
    /// Standard uncertainty of it.
    pub mean_standard_uncertainty: f64,
    /// Slope, unit per second: b of (2).
    pub slope_per_s: f64,
    /// Standard uncertainty of it.
    pub slope_standard_uncertainty_per_s: f64,
    /// Factor of a 95 % interval.
    pub coverage_factor: f64,
    /// Chance of a slope at least as great in noise alone.
    pub p_value: f64,
    /// Scatter over uncertainty: s of (3); `None` where a point has no uncertainty.
    pub birge_ratio: Option<f64>,
}

impl Trend {
    /// Fits a line to points in any order; `None` for fewer than three points, or all at one time.
    #[must_use]
    pub fn of(points: &[Point]) -> Option<Self> {
        if points.len() < LEAST_POINTS {
            return None;
        }
        let n = points.len();
        let (weights, is_weighted) = weights(points);
        let all = || points.iter().zip(&weights);
        let sum: f64 = weights.iter().sum();
        let mean_at_s = mean(all().map(|(p, w)| (p.at_s, *w)), sum);
        let mean_value = mean(all().map(|(p, w)| (p.value, *w)), sum);
        let (mut tt, mut ty) = (0.0, 0.0);
        for (point, w) in all() {
            let t = point.at_s - mean_at_s;
            tt += w * t * t;
            ty += w * t * (point.value - mean_value);
        }
        let times = || points.iter().map(|point| point.at_s);
        let first_s = times().fold(f64::INFINITY, f64::min);
        let last_s = times().fold(f64::NEG_INFINITY, f64::max);
        // A span of less than a second is one time.
        if last_s - first_s < 1.0 || !(tt.is_finite() && tt > 0.0) {
            return None;
        }
        let slope_per_s = ty / tt;
        let residual = |(p, w): (&Point, &f64)| {
            let left = p.value - mean_value - slope_per_s * (p.at_s - mean_at_s);
            w * left * left
        };
        let freedom = n as f64 - 2.0;
        let squared = all().map(residual).sum::<f64>() / freedom;
        let widened = if is_weighted {
            squared.max(1.0)
        } else {
            squared
        };
        let slope_standard_uncertainty_per_s = (widened / tt).sqrt();
        Some(Self {
            n,
            first_s,
            last_s,
            mean_at_s,
            mean_value,
            mean_standard_uncertainty: (widened / sum).sqrt(),
            slope_per_s,
            slope_standard_uncertainty_per_s,
            coverage_factor: student::factor_95(freedom)?,
            p_value: chance(slope_per_s, slope_standard_uncertainty_per_s, freedom)?,
            birge_ratio: is_weighted.then(|| squared.sqrt()),
        })
    }

    /// The line at a time.
    #[must_use]
    pub fn value_at(&self, at_s: f64) -> f64 {
        self.mean_value + self.slope_per_s * (at_s - self.mean_at_s)
    }

    /// Half of the line's 95 % interval at a time.
    #[must_use]
    pub fn half_width_at(&self, at_s: f64) -> f64 {
        let by_slope = self.slope_standard_uncertainty_per_s * (at_s - self.mean_at_s);
        self.coverage_factor * self.mean_standard_uncertainty.hypot(by_slope)
    }

    /// Half of the slope's 95 % interval, unit per second.
    #[must_use]
    pub fn slope_half_width_per_s(&self) -> f64 {
        self.coverage_factor * self.slope_standard_uncertainty_per_s
    }

    /// Whether the slope's 95 % interval leaves out zero.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.p_value < SIGNIFICANT
    }
}

fn mean(values: impl Iterator<Item = (f64, f64)>, sum: f64) -> f64 {
    values.map(|(value, weight)| weight * value).sum::<f64>() / sum
}

/// A line through points without scatter has no chance to be noise, and a level one is nothing else.
fn chance(slope: f64, uncertainty: f64, freedom: f64) -> Option<f64> {
    if uncertainty > 0.0 {
        return student::two_sided(slope / uncertainty, freedom);
    }
    Some(if slope.abs() > 0.0 { 0.0 } else { 1.0 })
}
