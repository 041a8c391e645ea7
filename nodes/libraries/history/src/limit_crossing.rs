//! When a trend reaches a limit.
//!
//! # Model
//!
//! With the line of [`crate::Trend`] and τ = t − t̄, the limit L lies within the line's 95 % interval where
//!
//! ```text
//!   (a + b τ − L)² ≤ q² (u²(a) + u²(b) τ²)                                        (1)
//! ```
//!
//! (Fieller). For a significant slope the solutions are one interval of time, which holds τ = (L − a)/b. Otherwise the date is
//! not known before more data; the first later time at which (1) holds is the earliest possible one.
//!
//! # Holds when
//! The line continues. Nothing in the data says that it does: a date far beyond the recorded span is an extrapolation.
//!
//! # Agreement
//! `val_numpy_fieller`: 1e-6 of the span.
//!
//! # References
//! [1] E. C. Fieller, J. R. Stat. Soc. B 16(2), 175 (1954).

use crate::trend::Trend;

/// On which side of a limit a figure must stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// It must not rise above.
    Upper,
    /// It must not fall below.
    Lower,
}

/// A limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// In the figure's unit.
    pub value: f64,
    /// Its side.
    pub side: Side,
}

/// When a limit is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossing {
    /// The line is at or beyond it at its last point.
    Reached,
    /// The line leads there.
    Expected {
        /// Most likely time, s since 1970.
        at_s: f64,
        /// Begin of the 95 % interval, s since 1970.
        earliest_s: f64,
        /// End of the 95 % interval, s since 1970.
        latest_s: f64,
        /// Time from the last point to `at_s` over the span of the points.
        spans_ahead: f64,
    },
    /// The line leads away from it, significantly.
    MovesAway,
    /// The slope is not significant: no date before more data.
    NeedsData {
        /// Earliest time of the 95 % interval, s since 1970; `None`: never within it.
        not_before_s: Option<f64>,
    },
}

/// When the line reaches a limit.
#[must_use]
pub fn crossing(trend: &Trend, limit: Limit) -> Crossing {
    // A lower limit is an upper one of the mirrored figure.
    let sign = match limit.side {
        Side::Upper => 1.0,
        Side::Lower => -1.0,
    };
    let band = Band {
        offset: sign * (trend.mean_value - limit.value),
        slope: sign * trend.slope_per_s,
        u_offset: trend.coverage_factor * trend.mean_standard_uncertainty,
        u_slope: trend.coverage_factor * trend.slope_standard_uncertainty_per_s,
    };
    let last = trend.last_s - trend.mean_at_s;
    if band.offset + band.slope * last >= 0.0 {
        return Crossing::Reached;
    }
    if !trend.is_significant() {
        let not_before_s = band.touches_from(last).map(|tau| trend.mean_at_s + tau);
        return Crossing::NeedsData { not_before_s };
    }
    let roots = band.roots().filter(|_| band.slope > 0.0);
    let Some((low, high)) = roots else {
        return Crossing::MovesAway;
    };
    let at_s = trend.mean_at_s - band.offset / band.slope;
    Crossing::Expected {
        at_s,
        earliest_s: trend.mean_at_s + low,
        latest_s: trend.mean_at_s + high,
        spans_ahead: (at_s - trend.last_s) / (trend.last_s - trend.first_s),
    }
}

/// The line's distance from the limit, with its 95 % interval.
struct Band {
    offset: f64,
    slope: f64,
    u_offset: f64,
    u_slope: f64,
}

impl Band {
    /// Where (1) is an equation, in order.
    fn roots(&self) -> Option<(f64, f64)> {
        let square = self.slope * self.slope - self.u_slope * self.u_slope;
        let half = self.slope * self.offset;
        let constant = self.offset * self.offset - self.u_offset * self.u_offset;
        let discriminant = half * half - square * constant;
        if discriminant < 0.0 || square.abs() < f64::MIN_POSITIVE {
            return None;
        }
        let root = discriminant.sqrt();
        let (a, b) = ((-half - root) / square, (-half + root) / square);
        Some((a.min(b), a.max(b)))
    }

    /// The first time from `last` on at which the interval touches the limit.
    fn touches_from(&self, last: f64) -> Option<f64> {
        let upper =
            |tau: f64| self.offset + self.slope * tau + self.u_offset.hypot(self.u_slope * tau);
        if upper(last) >= 0.0 {
            return Some(last);
        }
        // The upper edge is convex: of the roots, only one that comes later and has the line below the limit is its.
        let (a, b) = self.roots()?;
        let is_its = |tau: &f64| *tau >= last && self.offset + self.slope * tau <= 0.0;
        [a, b].into_iter().find(is_its)
    }
}
