//! A figure of a test, a length or an angle, and what its limits say of it.

use anyhow::{Result, bail};
use iso230::conformance::{
    AngularSpecification, Decision, Policy, Specification, decide, decide_angle,
};
use iso230::{ExpandedAngle, ExpandedLength};
use metrology::number::quantity;
use serde_json::Value;

use super::limit::{Limit, NEVER_NEGATIVE};
use crate::positioning::shown_title;
use crate::section::um;

/// A decision for a figure, in words.
pub const CONFORMS: &str = "conforms";

/// Figures that may be negative, by the last part of their names.
const SIGNED: [&str; 3] = ["mean_reversal", "mean_radial_deviation", "size_error"];
/// An end of a range of deviations, which one limit is enough for.
const EXTREMES: [&str; 2] = ["greatest_radial_deviation", "least_radial_deviation"];

/// An upper limit below it is smaller than what any machine keeps, µm: mm were meant.
const LEAST_UPPER_UM: f64 = 0.1;

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
            Quantity::Length(_) | Quantity::Angle(_) if limit.lower.or(limit.upper).is_some() => {
                bail!(
                    "has a unit: lower_um and upper_um limit a length, lower_arcsec and upper_arcsec an angle"
                )
            }
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

    /// What is unlikely about limits of this figure: the kind of warning and its line.
    pub fn remarks(
        &self,
        name: &str,
        limit: Limit,
        is_decided: bool,
    ) -> Vec<(&'static str, String)> {
        let one_sided = self.lacks_lower(name, limit).filter(|_| is_decided);
        let one_sided = one_sided.map(|key| {
            let line = format!(
                "limits.{name}: the figure may be negative, and without {key} every value below the upper limit conforms: state {key} too."
            );
            ("Limited on one side", line)
        });
        one_sided
            .into_iter()
            .chain(self.too_small(name, limit))
            .collect()
    }

    /// An upper limit that no measurement of this figure can be held against.
    fn too_small(&self, name: &str, limit: Limit) -> Option<(&'static str, String)> {
        let Quantity::Length(length) = self.figure.quantity else {
            return None;
        };
        let last = name.rsplit('.').next().unwrap_or(name);
        let upper_um = limit.upper_um.filter(|_| NEVER_NEGATIVE.contains(&last))?;
        let expanded_um = length.expanded_uncertainty_mm * 1e3;
        let below = if upper_um < LEAST_UPPER_UM {
            format!("{LEAST_UPPER_UM} µm, what no machine keeps: state it in µm, not in mm")
        } else if upper_um < expanded_um {
            format!(
                "U = {} µm of the figure, so that no measurement shows that it conforms: measure with a smaller U, or state it in µm where it is in mm",
                um(length.expanded_uncertainty_mm)
            )
        } else {
            return None;
        };
        let line = format!(
            "limits.{name}.upper_um = {}: is below {below}.",
            quantity("upper_um", upper_um)
        );
        Some(("Limit too small", line))
    }

    /// Which limit is missing, where the figure may be negative and has an upper one alone: its key.
    fn lacks_lower(&self, name: &str, limit: Limit) -> Option<&'static str> {
        let (value, key, has_no_lower) = match self.figure.quantity {
            Quantity::Length(length) => (length.value_mm, "lower_um", limit.lower_um.is_none()),
            Quantity::Angle(angle) => (
                angle.value_rad,
                "lower_arcsec",
                limit.lower_arcsec.is_none(),
            ),
        };
        let last = name.rsplit('.').next().unwrap_or(name);
        let is_signed = SIGNED.contains(&last) || (value < 0.0 && !EXTREMES.contains(&last));
        (has_no_lower && is_signed).then_some(key)
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
            figure_in_words(name),
            shown_title(test),
            value,
            limits,
            decision.to_owned(),
            probability,
        ]
    }
}

/// What stands between the words of a figure and its standard.
pub const BEFORE_STANDARD: &str = ", ISO ";

/// The name of a figure in words with its standard: `up accuracy, ISO 230-2` of `iso230_2.up.accuracy`.
#[must_use]
pub fn figure_in_words(name: &str) -> String {
    let (family, own) = name.split_once('.').unwrap_or(("", name));
    let own = own.strip_prefix("figures.").unwrap_or(own);
    let own = own.replace(['_', '.'], " ");
    let mut parts = family.split('_');
    match (
        parts.next().and_then(|first| first.strip_prefix("iso")),
        parts.next(),
    ) {
        (Some(norm), Some(part)) => format!("{own}{BEFORE_STANDARD}{norm}-{part}"),
        _ => own,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::evaluate::limits::Limits;

    #[test]
    fn a_figure_has_words_and_the_number_of_its_standard() {
        for (name, words) in [
            ("iso230_2.accuracy", "accuracy, ISO 230-2"),
            ("iso230_2.up.mean_reversal", "up mean reversal, ISO 230-2"),
            (
                "iso230_2_rotary.figures.both.accuracy",
                "both accuracy, ISO 230-2",
            ),
            ("iso230_3_log.figures.range", "range, ISO 230-3"),
            ("own", "own"),
        ] {
            assert_eq!(super::figure_in_words(name), words);
        }
    }

    #[test]
    fn an_upper_limit_in_mm_or_below_u_is_named_with_value_limit_and_remedy() {
        let warned = |value_mm: f64, upper: &str| {
            let figure =
                serde_json::json!({"value_mm": value_mm, "expanded_uncertainty_mm": 0.000_8});
            let test = serde_json::json!({"test": "X", "iso230_2": {"accuracy": figure}});
            let text =
                format!("rule: simple\nlimits:\n  iso230_2.accuracy: {{upper_um: {upper}}}\n");
            let limits = Limits::read(&text, Path::new("limits.yaml")).unwrap();
            let section = limits.section(&[test]).unwrap();
            let lines = section.warnings.into_iter().map(|warning| warning.line);
            lines.collect::<Vec<_>>()
        };
        for (upper, below) in [
            ("0.020", "0.1 µm, what no machine keeps"),
            ("0.5", "U = 0.80 µm of the figure"),
        ] {
            let said = warned(0.012, upper);
            assert_eq!(said.len(), 1, "{said:?}");
            for words in [
                "limits.iso230_2.accuracy.upper_um = ",
                below,
                "state it in µm",
            ] {
                assert!(said[0].contains(words), "{words}: {said:?}");
            }
        }
        assert_eq!(warned(0.012, "20.0"), Vec::<String>::new());
    }

    #[test]
    fn a_figure_with_a_sign_and_an_upper_limit_alone_gives_a_remark() {
        let length = |value_mm: f64| serde_json::json!({"value_mm": value_mm, "expanded_uncertainty_mm": 0.000_5});
        let remarks = |figure: &str, value_mm: f64, limit: &str| {
            let test = serde_json::json!({"test": "X", "iso": {figure: length(value_mm)}});
            let text = format!("rule: simple\nlimits:\n  iso.{figure}: {limit}\n");
            let section = Limits::read(&text, Path::new("limits.yaml"))
                .unwrap()
                .section(&[test])
                .unwrap();
            let kinds = section.warnings.iter().map(|warning| warning.line.clone());
            kinds.collect::<Vec<_>>()
        };
        for (figure, value_mm) in [
            ("mean_reversal", -0.050),
            ("mean_reversal", 0.003),
            ("mean_radial_deviation", 0.001),
            ("size_error", -0.001),
            ("another", -0.001),
        ] {
            let said = remarks(figure, value_mm, "{upper_um: 5.0}");
            assert_eq!(said.len(), 1, "{figure} {value_mm}: {said:?}");
            for words in [figure, "may be negative", "state lower_um too"] {
                assert!(said[0].contains(words), "{said:?}");
            }
            let both = remarks(figure, value_mm, "{lower_um: -5.0, upper_um: 5.0}");
            assert!(both.is_empty(), "{both:?}");
            let lower = remarks(figure, value_mm, "{lower_um: -5.0}");
            assert!(lower.is_empty(), "{lower:?}");
        }
        for (figure, value_mm) in [
            ("accuracy", 0.004),
            ("reversal", 0.0),
            ("greatest_radial_deviation", -0.001),
            ("another", 0.001),
        ] {
            let said = remarks(figure, value_mm, "{upper_um: 5.0}");
            assert!(said.is_empty(), "{figure}: {said:?}");
        }
    }
}
