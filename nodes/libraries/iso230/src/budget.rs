//! What is not known about a length measurement on a machine.
//!
//! # Model
//!
//! Every contribution is a standard uncertainty; rectangular where only limits are known:
//!
//! ```text
//!   u(half width a) = a/√3                                                            (1)
//!   device       u = (U₀ + U₁ L)/k                                                    (2)
//!   alignment    ΔL = R²/(2L) at most, never negative:  u = R²/(4√3 L)                (3)
//!   temperature  u = α L a_θ/√3                                                       (4)
//!   expansion    u = |θ − 20 °C| L a_α/√3                                             (5)
//!   drift        u = E_VE/(2√3)                                                       (6)
//! ```
//!
//! U = 2 u holds 95.45 % of a normal distribution, and all of one rectangle. Where limits make most of u, k of
//! [`coverage_factor`] is that of their sum, with σ the normal part and aᵢ the half widths:
//!
//! ```text
//!   0.9545 = (2/π) ∫₀^∞ sin(k u t)/t · exp(−σ²t²/2) · Π sin(aᵢ t)/(aᵢ t) dt             (7)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | U₀, U₁, k | [`DeviceUncertainty`] | mm, mm/mm, 1 |
//! | R | `misalignment_mm`, lateral, over the length L | mm |
//! | θ − 20 °C, a_θ | `temperature_deviation_k`, `temperature_half_width_k` | K |
//! | α, a_α | `expansion_per_k`, `expansion_half_width_per_k` | 1/K |
//! | E_VE | `environmental_drift_mm`, range of drift with the axis at rest | mm |
//!
//! # Holds when
//! Lengths are corrected to 20 °C with the same temperature and expansion, here
//! ([`PositioningRuns::corrected_to_20_degc`](super::positioning::PositioningRuns::corrected_to_20_degc)) or by the
//! instrument; (4) and (5) are what is then left. They do not hold for lengths at another temperature.
//! (3) holds for R well below L.
//!
//! # Agreement
//! `eq1_to_eq6_for_a_metre_by_hand`: below 1e-12 mm. (7) against closed forms of one and two rectangles and scipy's
//! convolution, `eq7_of_rectangles_is_that_of_closed_forms_and_scipy`: below 1e-3.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), 4.3.7, 5.1 and G.2. \[2\] ISO/TR 230-9:2005, whose list of contributions
//! this is; its text was not at hand, the equations are derived.

use serde::{Deserialize, Serialize};

use super::Iso230Error;
use super::expanded::COVERAGE_FACTOR;
use super::extent::{check_finite, check_not_negative, check_positive};

/// Standard uncertainty of a value of which only limits ± `half_width` are known, (1).
#[must_use]
pub fn rectangular(half_width: f64) -> f64 {
    half_width / 3.0_f64.sqrt()
}

/// Root of the sum of squares.
#[must_use]
pub fn combined(standard_uncertainties: &[f64]) -> f64 {
    standard_uncertainties
        .iter()
        .map(|u| u * u)
        .sum::<f64>()
        .sqrt()
}

/// Probability of two standard uncertainties about the mean of a normal distribution.
const PROBABILITY: f64 = 0.954_499_736;
/// Steps of the integral (7) for each standard uncertainty of the figure, over 1/u.
const STEPS_PER_U: f64 = 40.0;
/// Least normal part of the sum, as a share of u: its exponential ends the integral (7).
const MIN_NORMAL_SHARE: f64 = 0.02;
/// Exponent at which the normal part has ended the integral, σ t.
const END_SIGMA_T: f64 = 6.0;
/// Halvings of the interval that k lies in.
const HALVINGS: u32 = 30;

/// k of (7) for a figure of a normal part and of limits, all as standard uncertainties; 2 without limits.
#[must_use]
pub fn coverage_factor(normal: f64, limits: &[f64]) -> f64 {
    let u = combined(&[normal, combined(limits)]);
    if limits.iter().all(|part| *part == 0.0) || !u.is_normal() {
        return COVERAGE_FACTOR;
    }
    let sigma = (normal / u).max(MIN_NORMAL_SHARE);
    let half_widths: Vec<f64> = limits
        .iter()
        .map(|part| 3.0_f64.sqrt() * part / u)
        .collect();
    let (mut low, mut high) = (1.0, COVERAGE_FACTOR);
    for _ in 0..HALVINGS {
        let k = f64::midpoint(low, high);
        if probability_within(k, sigma, &half_widths) < PROBABILITY {
            low = k;
        } else {
            high = k;
        }
    }
    high
}

/// Right side of (7) in units of u, by the midpoint rule.
fn probability_within(k: f64, sigma: f64, half_widths: &[f64]) -> f64 {
    let steps = (END_SIGMA_T / sigma * STEPS_PER_U).ceil();
    let width = END_SIGMA_T / sigma / steps;
    let term = |i: u32| {
        let t = (f64::from(i) + 0.5) * width;
        let limits: f64 = { half_widths.iter().filter(|a| **a > 0.0) }
            .map(|a| (a * t).sin() / (a * t))
            .product();
        (k * t).sin() / t * (-0.5 * (sigma * t).powi(2)).exp() * limits
    };
    let sum: f64 = (0..steps as u32).map(term).sum();
    2.0 / std::f64::consts::PI * sum * width
}

/// What the certificate of a length measuring device states, (2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceUncertainty {
    /// Part of the expanded uncertainty that every length has, mm.
    pub expanded_uncertainty_mm: f64,
    /// Part that grows with the length, mm/mm.
    pub expanded_uncertainty_per_length: f64,
    /// Coverage factor of both.
    pub coverage_factor: f64,
}

impl DeviceUncertainty {
    /// Standard uncertainty of a length, mm: (2).
    #[must_use]
    pub fn standard_mm(&self, length_mm: f64) -> f64 {
        (self.expanded_uncertainty_mm + self.expanded_uncertainty_per_length * length_mm.abs())
            / self.coverage_factor
    }

    pub(super) fn check(&self) -> Result<(), Iso230Error> {
        check_not_negative(
            "device.expanded_uncertainty_mm",
            self.expanded_uncertainty_mm,
        )?;
        check_not_negative(
            "device.expanded_uncertainty_per_length",
            self.expanded_uncertainty_per_length,
        )?;
        check_positive("device.coverage_factor", self.coverage_factor)
    }
}

/// Temperature and expansion of something whose length enters a measurement, (4) and (5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expansion {
    /// Mean temperature minus 20 °C, K.
    pub temperature_deviation_k: f64,
    /// Half of the interval in which that temperature lies, K.
    pub temperature_half_width_k: f64,
    /// Coefficient of expansion, 1/K; 0 for a device that does not expand.
    pub expansion_per_k: f64,
    /// Half of the interval in which the coefficient lies, 1/K.
    pub expansion_half_width_per_k: f64,
}

impl Expansion {
    /// Standard uncertainty of a length by the temperature, mm: (4).
    #[must_use]
    pub fn by_temperature_mm(&self, length_mm: f64) -> f64 {
        rectangular(self.expansion_per_k.abs() * length_mm.abs() * self.temperature_half_width_k)
    }

    /// Standard uncertainty of a length by the coefficient, mm: (5).
    #[must_use]
    pub fn by_coefficient_mm(&self, length_mm: f64) -> f64 {
        rectangular(
            self.temperature_deviation_k.abs() * length_mm.abs() * self.expansion_half_width_per_k,
        )
    }

    /// Nominal expansion from 20 °C to the temperature, mm/mm: α (θ − 20 °C).
    #[must_use]
    pub fn nominal(&self) -> f64 {
        self.expansion_per_k * self.temperature_deviation_k
    }

    /// Both together, mm.
    #[must_use]
    pub fn standard_mm(&self, length_mm: f64) -> f64 {
        self.by_temperature_mm(length_mm)
            .hypot(self.by_coefficient_mm(length_mm))
    }

    pub(super) fn check(&self) -> Result<(), Iso230Error> {
        let signed = [self.temperature_deviation_k, self.expansion_per_k];
        check_finite("expansion", 0, &signed)?;
        check_not_negative("temperature_half_width_k", self.temperature_half_width_k)?;
        check_not_negative(
            "expansion_half_width_per_k",
            self.expansion_half_width_per_k,
        )
    }
}

/// By how much a warm machine is too long as a warm device reads it, mm/mm: α_m (θ_m − 20 °C) − α_d (θ_d − 20 °C).
#[must_use]
pub fn differential_expansion(machine: &Expansion, device: &Expansion) -> f64 {
    machine.nominal() - device.nominal()
}

/// Standard uncertainty by a beam that is `misalignment_mm` off at the end of a length, mm: (3).
#[must_use]
pub fn alignment_mm(misalignment_mm: f64, length_mm: f64) -> f64 {
    if length_mm == 0.0 {
        return 0.0;
    }
    rectangular(misalignment_mm.powi(2) / (4.0 * length_mm.abs()))
}

/// Standard uncertainty of one reading by a drift of this range, mm: (6).
#[must_use]
pub fn drift_mm(range_mm: f64) -> f64 {
    rectangular(range_mm / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_to_eq6_for_a_metre_by_hand() {
        let near = |found: f64, by_hand: f64| assert!((found - by_hand).abs() < 1e-12, "{found}");
        let device = DeviceUncertainty {
            expanded_uncertainty_mm: 0.0002,
            expanded_uncertainty_per_length: 0.5e-6,
            coverage_factor: 2.0,
        };
        near(device.standard_mm(-1000.0), 0.000_35);
        near(alignment_mm(2.0, 1000.0), 0.001 / 3.0_f64.sqrt());
        let machine = Expansion {
            temperature_deviation_k: -3.0,
            temperature_half_width_k: 0.6,
            expansion_per_k: 11.5e-6,
            expansion_half_width_per_k: 1e-6,
        };
        near(machine.by_temperature_mm(1000.0), 0.006_9 / 3.0_f64.sqrt());
        near(machine.by_coefficient_mm(1000.0), 0.003 / 3.0_f64.sqrt());
        near(drift_mm(0.0012), 0.0006 / 3.0_f64.sqrt());
        near(combined(&[0.003, 0.004]), 0.005);
        near(alignment_mm(2.0, 0.0), 0.0);
    }

    #[test]
    fn eq7_of_rectangles_is_that_of_closed_forms_and_scipy() {
        let near = |found: f64, right: f64| assert!((found - right).abs() < 1e-3, "{found}");
        near(coverage_factor(1.0, &[]), 2.0);
        near(coverage_factor(1.0, &[0.0, 1e-6]), 2.0);
        // One rectangle: p √3. Two alike, a triangle: (1 − √(1 − p)) √6.
        near(coverage_factor(0.0, &[1.0]), PROBABILITY * 3.0_f64.sqrt());
        near(
            coverage_factor(0.0, &[1.0, 1.0]),
            (1.0 - (1.0 - PROBABILITY).sqrt()) * 6.0_f64.sqrt(),
        );
        // scipy: normal cumulative distribution averaged over the rectangles by Gauss-Legendre.
        near(coverage_factor(1.0, &[2.0]), 1.836_009);
        near(coverage_factor(0.5, &[1.0, 1.0]), 1.937_883);
        near(coverage_factor(1.0, &[1.0, 0.5, 0.25]), 1.966_013);
    }
}
