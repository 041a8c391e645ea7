//! A figure beside what is not known about it.

use serde::{Deserialize, Serialize};

/// Factor between the standard uncertainties of a budget and what is printed.
pub const COVERAGE_FACTOR: f64 = 2.0;

/// A length with its expanded uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpandedLength {
    /// The figure, mm.
    pub value_mm: f64,
    /// Expanded uncertainty, mm; the coverage factor is [`COVERAGE_FACTOR`] where the figure's owner states no other one.
    pub expanded_uncertainty_mm: f64,
}

impl ExpandedLength {
    /// From a value and a standard uncertainty, mm.
    #[must_use]
    pub const fn new(value_mm: f64, standard_uncertainty_mm: f64) -> Self {
        Self {
            value_mm,
            expanded_uncertainty_mm: COVERAGE_FACTOR * standard_uncertainty_mm,
        }
    }

    /// Standard uncertainty, mm, of a figure with that coverage factor.
    #[must_use]
    pub const fn standard_uncertainty_mm(&self) -> f64 {
        self.expanded_uncertainty_mm / COVERAGE_FACTOR
    }
}

/// An angle with its expanded uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpandedAngle {
    /// The figure, rad.
    pub value_rad: f64,
    /// Expanded uncertainty with the coverage factor [`COVERAGE_FACTOR`], rad.
    pub expanded_uncertainty_rad: f64,
}

impl ExpandedAngle {
    /// From a value and a standard uncertainty, rad.
    #[must_use]
    pub const fn new(value_rad: f64, standard_uncertainty_rad: f64) -> Self {
        Self {
            value_rad,
            expanded_uncertainty_rad: COVERAGE_FACTOR * standard_uncertainty_rad,
        }
    }
}

/// Speed of a drift with its expanded uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpandedRate {
    /// The figure, mm/s.
    pub value_mm_s: f64,
    /// Expanded uncertainty, mm/s; the coverage factor is [`COVERAGE_FACTOR`] where the figure's owner states no other one.
    pub expanded_uncertainty_mm_s: f64,
}

impl ExpandedRate {
    /// From a value and a standard uncertainty, mm/s.
    #[must_use]
    pub const fn new(value_mm_s: f64, standard_uncertainty_mm_s: f64) -> Self {
        Self {
            value_mm_s,
            expanded_uncertainty_mm_s: COVERAGE_FACTOR * standard_uncertainty_mm_s,
        }
    }
}

/// Speed of a drifting angle with its expanded uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpandedAngularRate {
    /// The figure, rad/s.
    pub value_rad_s: f64,
    /// Expanded uncertainty with the coverage factor [`COVERAGE_FACTOR`], rad/s.
    pub expanded_uncertainty_rad_s: f64,
}

impl ExpandedAngularRate {
    /// From a value and a standard uncertainty, rad/s.
    #[must_use]
    pub const fn new(value_rad_s: f64, standard_uncertainty_rad_s: f64) -> Self {
        Self {
            value_rad_s,
            expanded_uncertainty_rad_s: COVERAGE_FACTOR * standard_uncertainty_rad_s,
        }
    }
}
