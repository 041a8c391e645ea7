//! Which figures of a bag conform to their limits (ISO 14253-1): `limits.yaml`, in µm.
//!
//! ```yaml
//! rule: guard_band                        # or simple, or {probability: {at_least: 0.95}}
//! limits:
//!   iso230_2.accuracy: {upper_um: 20.0}
//!   iso230_4.both.circular_error: {upper_um: 12.0}
//! ```
//!
//! A figure is named as `abbe report --json` has it below each test. Every test that has it is judged.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use metrology::iso230::ExpandedLength;
use metrology::iso230::conformance::{Decision, Policy, Specification, Verdict, decide};
use node_runtime::complaint;
use serde::Deserialize;
use serde_json::Value;

use crate::report::section::{Rows, Section, head, um};

/// `limits.yaml`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    rule: Policy,
    limits: BTreeMap<String, Limit>,
}

/// Limits of one figure; at least one.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Limit {
    lower_um: Option<f64>,
    upper_um: Option<f64>,
}

impl Limits {
    /// Reads the text of a file of limits; `place` names it in errors.
    ///
    /// # Errors
    /// With the key where one is missing or unknown, or where there is no limit at all.
    pub fn read(text: &str, place: &Path) -> Result<Self> {
        let place = place.display();
        let limits: Self = serde_saphyr::from_str(text).map_err(|error| {
            anyhow!("limits file {place}: {}", complaint::of_yaml(&error, text))
        })?;
        if limits.limits.is_empty() {
            bail!("limits file {place}: limits: must name one figure at least");
        }
        Ok(limits)
    }

    /// Judges the figures of all tests.
    ///
    /// # Errors
    /// When no test has a figure that is named, or its limits leave no zone.
    pub fn section(&self, tests: &[Value]) -> Result<Section> {
        let mut section = Section::new("Conformance, ISO 14253-1");
        let mut verdicts = Vec::new();
        let mut table = Rows {
            head: head(&["figure / µm", "test", "value", "limits", "decision", "P"]),
            note: format!(
                "{} P: probability that the true value is within its limits.",
                rule_in_words(self.rule)
            ),
            ..Rows::default()
        };
        for (name, limit) in &self.limits {
            let found: Vec<(&str, ExpandedLength)> = tests
                .iter()
                .filter_map(|test| Some((title(test), figure(test, name)?)))
                .collect();
            if found.is_empty() {
                let known: BTreeSet<String> = tests.iter().flat_map(names).collect();
                bail!("limits.{name}: no test has such a figure; there are {known:?}");
            }
            for (test, figure) in found {
                let verdict = decide(&figure, &limit.specification(), self.rule)
                    .with_context(|| format!("limits.{name}"))?;
                table.rows.push(row(name, test, limit, &verdict));
                verdicts
                    .push(serde_json::json!({ "figure": name, "test": test, "verdict": verdict }));
            }
        }
        section.tables.push(table);
        section.figures = verdicts.into();
        Ok(section)
    }
}

impl Limit {
    fn specification(self) -> Specification {
        let mm = |um: f64| um * 1e-3;
        Specification {
            lower_mm: self.lower_um.map(mm),
            upper_mm: self.upper_um.map(mm),
        }
    }
}

fn title(test: &Value) -> &str {
    test["test"].as_str().unwrap_or_default()
}

/// A length with its uncertainty, by the names on the way to it.
fn figure(test: &Value, name: &str) -> Option<ExpandedLength> {
    let pointer = format!("/{}", name.replace('.', "/"));
    length(test.pointer(&pointer)?)
}

/// A list of two numbers is no length with its uncertainty.
fn length(value: &Value) -> Option<ExpandedLength> {
    let entries = value.as_object()?.clone();
    serde_json::from_value(entries.into()).ok()
}

/// Names of all lengths with uncertainty that a test has, those of its single points left out.
fn names(test: &Value) -> Vec<String> {
    let Some(entries) = test.as_object() else {
        return Vec::new();
    };
    let below = |(name, value): (&String, &Value)| -> Vec<String> {
        if length(value).is_some() {
            return vec![name.clone()];
        }
        let further = names(value).into_iter();
        further.map(|rest| format!("{name}.{rest}")).collect()
    };
    entries.iter().flat_map(below).collect()
}

fn row(name: &str, test: &str, limit: &Limit, verdict: &Verdict) -> Vec<String> {
    let figure = verdict.figure;
    let limits = match (limit.lower_um, limit.upper_um) {
        (Some(lower), Some(upper)) => format!("{lower} to {upper}"),
        (Some(lower), None) => format!("≥ {lower}"),
        (None, Some(upper)) => format!("≤ {upper}"),
        (None, None) => String::new(),
    };
    let decision = match verdict.decision {
        Decision::Conforms => "conforms",
        Decision::DoesNotConform => "does not conform",
        Decision::CannotBeDecided => "cannot be decided",
    };
    vec![
        name.to_owned(),
        test.to_owned(),
        format!(
            "{} ± {}",
            um(figure.value_mm),
            um(figure.expanded_uncertainty_mm)
        ),
        limits,
        decision.to_owned(),
        format!("{:.3}", verdict.probability_of_conformance),
    ]
}

fn rule_in_words(rule: Policy) -> String {
    match rule {
        Policy::Simple => "The value alone decides.".to_owned(),
        Policy::GuardBand => {
            "A guard band of the expanded uncertainty (k = 2) on either side of a limit.".to_owned()
        }
        Policy::Probability { at_least } => format!("Decided with a probability of {at_least}."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(text: &str) -> Result<Limits> {
        Limits::read(text, Path::new("limits.yaml"))
    }

    fn tests() -> Vec<Value> {
        let length =
            |value: f64| serde_json::json!({"value_mm": value, "expanded_uncertainty_mm": 0.001});
        vec![
            serde_json::json!({"test": "X", "iso230_2": {"accuracy": length(0.0085), "n_runs": 5, "centre_mm": [0.1, 0.2], "up": {"accuracy": length(0.0095)}}}),
            serde_json::json!({"test": "Y", "iso230_2": {"accuracy": length(0.0115)}}),
        ]
    }

    #[test]
    fn a_guard_band_of_the_expanded_uncertainty_leaves_what_cannot_be_decided() {
        let text = "rule: guard_band\nlimits:\n  iso230_2.accuracy: {upper_um: 10.0}\n  iso230_2.up.accuracy: {upper_um: 10.0}\n";
        let section = limits(text).unwrap().section(&tests()).unwrap();
        let said: Vec<[&str; 3]> = section.tables[0]
            .rows
            .iter()
            .map(|row| [row[0].as_str(), row[1].as_str(), row[4].as_str()])
            .collect();
        assert_eq!(
            said,
            [
                ["iso230_2.accuracy", "X", "conforms"],
                ["iso230_2.accuracy", "Y", "does not conform"],
                ["iso230_2.up.accuracy", "X", "cannot be decided"],
            ]
        );
        assert_eq!(
            section.figures[1]["verdict"]["decision"],
            "does_not_conform"
        );
        assert_eq!(section.figures[0]["verdict"]["guard_band_mm"], 0.001);
    }

    #[test]
    fn what_no_test_has_and_what_is_no_zone_are_refused_by_name() {
        let refused = |text: &str| {
            let error = limits(text).and_then(|limits| limits.section(&tests()));
            format!("{:#}", error.unwrap_err())
        };
        let said = refused("rule: simple\nlimits:\n  iso230_2.acuracy: {upper_um: 10.0}\n");
        assert!(
            said.starts_with("limits.iso230_2.acuracy: no test has such a figure"),
            "{said}"
        );
        assert!(said.contains("\"iso230_2.up.accuracy\""), "{said}");
        assert!(!said.contains("centre_mm"), "{said}");
        let said =
            refused("rule: simple\nlimits:\n  iso230_2.accuracy: {lower_um: 3.0, upper_um: 2.0}\n");
        assert!(said.starts_with("limits.iso230_2.accuracy: "), "{said}");
        let said = refused("rule: simple\nlimits:\n  iso230_2.accuracy: {upper_um: lots}\n");
        let line = "in `iso230_2.accuracy: {upper_um: lots}`";
        assert!(said.ends_with(line), "{said}");
        let said = refused("rule: simple\nlimits: {}\n");
        assert!(said.contains("must name one figure at least"), "{said}");
        let said = refused(
            "rule: {probability: {at_least: 0.4}}\nlimits:\n  iso230_2.accuracy: {upper_um: 2.0}\n",
        );
        assert!(said.contains("0.4"), "{said}");
    }
}
