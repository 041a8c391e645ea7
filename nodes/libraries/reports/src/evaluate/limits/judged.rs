//! A figure of a test, a length or an angle, and what its limits say of it.

use anyhow::{Result, bail};
use iso230::conformance::{
    AngularSpecification, Decision, Policy, Specification, decide, decide_angle,
};
use iso230::{ExpandedAngle, ExpandedLength};
use serde_json::Value;

use super::Limit;
use crate::section::um;

/// A decision for a figure, in words.
pub const CONFORMS: &str = "conforms";

/// A figure with its uncertainty.
#[derive(Clone, Copy, Debug)]
pub(super) struct Figure {
    quantity: Quantity,
    /// Whether its uncertainty is known; where not, it is read as zero and nothing is decided.
    is_stated: bool,
}

#[derive(Clone, Copy, Debug)]
enum Quantity {
    Length(ExpandedLength),
    Angle(ExpandedAngle),
}

impl Figure {
    /// The figure of a test, by the names on the way to it.
    pub fn of(test: &Value, name: &str) -> Option<Self> {
        let pointer = format!("/{}", name.replace('.', "/"));
        Self::read(test.pointer(&pointer)?)
    }

    /// A list of two numbers is no figure with its uncertainty. One whose uncertainty is unknown has null for it.
    pub fn read(value: &Value) -> Option<Self> {
        let mut entries = value.as_object()?.clone();
        let mut is_stated = true;
        for key in ["expanded_uncertainty_mm", "expanded_uncertainty_rad"] {
            if let Some(unknown) = entries.get_mut(key).filter(|u| u.is_null()) {
                *unknown = 0.0.into();
                is_stated = false;
            }
        }
        let value: Value = entries.into();
        let length = serde_json::from_value(value.clone()).map(Quantity::Length);
        let quantity = length.or_else(|_| serde_json::from_value(value).map(Quantity::Angle));
        Some(Self {
            quantity: quantity.ok()?,
            is_stated,
        })
    }

    /// Why nothing is decided of an angle whose uncertainty is not stated; a test of lengths has its own reason.
    pub fn lacks(&self) -> Option<String> {
        let is_angle = matches!(self.quantity, Quantity::Angle(_));
        (is_angle && !self.is_stated).then(|| {
            "its uncertainty is not stated: angular_reference of the budget (--budget)".to_owned()
        })
    }
}

/// A figure and its verdict.
pub(super) struct Judged {
    figure: Figure,
    decision: Decision,
    probability: f64,
    /// For machines.
    pub verdict: Value,
}

impl Judged {
    /// Judges a figure by limits in its unit.
    ///
    /// # Errors
    /// Limits of another unit or without a zone.
    pub fn of(figure: Figure, limit: Limit, rule: Policy) -> Result<Self> {
        let has_um = limit.lower_um.is_some() || limit.upper_um.is_some();
        let has_arcsec = limit.lower_arcsec.is_some() || limit.upper_arcsec.is_some();
        let (decision, probability, verdict) = match figure.quantity {
            Quantity::Length(_) if has_arcsec => {
                bail!("is a length: lower_um and upper_um limit it, not seconds of arc")
            }
            Quantity::Angle(_) if has_um => {
                bail!("is an angle: lower_arcsec and upper_arcsec limit it, not µm")
            }
            Quantity::Length(length) => {
                let mm = |um: f64| um * 1e-3;
                let specification = Specification {
                    lower_mm: limit.lower_um.map(mm),
                    upper_mm: limit.upper_um.map(mm),
                };
                let found = decide(&length, &specification, rule)?;
                let probability = found.probability_of_conformance;
                (found.decision, probability, serde_json::to_value(found)?)
            }
            Quantity::Angle(angle) => {
                let rad = |arcsec: f64| (arcsec / 3600.0).to_radians();
                let specification = AngularSpecification {
                    lower_rad: limit.lower_arcsec.map(rad),
                    upper_rad: limit.upper_arcsec.map(rad),
                };
                let found = decide_angle(&angle, &specification, rule)?;
                let probability = found.probability_of_conformance;
                (found.decision, probability, serde_json::to_value(found)?)
            }
        };
        Ok(Self {
            figure,
            decision,
            probability,
            verdict,
        })
    }

    /// For the table of figures: name, test, value, limits, decision, probability.
    pub fn row(&self, (name, test): (&str, &str), limit: Limit, is_undecided: bool) -> Vec<String> {
        let ((value, expanded), unit) = match self.figure.quantity {
            Quantity::Length(length) => {
                let both = (um(length.value_mm), um(length.expanded_uncertainty_mm));
                (both, "µm")
            }
            Quantity::Angle(angle) => {
                let arcsec = |rad: f64| format!("{:.2}", rad.to_degrees() * 3600.0);
                let (value, expanded) = (angle.value_rad, angle.expanded_uncertainty_rad);
                ((arcsec(value), arcsec(expanded)), "arcsec")
            }
        };
        let lower = limit.lower_um.or(limit.lower_arcsec);
        let upper = limit.upper_um.or(limit.upper_arcsec);
        let limits = match (lower, upper) {
            (Some(lower), Some(upper)) => format!("{lower} to {upper} {unit}"),
            (Some(lower), None) => format!("≥ {lower} {unit}"),
            (None, Some(upper)) => format!("≤ {upper} {unit}"),
            (None, None) => String::new(),
        };
        let decision = match self.decision {
            _ if is_undecided => "not decided",
            Decision::Conforms => CONFORMS,
            Decision::DoesNotConform => "does not conform",
            Decision::CannotBeDecided => "cannot be decided",
        };
        let (value, probability) = if is_undecided {
            (format!("{value} {unit}"), "—".to_owned())
        } else {
            let value = format!("{value} ± {expanded} {unit}");
            (value, format!("{:.3}", self.probability))
        };
        vec![
            name.to_owned(),
            test.to_owned(),
            value,
            limits,
            decision.to_owned(),
            probability,
        ]
    }
}
