//! Curves that effects are made of: Legendre polynomials over the travel, hats, harmonics.
//!
//! ```text
//!   h_k(x) = max(0, 1 - |x - x_k| / d), equally spaced by d               (1)
//!   P_n of ((u - middle) / half travel)                                   (2)
//! ```

use metrology::Axis;

use super::Scene;

/// Sum of hats (1) with places `first`, `first + spacing`, ...; zero beyond the outer ones.
pub(super) fn hats(first: f64, spacing: f64, heights: &[f64], at: f64) -> f64 {
    let place = (at - first) / spacing;
    let mut sum = 0.0;
    for (k, height) in heights.iter().enumerate() {
        let distance = (place - k as f64).abs();
        if distance < 1.0 {
            sum += height * (1.0 - distance);
        }
    }
    sum
}

/// Number of hats over the way since a reversal.
pub(super) const WAY_HATS: usize = 6;

/// Hats over the decimal logarithm of the way since a reversal, at 0.01, 0.03, 0.1, 0.3, 1 and 3 mm.
pub(super) fn way_hats(heights: &[f64; WAY_HATS], way_mm: f64) -> f64 {
    hats(-2.0, 0.5, heights, way_mm.max(1e-9).log10())
}

/// Number of hats over the travel.
pub(super) const PLACE_HATS: usize = 7;

/// Hats at 1/8 .. 7/8 of the travel, at a share of the half travel.
pub(super) fn place_hats(heights: &[f64; PLACE_HATS], share: f64) -> f64 {
    hats(-0.75, 0.25, heights, share)
}

/// Sum of Legendre polynomials of the orders `first`, `first + 1`, ... at x.
pub(super) fn legendre(first: usize, amplitudes: &[f64], x: f64) -> f64 {
    let (mut before, mut here) = (1.0, x);
    let mut order = 1_usize;
    let mut sum = 0.0;
    let mut n = 1.0;
    if first == 0 {
        sum += amplitudes.first().copied().unwrap_or(0.0);
    }
    while order < first + amplitudes.len() {
        if order >= first {
            sum += amplitudes[order - first] * here;
        }
        (before, here) = (here, ((2.0 * n + 1.0) * x * here - n * before) / (n + 1.0));
        (order, n) = (order + 1, n + 1.0);
    }
    sum
}

/// Where an axis is within its travel, -1 to 1, as place = (position - middle) * scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct Travel {
    middle: f64,
    per_half: f64,
}

impl Travel {
    /// Of an axis of the machine, mm or rad; an axis that the machine lacks stays in its middle.
    pub(super) fn of(scene: &Scene<'_>, axis: Axis) -> Self {
        let [low, high] = match (scene.machine.linear(axis), scene.machine.rotary_axis(axis)) {
            (Some(linear), _) => linear.travel_mm,
            (_, Some(rotary)) => rotary.travel_deg.map(f64::to_radians),
            _ => [0.0, f64::INFINITY],
        };
        Self {
            middle: if high.is_finite() {
                0.5 * (low + high)
            } else {
                0.0
            },
            per_half: 2.0 / (high - low),
        }
    }

    /// One over the half travel.
    pub(super) const fn per_half(self) -> f64 {
        self.per_half
    }

    /// Share of the half travel, (2).
    pub(super) fn share(self, position: f64) -> f64 {
        (position - self.middle) * self.per_half
    }
}
