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
//! `eq1_to_eq6_for_a_metre_by_hand`: below 1e-12 mm.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), 4.3.7 and 5.1. \[2\] ISO/TR 230-9:2005, whose list of contributions
//! this is; its text was not at hand, the equations are derived.

use serde::{Deserialize, Serialize};

use super::Iso230Error;
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
}
