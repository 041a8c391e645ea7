//! Change points: where a figure jumps, beside a straight line over time.
//!
//! # Model
//!
//! A step of any size at one of the places k between two points, beside the line of [`crate::Trend`]:
//!
//! ```text
//!   M0: y = a + b t + e;    M_k: y = a + b t + c [i ≥ k] + e                      (1)
//!   B_k = (1 + n)^((n − 3)/2) / (1 + n SSE_k/SSE_0)^((n − 2)/2)                   (2)
//!   chance of a change = B/(1 + B),  B = mean of B_k over the admissible k        (3)
//!   chance of place k = B_k / Σ B                                                (4)
//! ```
//!
//! (2) is the Bayes factor of one more regressor with Zellner's prior, g = n. (3) gives a change and none the same chance
//! before the data. A series is cut at its surest change, and each part is looked at again, as long as the chance exceeds 50 %.
//! Sums over the end of the series make one pass of (2) linear in n:
//!
//! ```text
//!   SSE_0 − SSE_k = (Σ_{i≥k} w r)² / (W_k − W_k²/W − T_k²/S_tt)                  (5)
//! ```
//!
//! with the residuals r of M0, W_k = Σ_{i≥k} w and T_k = Σ_{i≥k} w (t − t̄).
//!
//! # Holds when
//! Each side of a step has three points or more. A slow bend is no step, and may look like several.
//!
//! # Agreement
//! `eq5_is_the_difference_of_two_fits`: 1e-9 of full fits by numpy. `noise_alone_rarely_has_a_sure_change`.
//!
//! # References
//! [1] F. Liang et al., J. Am. Stat. Assoc. 103(481), 410 (2008), doi:10.1198/016214507000001337, equation 6.

use crate::point::{Point, weights};

/// Fewest points on either side of a step.
const LEAST_SIDE: usize = 3;
/// Most steps that are looked for.
const MOST_CHANGES: usize = 16;
/// Chance from which a step is reported.
const REPORTED: f64 = 0.5;
/// Chance from which a step is sure: trends begin anew after it.
pub const SURE: f64 = 0.95;
/// Share of a place's chance that its interval holds.
const INTERVAL: f64 = 0.95;
/// Residuals of a line below this share of the values' own sum of squares are rounding.
const ROUNDING: f64 = 1e-20;

/// A step of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangePoint {
    /// Index of the first point after the step, in order of time.
    pub index: usize,
    /// Time of the last point before the step, s since 1970.
    pub before_s: f64,
    /// Time of the first point after it, s since 1970.
    pub after_s: f64,
    /// Begin of the interval that holds the step, if there is one, with 95 %, s since 1970.
    pub earliest_s: f64,
    /// End of that interval, s since 1970.
    pub latest_s: f64,
    /// Size of the step, after minus before, in the figure's unit.
    pub step: f64,
    /// Standard uncertainty of the size.
    pub standard_uncertainty: f64,
    /// Chance that there is a step at all, (3).
    pub chance: f64,
}

/// Steps of points in order of time, in that order.
#[must_use]
pub fn change_points(points: &[Point]) -> Vec<ChangePoint> {
    let mut found = Vec::new();
    let mut parts = vec![(0, points.len())];
    while let Some((from, to)) = parts.pop() {
        let Some(part) = points.get(from..to) else {
            continue;
        };
        if let Some(mut change) = surest(part).filter(|it| it.chance > REPORTED) {
            let at = from + change.index;
            change.index = at;
            found.push(change);
            if found.len() == MOST_CHANGES {
                break;
            }
            parts.extend([(from, at), (at, to)]);
        }
    }
    found.sort_by_key(|change: &ChangePoint| change.index);
    found
}

/// The points after the last sure step.
#[must_use]
pub fn since_last_change<'a>(points: &'a [Point], changes: &[ChangePoint]) -> &'a [Point] {
    let last = changes.iter().rfind(|change| change.chance >= SURE);
    last.and_then(|change| points.get(change.index..))
        .unwrap_or(points)
}

/// A line fitted to a part, and what is left of it.
struct Line {
    weights: Vec<f64>,
    is_weighted: bool,
    /// Times minus their mean, s.
    times: Vec<f64>,
    residuals: Vec<f64>,
    weight: f64,
    s_tt: f64,
    sse: f64,
}

impl Line {
    fn of(points: &[Point]) -> Option<Self> {
        let (weights, is_weighted) = weights(points);
        let weight: f64 = weights.iter().sum();
        let mean = |of: fn(&Point) -> f64| {
            let sum: f64 = points.iter().zip(&weights).map(|(p, w)| w * of(p)).sum();
            sum / weight
        };
        let (mean_at, mean_value) = (mean(|p| p.at_s), mean(|p| p.value));
        let times: Vec<f64> = points.iter().map(|p| p.at_s - mean_at).collect();
        let dot = |a: &dyn Fn(usize) -> f64| -> f64 { (0..points.len()).map(a).sum() };
        let s_tt = dot(&|i| weights[i] * times[i] * times[i]);
        if !(s_tt.is_finite() && s_tt > 0.0) {
            return None;
        }
        let slope = dot(&|i| weights[i] * times[i] * (points[i].value - mean_value)) / s_tt;
        let residual = |(p, t): (&Point, &f64)| p.value - mean_value - slope * t;
        let residuals: Vec<f64> = points.iter().zip(&times).map(residual).collect();
        let sse = dot(&|i| weights[i] * residuals[i] * residuals[i]);
        let values = dot(&|i| weights[i] * points[i].value * points[i].value);
        (sse > ROUNDING * values).then_some(Self {
            weights,
            is_weighted,
            times,
            residuals,
            weight,
            s_tt,
            sse,
        })
    }

    /// For each first index after a step: the numerator's root and the denominator of (5).
    fn steps(&self) -> Vec<(f64, f64)> {
        let n = self.times.len();
        let mut all = vec![(0.0, 0.0); n];
        let (mut w_k, mut t_k, mut r_k) = (0.0, 0.0, 0.0);
        for i in (0..n).rev() {
            let w = self.weights[i];
            w_k += w;
            t_k += w * self.times[i];
            r_k += w * self.residuals[i];
            all[i] = (
                r_k,
                w_k - w_k * w_k / self.weight - t_k * t_k / self.s_tt, // (5)
            );
        }
        all
    }
}

/// The most likely step of points, with the chance of any.
fn surest(points: &[Point]) -> Option<ChangePoint> {
    let n = points.len();
    if n < 2 * LEAST_SIDE {
        return None;
    }
    let line = Line::of(points)?;
    let steps = line.steps();
    let size = n as f64;
    let log_factor = |k: usize| -> Option<f64> {
        let (r_k, denominator) = steps[k];
        let is_apart = points[k].at_s > points[k - 1].at_s;
        if !is_apart || denominator <= 1e-9 * line.weight {
            return None;
        }
        let left = (1.0 - r_k * r_k / denominator / line.sse).max(0.0);
        Some((size - 3.0) / 2.0 * size.ln_1p() - (size - 2.0) / 2.0 * (size * left).ln_1p()) // (2)
    };
    let places: Vec<(usize, f64)> = (LEAST_SIDE..=n - LEAST_SIDE)
        .filter_map(|k| Some((k, log_factor(k)?)))
        .collect();
    let (k, greatest) = places.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let shares: Vec<f64> = places.iter().map(|(_, b)| (b - greatest).exp()).collect();
    let sum: f64 = shares.iter().sum();
    // B/(1 + B) without an overflow of B.
    let log_mean = greatest + (sum / places.len() as f64).ln();
    let chance = 1.0 / (1.0 + (-log_mean).exp()); // (3)
    let (low, high) = interval(&shares, sum)?;
    let (r_k, denominator) = steps[k];
    let left = (line.sse - r_k * r_k / denominator).max(0.0) / (size - 3.0);
    let widened = if line.is_weighted {
        left.max(1.0)
    } else {
        left
    };
    Some(ChangePoint {
        index: k,
        before_s: points[k - 1].at_s,
        after_s: points[k].at_s,
        earliest_s: points[places[low].0 - 1].at_s,
        latest_s: points[places[high].0].at_s,
        step: r_k / denominator,
        standard_uncertainty: (widened / denominator).sqrt(),
        chance,
    })
}

/// First and last of the places that together hold 95 %, with the rest left out in equal parts at either end.
fn interval(shares: &[f64], sum: f64) -> Option<(usize, usize)> {
    let outside = sum * (1.0 - INTERVAL) / 2.0;
    let mut below = 0.0;
    let low = shares.iter().position(|share| {
        below += share;
        below > outside
    })?;
    let mut above = 0.0;
    let high = shares.iter().rposition(|share| {
        above += share;
        above > outside
    })?;
    Some((low, high))
}
