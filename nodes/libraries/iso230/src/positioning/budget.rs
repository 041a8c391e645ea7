//! From a budget to the uncertainty of each figure of a positioning test.
//!
//! # Model
//!
//! The length part u_L takes what grows with the length between the places of the two extremes of a figure; u_V is
//! that of one reading by a drift of range E_VE over the whole test, w the unrest of a reading at rest from one moment
//! to the next, where it is stated:
//!
//! ```text
//!   u_L² = u_device² + u_alignment² + u_machine² + u_device's own expansion²                    (1)
//!   B, B̄ :  u_B² = (2 u_V/n)² + (2/n) w²,  never more than (2/n) u_V²; w not stated: (2/n) u_V²  (2)
//!   s    :  r² = u_V²/(n − 1),   v² = u_V² (n − 2)/(n − 1),   o = s − √(s² − v²),
//!           o = min(s, v) where s² < u_V² χ²(p, n − 1)/(n − 1),   p = 0.95^(1/k)               (3)
//!   R↑   :  u² = 4² (r² + o²)                                                                  (4)
//!   R    :  u² = 2² (2 r² + (o↑ + o↓)²) + u_B²,   or (4) where R_i is that of one side          (5)
//!   E↑, E:  u² = u_L² + (2/n) u_V²       difference of two means                                (6)
//!   M    :  u² = u_L² + (1/n) u_V²       means of 2n readings                                   (7)
//!   A↑, A:  u² = u_L² + (2/n) u_V² + 2² (r² + o²) of each of the two ends                       (8)
//! ```
//!
//! (2): the readings of one target from both sides are at most two legs, 1/n of the test, apart. A drift that is slow
//! beside them moves one against the other by at most E_VE/n, rectangular: E_VE/(n√3) = 2 u_V/n. What is not slow is w,
//! new at every reading. Without w all drift is taken as new at every reading, which is the greatest it can do.
//!
//! (3): drift d between the n runs at a target has n − 1 components beside the machine's own scatter z. The one along z
//! changes s in the first order, by the law of propagation: ∂s/∂x_j = (x_j − x̄)/((n − 1) s), so r² = u_V²/(n − 1). The
//! n − 2 others add to it as squares, s² = s_z² + v², always upwards: o is the offset that is then in s. R and A are those of
//! the greatest of k standard deviations, one for each target and side. Where drift alone makes the greatest of k as great
//! as s in 5 % of tests or more, nothing shows that the machine scatters itself, and o is the greatest that it can be. It
//! is not taken out of R and A but stands in their U, with the same sign for both sides in (5). r² + o²
//! is never more than u_V².
//!
//! # Holds when
//! The lengths are corrected to 20 °C with the temperatures and expansions of the same budget.
//! E_VE was watched for as long as one test takes. Each run up is followed by its run down.
//!
//! # Agreement
//! `eq2_to_eq8_by_hand`. Over 4000 simulated machines in numpy (`tests/validation/coverage_of_u.py`) and 1000 here
//! (`iso230_2_u_holds_the_figures_of_the_runs_that_were_made`) every figure is held in 93 to 97 %.
//! 1,000 simulated tests of a machine that never scatters, with normal errors of scale and drift
//! (`eq2_eq6_eq7_of_the_budget_are_the_scatter_of_the_figures`): two standard uncertainties held
//! 95.9 % of E↑ and of E, 95.2 % of M, 95.7 % of the single B_i; B itself is the greatest of them
//! and lies higher.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), 4.3.7, 5.1.2 and F.2.4.5.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::Iso230Error;
use crate::budget::{
    DeviceUncertainty, Expansion, alignment_mm, combined, differential_expansion, drift_mm,
};
use crate::extent::check_not_negative;

/// Probability up to which a scatter can be that of drift alone, (3).
const DRIFT_ALONE_PROBABILITY: f64 = 0.95;

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
    /// Standard deviation of a reading at rest from one moment to the next, mm; none: all drift counts as new at every
    /// reading.
    #[serde(default)]
    pub environmental_unrest_mm: Option<f64>,
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
    /// Unrest of one reading, where it is stated, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unrest_mm: Option<f64>,
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
            unrest_mm: self.environmental_unrest_mm,
        }
    }

    pub(super) fn check(&self) -> Result<(), Iso230Error> {
        self.device.check()?;
        check_not_negative("misalignment_mm", self.misalignment_mm)?;
        self.machine.check()?;
        self.device_expansion.check()?;
        check_not_negative("environmental_drift_mm", self.environmental_drift_mm)?;
        let unrest_mm = self.environmental_unrest_mm.unwrap_or(0.0);
        check_not_negative("environmental_unrest_mm", unrest_mm)
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

    /// For a test of `n_runs` runs from each side that has `n_scatters` standard deviations, k of (3).
    pub(super) fn figures(&self, n_runs: usize, n_scatters: usize) -> FigureUncertainties {
        FigureUncertainties {
            n: n_runs as f64,
            n_scatters: n_scatters as f64,
            length_mm: self.length_part_mm(),
            drift_mm: self.drift_mm,
            unrest_mm: self.unrest_mm,
        }
    }
}

/// What the standard uncertainties of the figures are made of; extremes have one distance.
pub(super) struct FigureUncertainties {
    n: f64,
    n_scatters: f64,
    length_mm: f64,
    drift_mm: f64,
    unrest_mm: Option<f64>,
}

impl FigureUncertainties {
    /// (2), mm.
    pub fn reversal_mm(&self) -> f64 {
        let at_most_mm = (2.0 / self.n).sqrt() * self.drift_mm;
        match self.unrest_mm {
            None => at_most_mm,
            Some(w) => {
                let slow_mm = 2.0 * self.drift_mm / self.n;
                slow_mm.hypot((2.0 / self.n).sqrt() * w).min(at_most_mm)
            }
        }
    }

    /// (3): r and o of a standard deviation, mm; there are two runs at least.
    fn of_scatter_mm(&self, s_mm: f64) -> [f64; 2] {
        let (freedom, u_mm) = (self.n - 1.0, self.drift_mm);
        let added_mm = u_mm * ((freedom - 1.0) / freedom).sqrt();
        let of_each = DRIFT_ALONE_PROBABILITY.powf(1.0 / self.n_scatters);
        let of_drift_alone = ChiSquared::new(freedom)
            .map_or(f64::INFINITY, |chi2| chi2.inverse_cdf(of_each) / freedom);
        let offset_mm = if s_mm * s_mm < of_drift_alone * u_mm * u_mm {
            s_mm.min(added_mm)
        } else {
            // The point of 95 % and more lies above the mean, so the root is of no negative number.
            s_mm - (s_mm * s_mm - added_mm * added_mm).max(0.0).sqrt()
        };
        [u_mm / freedom.sqrt(), offset_mm]
    }

    /// (4), mm.
    pub fn repeatability_one_way_mm(&self, s_mm: f64) -> f64 {
        let [r, o] = self.of_scatter_mm(s_mm);
        4.0 * r.hypot(o)
    }

    /// (5) where both sides make R_i, mm.
    pub fn repeatability_mm(&self, up_mm: f64, down_mm: f64) -> f64 {
        let ([r, up], [_, down]) = (self.of_scatter_mm(up_mm), self.of_scatter_mm(down_mm));
        combined(&[
            2.0 * 2.0_f64.sqrt() * r,
            2.0 * (up + down),
            self.reversal_mm(),
        ])
    }

    /// (6), mm.
    pub fn systematic_mm(&self) -> f64 {
        self.length_mm.hypot((2.0 / self.n).sqrt() * self.drift_mm)
    }

    /// (7), mm.
    pub fn mean_systematic_mm(&self) -> f64 {
        self.length_mm.hypot((1.0 / self.n).sqrt() * self.drift_mm)
    }

    /// (8) of the standard deviations at both ends, mm.
    pub fn accuracy_mm(&self, ends_mm: [f64; 2]) -> f64 {
        let [[r, high], [_, low]] = ends_mm.map(|s_mm| self.of_scatter_mm(s_mm));
        combined(&[
            self.systematic_mm(),
            2.0 * r.hypot(high),
            2.0 * r.hypot(low),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq2_to_eq8_by_hand() {
        let mut parts = PositioningContributions {
            length_mm: 1000.0,
            device_mm: 0.002,
            alignment_mm: 0.001,
            machine_temperature_mm: 0.002,
            machine_expansion_mm: 0.0,
            device_temperature_mm: 0.0,
            device_expansion_mm: 0.004,
            drift_mm: 0.001,
            unrest_mm: None,
        };
        assert!((parts.length_part_mm() - 0.005).abs() < 1e-15);
        let near = |found: f64, by_hand: f64| assert!((found - by_hand).abs() < 1e-15, "{found}");
        let eight = parts.figures(8, 1);
        near(eight.reversal_mm(), 0.0005);
        near(eight.systematic_mm(), 25.25e-6_f64.sqrt());
        near(eight.mean_systematic_mm(), 25.125e-6_f64.sqrt());
        // n = 4: r² = 1/3, v² = 2/3; χ²(95 %, 3)/3 = 2.605, so that s² = 6 is a scatter of the machine: o = √6 − √(16/3).
        let four = parts.figures(4, 1);
        let s = 6e-6_f64.sqrt();
        let o = s - (16e-6_f64 / 3.0).sqrt();
        let scatter = 1e-6 / 3.0 + o * o;
        near(four.repeatability_one_way_mm(s), 4.0 * scatter.sqrt());
        let both = 4.0 * (2e-6 / 3.0 + 4.0 * o * o) + 0.5e-6;
        near(four.repeatability_mm(s, s), both.sqrt());
        near(four.accuracy_mm([s, s]), (25.5e-6 + 8.0 * scatter).sqrt());
        // s² = 2.6 can be drift alone: r² + o² = 1. So can s = 0.5, of which o cannot be more.
        near(four.repeatability_one_way_mm(2.6e-6_f64.sqrt()), 0.004);
        let little: f64 = 1e-6 / 3.0 + 0.25e-6;
        near(four.repeatability_one_way_mm(0.0005), 4.0 * little.sqrt());
        // The greatest of ten: χ²(95 %^(1/10), 3)/3 = 4.26, so s² = 4 can be drift alone.
        near(parts.figures(4, 10).repeatability_one_way_mm(0.002), 0.004);
        // Readings of one target from both sides are at most a quarter of the test apart: half of u_V.
        parts.unrest_mm = Some(0.0);
        near(parts.figures(4, 1).reversal_mm(), 0.0005);
        parts.unrest_mm = Some(0.0005);
        near(parts.figures(4, 1).reversal_mm(), 0.375e-6_f64.sqrt());
        parts.unrest_mm = Some(0.1);
        near(parts.figures(4, 1).reversal_mm(), 0.5e-6_f64.sqrt());
    }
}
