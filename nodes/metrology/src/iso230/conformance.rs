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

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use super::extent::{check_finite, check_not_negative};
use super::{ExpandedLength, Iso230Error};

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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Policy {
    /// Not at all: the figure alone decides, and there is always a decision.
    Simple,
    /// (1), the whole expanded uncertainty.
    GuardBand,
    /// (3).
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
    specification.check()?;
    let probability_of_conformance = specification.probability(figure);
    let (decision, guard_band_mm) = match policy {
        Policy::Simple => (specification.guarded(figure.value_mm, 0.0), 0.0),
        Policy::GuardBand => {
            let guard_mm = figure.expanded_uncertainty_mm;
            (specification.guarded(figure.value_mm, guard_mm), guard_mm)
        }
        Policy::Probability { at_least } => {
            let factor = guard_factor(at_least)?;
            let decision = match probability_of_conformance {
                p if p >= at_least => Decision::Conforms,
                p if p <= 1.0 - at_least => Decision::DoesNotConform,
                _ => Decision::CannotBeDecided,
            };
            (decision, factor * figure.standard_uncertainty_mm())
        }
    };
    Ok(Verdict {
        decision,
        policy,
        figure: *figure,
        specification: *specification,
        guard_band_mm,
        probability_of_conformance,
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

impl Specification {
    fn check(&self) -> Result<(), Iso230Error> {
        let given = [self.lower_mm, self.upper_mm];
        let limits: Vec<f64> = given.into_iter().flatten().collect();
        check_finite("specification", 0, &limits)?;
        match limits[..] {
            [_] => Ok(()),
            [lower, upper] if lower < upper => Ok(()),
            _ => Err(Iso230Error::NoZone {
                lower_mm: self.lower_mm,
                upper_mm: self.upper_mm,
            }),
        }
    }

    /// (1); with no guard band there is nothing between.
    fn guarded(&self, value_mm: f64, guard_mm: f64) -> Decision {
        let lower_mm = self.lower_mm.unwrap_or(f64::NEG_INFINITY);
        let upper_mm = self.upper_mm.unwrap_or(f64::INFINITY);
        if value_mm >= lower_mm + guard_mm && value_mm <= upper_mm - guard_mm {
            Decision::Conforms
        } else if value_mm < lower_mm - guard_mm || value_mm > upper_mm + guard_mm {
            Decision::DoesNotConform
        } else {
            Decision::CannotBeDecided
        }
    }

    /// (2).
    fn probability(&self, figure: &ExpandedLength) -> f64 {
        let u_mm = figure.standard_uncertainty_mm();
        if u_mm == 0.0 {
            let inside = self.guarded(figure.value_mm, 0.0) == Decision::Conforms;
            return f64::from(u8::from(inside));
        }
        let normal = standard_normal();
        let above = |limit_mm: f64| normal.sf((limit_mm - figure.value_mm) / u_mm);
        let over_upper = self.upper_mm.map_or(0.0, above);
        let under_lower = self.lower_mm.map_or(0.0, |limit_mm| {
            normal.cdf((limit_mm - figure.value_mm) / u_mm)
        });
        (1.0 - over_upper - under_lower).max(0.0)
    }
}

fn standard_normal() -> Normal {
    Normal::standard()
}
