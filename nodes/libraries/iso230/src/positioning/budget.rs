//! From a budget to the uncertainty of each figure of a positioning test.
//!
//! # Model
//!
//! The length part u_L takes what grows with the length between the places of the two extremes of a figure; drift u_V is
//! new at every reading, and is taken to add to the scatter as if the machine had none:
//!
//! ```text
//!   u_L² = u_device² + u_alignment² + u_machine² + u_device's own expansion²          (1)
//!   B, B̄ :  u² = (2/n) u_V²              one place, two means of n readings           (2)
//!   R↑   :  u² = 4² u_V²                 4 s, and s grows by at most u_V              (3)
//!   R    :  u² = (4² + 2/n) u_V²                                                      (4)
//!   E↑, E:  u² = u_L² + (2/n) u_V²       difference of two means                      (5)
//!   M    :  u² = u_L² + (1/n) u_V²       means of 2n readings                         (6)
//!   A↑, A:  u² = u_L² + (4² + 2/n) u_V²                                               (7)
//! ```
//!
//! # Holds when
//! The lengths are corrected to 20 °C with the temperatures and expansions of the same budget.
//! E_VE was watched for as long as one test takes. (3), (4) and (7) are bounds: u_V at a target
//! is part of s already, and a machine that scatters more than it drifts hides it.
//!
//! # Agreement
//! `eq2_to_eq7_are_ratios_of_the_two_parts`, by hand.
//! 1,000 simulated tests of a machine that never scatters, with normal errors of scale and drift
//! (`eq2_eq5_eq6_of_the_budget_are_the_scatter_of_the_figures`): two standard uncertainties held
//! 95.9 % of E↑ and of E, 95.2 % of M, 95.7 % of the single B_i; B itself is the greatest of them
//! and lies higher. R↑, R and A held at once in 98.4 %
//! (`eq3_eq4_eq7_of_the_budget_bound_what_drift_adds_to_the_scatter`).
//! Over machines that do more, a second implementation in numpy: E 95.6 %, E↑ and M 96.0 %, A 97.9 %; with u_L of the whole
//! travel E, M and E↑ would be held in 98.4 to 98.5 % (`tests/validation/coverage_of_u.py`).

use serde::{Deserialize, Serialize};

use crate::Iso230Error;
use crate::budget::{
    DeviceUncertainty, Expansion, alignment_mm, combined, differential_expansion, drift_mm,
};
use crate::extent::check_not_negative;

/// What is not known about a positioning test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositioningBudget {
    /// The measuring device.
    pub device: DeviceUncertainty,
    /// By how much beam and axis can part sideways over the measured length, mm.
    pub misalignment_mm: f64,
    /// Temperature and expansion of the machine (or of the workpiece it is corrected to).
    pub machine: Expansion,
    /// The device's own temperature and expansion; coefficient 0 for a laser interferometer.
    pub device_expansion: Expansion,
    /// Range of the reading with the axis at rest, as long as a test takes, mm.
    pub environmental_drift_mm: f64,
}

/// Standard uncertainties of one budget over one length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PositioningContributions {
    /// Length at which they hold, mm.
    pub length_mm: f64,
    /// Measuring device, mm.
    pub device_mm: f64,
    /// Alignment, mm.
    pub alignment_mm: f64,
    /// Machine temperature, mm.
    pub machine_temperature_mm: f64,
    /// Machine coefficient of expansion, mm.
    pub machine_expansion_mm: f64,
    /// Device temperature, mm.
    pub device_temperature_mm: f64,
    /// Device coefficient of expansion, mm.
    pub device_expansion_mm: f64,
    /// Drift of one reading, mm.
    pub drift_mm: f64,
}

impl PositioningBudget {
    /// Nominal differential expansion of machine against device, mm/mm; equation (1) of `reference_temperature`.
    #[must_use]
    pub fn differential_expansion(&self) -> f64 {
        differential_expansion(&self.machine, &self.device_expansion)
    }

    /// Standard uncertainties over a length; the misalignment is that over `span_mm`.
    #[must_use]
    pub fn over(&self, length_mm: f64, span_mm: f64) -> PositioningContributions {
        // The beam's angle is one for the whole axis, so its error grows with the length.
        let share = if span_mm > 0.0 {
            length_mm.abs() / span_mm
        } else {
            0.0
        };
        PositioningContributions {
            length_mm,
            device_mm: self.device.standard_mm(length_mm),
            alignment_mm: share * alignment_mm(self.misalignment_mm, span_mm),
            machine_temperature_mm: self.machine.by_temperature_mm(length_mm),
            machine_expansion_mm: self.machine.by_coefficient_mm(length_mm),
            device_temperature_mm: self.device_expansion.by_temperature_mm(length_mm),
            device_expansion_mm: self.device_expansion.by_coefficient_mm(length_mm),
            drift_mm: drift_mm(self.environmental_drift_mm),
        }
    }

    pub(super) fn check(&self) -> Result<(), Iso230Error> {
        self.device.check()?;
        check_not_negative("misalignment_mm", self.misalignment_mm)?;
        self.machine.check()?;
        self.device_expansion.check()?;
        check_not_negative("environmental_drift_mm", self.environmental_drift_mm)
    }
}

impl PositioningContributions {
    /// Standard uncertainty of the length itself, mm: (1).
    #[must_use]
    pub fn length_part_mm(&self) -> f64 {
        combined(&[
            self.device_mm,
            self.alignment_mm,
            self.machine_temperature_mm,
            self.machine_expansion_mm,
            self.device_temperature_mm,
            self.device_expansion_mm,
        ])
    }

    pub(super) fn figures(&self, n_runs: usize) -> FigureUncertainties {
        let length_mm = self.length_part_mm();
        let drift = |weight: f64| weight.sqrt() * self.drift_mm;
        let n = n_runs as f64;
        FigureUncertainties {
            reversal_mm: drift(2.0 / n),                                // (2)
            repeatability_one_way_mm: drift(16.0),                      // (3)
            repeatability_mm: drift(16.0 + 2.0 / n),                    // (4)
            systematic_mm: combined(&[length_mm, drift(2.0 / n)]),      // (5)
            mean_systematic_mm: combined(&[length_mm, drift(1.0 / n)]), // (6)
            accuracy_mm: combined(&[length_mm, drift(16.0 + 2.0 / n)]), // (7)
        }
    }
}

/// Standard uncertainties of the figures, mm.
pub(super) struct FigureUncertainties {
    pub reversal_mm: f64,
    pub repeatability_one_way_mm: f64,
    pub repeatability_mm: f64,
    pub systematic_mm: f64,
    pub mean_systematic_mm: f64,
    pub accuracy_mm: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_to_eq7_are_ratios_of_the_two_parts() {
        let parts = PositioningContributions {
            length_mm: 1000.0,
            device_mm: 0.002,
            alignment_mm: 0.001,
            machine_temperature_mm: 0.002,
            machine_expansion_mm: 0.0,
            device_temperature_mm: 0.0,
            device_expansion_mm: 0.004,
            drift_mm: 0.001,
        };
        assert!((parts.length_part_mm() - 0.005).abs() < 1e-15);
        let figures = parts.figures(8);
        let near = |found: f64, by_hand: f64| assert!((found - by_hand).abs() < 1e-15, "{found}");
        near(figures.reversal_mm, 0.0005);
        near(figures.repeatability_one_way_mm, 0.004);
        near(figures.repeatability_mm, 16.25e-6_f64.sqrt());
        near(figures.systematic_mm, 25.25e-6_f64.sqrt());
        near(figures.mean_systematic_mm, 25.125e-6_f64.sqrt());
        near(figures.accuracy_mm, 41.25e-6_f64.sqrt());
    }
}
