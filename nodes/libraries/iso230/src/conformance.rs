//! Whether a figure conforms to its specification, in view of its uncertainty (ISO 14253-1).
//!
//! # Model
//!
//! For a figure y with standard uncertainty u and limits L and H (either may be missing):
//!
//! ```text
//!   guard band U = k u, k = 2:  conforms      L + U ≤ y ≤ H − U
//!                               does not      y < L − U or y > H + U
//!                               undecided     between                                 (1)
//!   P = Φ[(H − y)/u] − Φ[(L − y)/u]           probability that the true value conforms (2)
//!   probability p:   conforms P ≥ p,  does not P ≤ 1 − p,  undecided between           (3)
//!   far limits:      (3) is (1) with the guard band Φ⁻¹(p) u;  1.645 u for p = 0.95    (4)
//! ```
//!
//! (1) is the rule of the editions before 2017, which take the whole expanded uncertainty on either
//! side. (3) with p = 0.95 is the default of the edition of 2017; its guard factor 1.65 is (4),
//! and holds where the zone is wide beside u. Here (2) itself is compared, which holds always.
//!
//! # Holds when
//! The true value is distributed normally about y with u, that is: nothing was known before.
//!
//! # Agreement
//! `val_iso14253_1_scipy_normal`: (2) below 5e-12, Φ⁻¹ below 1e-9.
//! `eq1_eq3_of_conformance_at_the_ends_of_their_zones`, by hand.
//!
//! # References
//! \[1\] ISO 14253-1:2013 and 2017; rules as the literature gives them, the texts were not at hand.
//! \[2\] JCGM 106:2012, 7.2 and 8.3.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use super::expanded::COVERAGE_FACTOR;
use super::extent::{check_finite, check_not_negative};
use super::{ExpandedAngle, ExpandedLength, Iso230Error};

/// Probability of the default rule of the edition of 2017.
pub const DEFAULT_PROBABILITY: f64 = 0.95;

/// Limits of a figure; at least one is given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Specification {
    /// Least value that conforms, mm.
    pub lower_mm: Option<f64>,
    /// Greatest value that conforms, mm.
    pub upper_mm: Option<f64>,
}

/// How uncertainty is taken into account.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Policy {
    /// Not at all: the figure alone decides, and there is always a decision.
    Simple,
    /// (1), the whole expanded uncertainty.
    #[schemars(
        description = "A guard band of the whole expanded uncertainty (k = 2) at each limit."
    )]
    GuardBand,
    /// (3).
    #[schemars(
        description = "Conforms where the true value is within its limits with this probability."
    )]
    Probability {
        /// p, above 0.5 and below 1.
        at_least: f64,
    },
}

/// What can be said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// It conforms.
    Conforms,
    /// It does not conform.
    DoesNotConform,
    /// Neither can be proven.
    CannotBeDecided,
}

/// A decision and what it rests on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The decision.
    pub decision: Decision,
    /// By which rule.
    pub policy: Policy,
    /// The figure.
    pub figure: ExpandedLength,
    /// Its limits.
    pub specification: Specification,
    /// Width of the guard band, mm; for a probability that of a far limit, (4).
    pub guard_band_mm: f64,
    /// P of (2).
    pub probability_of_conformance: f64,
}

/// Limits of an angle; at least one is given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngularSpecification {
    /// Least value that conforms, rad.
    pub lower_rad: Option<f64>,
    /// Greatest value that conforms, rad.
    pub upper_rad: Option<f64>,
}

/// A decision about an angle and what it rests on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AngularVerdict {
    /// The decision.
    pub decision: Decision,
    /// By which rule.
    pub policy: Policy,
    /// The figure.
    pub figure: ExpandedAngle,
    /// Its limits.
    pub specification: AngularSpecification,
    /// Width of the guard band, rad; for a probability that of a far limit, (4).
    pub guard_band_rad: f64,
    /// P of (2).
    pub probability_of_conformance: f64,
}

/// Decides about one figure.
///
/// # Errors
/// No limit or crossed ones, a probability that is no majority, numbers that cannot be used.
pub fn decide(
    figure: &ExpandedLength,
    specification: &Specification,
    policy: Policy,
) -> Result<Verdict, Iso230Error> {
    check_finite("figure.value_mm", 0, &[figure.value_mm])?;
    check_not_negative(
        "figure.expanded_uncertainty_mm",
        figure.expanded_uncertainty_mm,
    )?;
    let zone = Zone {
        lower: specification.lower_mm,
        upper: specification.upper_mm,
    };
    if !zone.has_room()? {
        return Err(Iso230Error::NoZone {
            lower_mm: zone.lower,
            upper_mm: zone.upper,
        });
    }
    let judged = zone.judged((figure.value_mm, figure.expanded_uncertainty_mm), policy)?;
    Ok(Verdict {
        decision: judged.decision,
        policy,
        figure: *figure,
        specification: *specification,
        guard_band_mm: judged.guard_band,
        probability_of_conformance: judged.probability,
    })
}

/// Decides about one angle.
///
/// # Errors
/// As [`decide`].
pub fn decide_angle(
    figure: &ExpandedAngle,
    specification: &AngularSpecification,
    policy: Policy,
) -> Result<AngularVerdict, Iso230Error> {
    check_finite("figure.value_rad", 0, &[figure.value_rad])?;
    check_not_negative(
        "figure.expanded_uncertainty_rad",
        figure.expanded_uncertainty_rad,
    )?;
    let zone = Zone {
        lower: specification.lower_rad,
        upper: specification.upper_rad,
    };
    if !zone.has_room()? {
        return Err(Iso230Error::NoAngularZone {
            lower_rad: zone.lower,
            upper_rad: zone.upper,
        });
    }
    let judged = zone.judged((figure.value_rad, figure.expanded_uncertainty_rad), policy)?;
    Ok(AngularVerdict {
        decision: judged.decision,
        policy,
        figure: *figure,
        specification: *specification,
        guard_band_rad: judged.guard_band,
        probability_of_conformance: judged.probability,
    })
}

/// Φ⁻¹(p) of (4).
///
/// # Errors
/// A probability that is not above 0.5 and below 1.
pub fn guard_factor(probability: f64) -> Result<f64, Iso230Error> {
    if probability > 0.5 && probability < 1.0 {
        return Ok(standard_normal().inverse_cdf(probability));
    }
    Err(Iso230Error::OutOfRange {
        place: "policy.probability.at_least",
        value: probability,
        lower: 0.5,
        upper: 1.0,
    })
}

/// Limits in the unit of their figure.
struct Zone {
    lower: Option<f64>,
    upper: Option<f64>,
}

/// What follows for a figure, in its unit.
struct Judged {
    decision: Decision,
    guard_band: f64,
    probability: f64,
}

impl Zone {
    /// Whether there is a limit, and the lower one below the upper one.
    fn has_room(&self) -> Result<bool, Iso230Error> {
        let given = [self.lower, self.upper];
        let limits: Vec<f64> = given.into_iter().flatten().collect();
        check_finite("specification", 0, &limits)?;
        Ok(match limits[..] {
            [_] => true,
            [lower, upper] => lower < upper,
            _ => false,
        })
    }

    fn judged(&self, (value, expanded): (f64, f64), policy: Policy) -> Result<Judged, Iso230Error> {
        let u = expanded / COVERAGE_FACTOR;
        let probability = self.probability(value, u);
        let (decision, guard_band) = match policy {
            Policy::Simple => (self.guarded(value, 0.0), 0.0),
            Policy::GuardBand => (self.guarded(value, expanded), expanded),
            Policy::Probability { at_least } => {
                let factor = guard_factor(at_least)?;
                let decision = match probability {
                    p if p >= at_least => Decision::Conforms,
                    p if p <= 1.0 - at_least => Decision::DoesNotConform,
                    _ => Decision::CannotBeDecided,
                };
                (decision, factor * u)
            }
        };
        Ok(Judged {
            decision,
            guard_band,
            probability,
        })
    }

    /// (1); with no guard band there is nothing between.
    fn guarded(&self, value: f64, guard: f64) -> Decision {
        let lower = self.lower.unwrap_or(f64::NEG_INFINITY);
        let upper = self.upper.unwrap_or(f64::INFINITY);
        if value >= lower + guard && value <= upper - guard {
            Decision::Conforms
        } else if value < lower - guard || value > upper + guard {
            Decision::DoesNotConform
        } else {
            Decision::CannotBeDecided
        }
    }

    /// (2).
    fn probability(&self, value: f64, u: f64) -> f64 {
        if u == 0.0 {
            let inside = self.guarded(value, 0.0) == Decision::Conforms;
            return f64::from(u8::from(inside));
        }
        let normal = standard_normal();
        let over_upper = self
            .upper
            .map_or(0.0, |upper| normal.sf((upper - value) / u));
        let under_lower = self
            .lower
            .map_or(0.0, |lower| normal.cdf((lower - value) / u));
        (1.0 - over_upper - under_lower).max(0.0)
    }
}

fn standard_normal() -> Normal {
    Normal::standard()
}
