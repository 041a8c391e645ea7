//! Which figures of a bag conform to their limits (ISO 14253-1): `limits.yaml`, lengths in µm, angles in
//! seconds of arc.
//!
//! ```yaml
//! rule: guard_band                        # or simple, or {probability: {at_least: 0.95}}
//! limits:
//!   iso230_2.accuracy: {upper_um: 20.0}
//!   iso230_4.both.circular_error: {upper_um: 12.0}
//!   iso230_2_rotary.figures.both.accuracy: {upper_arcsec: 8.0}
//! ```
//!
//! A figure is named as `abbe report --json` has it below each test. Every test that has it is judged, but those that cannot
//! be: lengths that are not those at 20 °C, and what the machine's own scale read.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use iso230::conformance::Policy;
use metrology::number::number;
use metrology::yaml;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;

pub mod alarms;
mod judged;
mod limit;
pub mod of_axis;
pub mod webhook;

use crate::section::{Rows, Section, head};
use crate::terminal::Rank;
use judged::{BEFORE_STANDARD, Figure, Judged};
pub use judged::{CONFORMS, figure_in_words};
use limit::Limit;
use webhook::Webhook;

/// `limits.yaml`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// How the uncertainty of a figure is taken into account.
    rule: Policy,
    /// Limits by the name of a figure, as `abbe report --json` has it below each test.
    limits: BTreeMap<String, Limit>,
    /// Limits of single machines, by the machine's name and then as `limits`; they take the place of those of all.
    #[serde(default)]
    machines: BTreeMap<String, BTreeMap<String, Limit>>,
    /// Where alarms of a history are sent as JSON (POST): http://HOST:PORT/PATH.
    webhook: Option<String>,
}

/// Begins of the names of figures that a history has and no test of a report: they are no mistake, and judged with the history.
const OF_HISTORY: [&str; 6] = [
    "effect.",
    "gap.",
    "geometry.",
    "latency_s",
    "location.",
    "tool_error.",
];

/// A probability of no more decides nothing.
const LEAST_PROBABILITY: f64 = 0.5;

impl Limits {
    /// Reads the text of a file of limits; `place` names it in errors.
    ///
    /// # Errors
    /// With the key where one is missing or unknown, or where there is no limit at all.
    pub fn read(text: &str, place: &Path) -> Result<Self> {
        let place = place.display();
        let limits: Self =
            yaml::read(text).map_err(|error| anyhow!("limits file {place}:{error}"))?;
        let file = place.to_string();
        let wrong = |message: &str| anyhow!("limits file {}", yaml::placed(&file, text, message));
        if limits.limits.is_empty() && limits.machines.values().all(BTreeMap::is_empty) {
            return Err(wrong("limits: must name one figure at least"));
        }
        limits.check().map_err(|message| wrong(&message))?;
        Ok(limits)
    }

    /// Refuses limits that no figure can be held against: key, value, limit, remedy.
    fn check(&self) -> Result<(), String> {
        if let Policy::Probability { at_least } = self.rule
            && !(at_least > LEAST_PROBABILITY && at_least < 1.0)
        {
            return Err(format!(
                "rule.probability.at_least = {}: must be above {LEAST_PROBABILITY} and below 1, such as 0.95",
                number(at_least)
            ));
        }
        let mut limits = self.limits.iter();
        limits.try_for_each(|(name, limit)| limit.check(&format!("limits.{name}")))?;
        let machines = self.machines.iter();
        let mut own = machines.flat_map(|(machine, limits)| {
            let place = move |name: &String| format!("machines.{machine}.{name}");
            limits.iter().map(move |(name, limit)| (place(name), limit))
        });
        own.try_for_each(|(place, limit)| limit.check(&place))?;
        self.webhook().map(|_| ())
    }

    /// Where alarms are sent, where that is wanted.
    ///
    /// # Errors
    /// Why nothing can be sent there; never of limits that were read.
    pub fn webhook(&self) -> Result<Option<Webhook>, String> {
        self.webhook.as_deref().map(Webhook::read).transpose()
    }

    /// The limits of one machine: its own, and those of all that it has none for.
    #[must_use]
    pub fn of_machine(mut self, machine: Option<&str>) -> Self {
        if let Some(own) = machine.and_then(|machine| self.machines.get(machine)) {
            // A machine's own limit of a figure holds for every axis.
            self.limits
                .retain(|name, _| !own.contains_key(of_axis::parted(name).0));
            self.limits
                .extend(own.iter().map(|(name, limit)| (name.clone(), *limit)));
        }
        self
    }

    /// Judges the figures of all tests.
    ///
    /// # Errors
    /// When no test has a figure that is named, or its limits leave no zone.
    pub fn section(&self, tests: &[Value]) -> Result<Section> {
        let mut section = Section::new("Conformance, ISO 14253-1").ranked(Rank::Answer);
        let mut verdicts = Vec::new();
        let mut remarks = BTreeSet::new();
        let mut table = Rows {
            head: head(&["figure", "test", "value", "limits", "decision", "P"]),
            note: format!(
                "{} P: probability that the true value is within its limits.",
                rule_in_words(self.rule)
            ),
            ..Rows::default()
        };
        for (name, limit) in self.limits.iter().filter(|(name, _)| is_of_tests(name)) {
            let found = self.found(name, tests)?;
            let (name, place) = (of_axis::parted(name).0, name);
            for (test, figure) in found {
                let judged = Judged::of(figure, *limit, self.rule)
                    .with_context(|| format!("limits.{place}"))?;
                let why = no_verdict(test, name).or_else(|| figure.lacks());
                let deviations = deviations(test, name);
                let mut row = judged.row((name, title(test)), *limit, why.is_some());
                if !deviations.is_empty() && why.is_none() {
                    row[DECISION].push_str(WITH_DEVIATIONS);
                }
                table.rows.push(row);
                remarks.extend(judged.remarks(name, *limit, why.is_none()));
                let mut entry = serde_json::json!({ "figure": name, "test": title(test) });
                if let Some(why) = why {
                    let about = format!("{name}, {}", title(test));
                    section.warn(
                        "Nothing is decided",
                        format!("{about}: nothing is decided, {why}."),
                    );
                    entry["verdict"] = Value::Null;
                    entry["no_verdict"] = why.into();
                } else {
                    entry["verdict"] = judged.verdict;
                    entry["deviations_from_iso230_2"] = deviations.into();
                }
                verdicts.push(entry);
            }
        }
        for (kind, line) in remarks {
            section.warn(kind, line);
        }
        conclude(&mut section, table, verdicts);
        Ok(section)
    }
}

/// Whether a name is that of a figure of a test.
fn is_of_tests(name: &str) -> bool {
    !OF_HISTORY.iter().any(|begin| name.starts_with(begin))
}

/// Adds the decisions, or the reason why none is made.
fn conclude(section: &mut Section, table: Rows, verdicts: Vec<Value>) {
    if table.rows.is_empty() {
        let line = "Nothing is judged: the limits name no figure of these tests, only those of other axes or of a history.";
        section.warn("Nothing is judged", line.to_owned());
        return;
    }
    section.answers.push(in_short(&table.rows));
    section.tables.push(table);
    section.figures = verdicts.into();
}

/// Figures by test.
type ByTest<'r> = BTreeMap<&'r str, Vec<String>>;

/// The decisions of a table of figures in one sentence, failures first; each figure that does not conform is named.
fn in_short(rows: &[Vec<String>]) -> String {
    let mut by_decision: BTreeMap<(bool, Reverse<&str>), ByTest<'_>> = BTreeMap::new();
    for row in rows {
        if let [figure, test, _, _, decision, ..] = row.as_slice() {
            let key = (decision.starts_with(CONFORMS), Reverse(decision.as_str()));
            let of_decision = by_decision.entry(key).or_default();
            let test = test.split(": ").next().unwrap_or(test);
            let figure = figure.split(BEFORE_STANDARD).next().unwrap_or(figure);
            of_decision.entry(test).or_default().push(figure.to_owned());
        }
    }
    let counts = by_decision.iter().map(|((_, decision), tests)| {
        let n: usize = tests.values().map(Vec::len).sum();
        if decision.0 == CONFORMS {
            return format!("{}: {n}", decision.0);
        }
        let named = tests.iter();
        let named = named.map(|(test, figures)| format!("{} of {test}", figures.join(", ")));
        let named: Vec<String> = named.collect();
        format!("{}: {n} ({})", decision.0, named.join("; "))
    });
    let counts: Vec<String> = counts.collect();
    format!("{}. Figures judged: {}.", counts.join("; "), rows.len())
}

fn title(test: &Value) -> &str {
    test["test"].as_str().unwrap_or_default()
}

/// Figures of circles that are lengths from the nominal radius.
const RADIAL: [&str; 3] = [
    "mean_radial_deviation",
    "greatest_radial_deviation",
    "least_radial_deviation",
];

/// Place of the decision in a row of the table.
const DECISION: usize = 4;
/// What a decision of a test has that was not made by the programme of the standard.
const WITH_DEVIATIONS: &str = ", with deviations from ISO 230-2";

/// How the test of a figure of ISO 230-2 deviates from the programme of the standard.
fn deviations(test: &Value, name: &str) -> Vec<Value> {
    let (of_positioning, _) = name.split_once('.').unwrap_or((name, ""));
    let remarks = test[of_positioning]["remarks"].as_array();
    let is_of_standard = of_positioning.starts_with("iso230_2");
    { remarks.into_iter().flatten() }
        .filter(|_| is_of_standard)
        .cloned()
        .collect()
}

/// Names what of the decisions no certificate supports; `conditions` are those of the report.
pub fn state_traceability(section: &mut Section, conditions: &Value) {
    let without = |entry: &&Value| {
        let certificate = entry["certificate"].as_str().unwrap_or("none");
        certificate.trim().eq_ignore_ascii_case("none")
    };
    let instruments = conditions["instruments"].as_array();
    let names = { instruments.into_iter().flatten() }
        .filter(without)
        .filter_map(|entry| entry["kind"].as_str())
        .map(|kind| kind.replace('_', " "));
    let names: Vec<String> = names.collect();
    if !names.is_empty()
        && section
            .figures
            .as_array()
            .is_some_and(|all| has_verdict(all))
    {
        section.warn(
            "Traceability is not stated",
            format!(
                "Traceability is not stated: {} without a certificate (instruments in budget.yaml); the decisions rest on the uncertainty that the budget states.",
                names.join(", ")
            ),
        );
    }
}

fn has_verdict(entries: &[Value]) -> bool {
    entries.iter().any(|entry| !entry["verdict"].is_null())
}

/// Why nothing is decided about a figure of a test; none: it is decided.
fn no_verdict(test: &Value, name: &str) -> Option<String> {
    let last = name.rsplit('.').next().unwrap_or(name);
    let key = match last {
        radial if RADIAL.contains(&radial) => "no_verdict_on_radii",
        "size_error" => "no_verdict_on_size",
        _ => "no_verdict",
    };
    test[key].as_str().map(str::to_owned)
}

/// Names of all figures with uncertainty that a test has, those of its single points left out.
fn names(test: &Value) -> Vec<String> {
    let Some(entries) = test.as_object() else {
        return Vec::new();
    };
    let below = |(name, value): (&String, &Value)| -> Vec<String> {
        if Figure::read(value).is_some() {
            return vec![name.clone()];
        }
        let further = names(value).into_iter();
        further.map(|rest| format!("{name}.{rest}")).collect()
    };
    entries.iter().flat_map(below).collect()
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

    #[test]
    fn limits_that_no_figure_can_be_held_against_are_refused_with_place_value_and_remedy() {
        let of = |limit: &str| {
            let text = format!("rule: simple\nlimits:\n  iso230_2.accuracy: {limit}\n");
            format!("{:#}", limits(&text).unwrap_err())
        };
        for key in ["lower_um", "upper_um", "lower_arcsec", "upper_arcsec"] {
            for value in [".nan", ".inf", "-.inf", "1e25", "-1e300"] {
                let said = of(&format!("{{{key}: {value}}}"));
                let begin = "limits file limits.yaml:3:";
                assert!(said.starts_with(begin), "{key} {value}: {said}");
                let place = format!("limits.iso230_2.accuracy.{key} = ");
                assert!(said.contains(&place), "{key} {value}: {said}");
                assert!(said.contains("must be from -"), "{key} {value}: {said}");
            }
        }
        for (limit, words) in [
            (
                "{lower_um: 5.0, upper_um: 4.0}",
                "lower_um = 5 µm: must be below upper_um = 4 µm",
            ),
            ("{lower_um: 5.0, upper_um: 5.0}", "must be below"),
            (
                "{lower_arcsec: 5.0, upper_arcsec: -4.0}",
                "must be below upper_arcsec",
            ),
            (
                "{upper_um: -20.0}",
                "accuracy.upper_um = -20 µm: must be above 0",
            ),
            ("{upper_um: 0.0}", "must be above 0"),
            ("{}", "has no limit: state lower_um"),
            ("{upper_um: 5.0, upper_arcsec: 4.0}", "in µm and in arcsec"),
        ] {
            let said = of(limit);
            assert!(said.contains(words), "{limit}: {said}");
        }
        for at_least in [".nan", ".inf", "0.5", "1.0", "-1.0", "1e300"] {
            let text = format!(
                "rule: {{probability: {{at_least: {at_least}}}}}\nlimits:\n  a.b: {{upper_um: 1.0}}\n"
            );
            let said = format!("{:#}", limits(&text).unwrap_err());
            assert!(said.contains("rule.probability.at_least = "), "{said}");
            assert!(said.contains("above 0.5 and below 1"), "{said}");
        }
    }

    #[test]
    fn a_decision_says_how_its_test_deviates_and_which_instrument_has_no_certificate() {
        let text = "rule: simple\nlimits:\n  iso230_2.accuracy: {upper_um: 10.0}\n";
        let mut all = tests();
        all[0]["iso230_2"]["remarks"] =
            serde_json::json!([{"kind": "few_runs", "n_runs": 3, "required": 5}]);
        let mut section = limits(text).unwrap().section(&all).unwrap();
        let of = |row: usize| section.tables[0].rows[row][DECISION].clone();
        assert_eq!(of(0), "conforms, with deviations from ISO 230-2");
        assert_eq!(of(1), "does not conform");
        let deviations = &section.figures[0]["deviations_from_iso230_2"];
        assert_eq!(deviations[0]["kind"], "few_runs");
        assert!(section.answers[0].contains("accuracy of X"));
        let conditions = |certificate: Value| {
            serde_json::json!({"instruments": [
                {"kind": "length_reference", "certificate": certificate},
                {"kind": "touch_probe", "certificate": "K 7 of 2026-01-02"},
            ]})
        };
        state_traceability(&mut section, &conditions("K 8 of 2026-01-02".into()));
        assert!(section.warnings.is_empty());
        for none in [Value::Null, "none".into()] {
            let mut section = limits(text).unwrap().section(&all).unwrap();
            state_traceability(&mut section, &conditions(none));
            let line = &section.warnings[0].line;
            assert!(line.contains("length reference without"), "{line}");
        }
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
    fn failures_come_first_and_figures_are_grouped_by_their_test() {
        let row = |figure: &str, test: &str, decision: &str| {
            [figure, test, "", "", decision].map(str::to_owned).to_vec()
        };
        let x = "Positioning X, run 3 on: not compensated, by the length reference";
        let rows = [
            row("accuracy, ISO 230-2", x, "cannot be decided"),
            row("repeatability, ISO 230-2", x, "does not conform"),
            row("up mean reversal, ISO 230-2", x, "does not conform"),
            row("accuracy, ISO 230-2", "Y", CONFORMS),
        ];
        assert_eq!(
            in_short(&rows),
            "does not conform: 2 (repeatability, up mean reversal of Positioning X, run 3 on); cannot be decided: 1 (accuracy of Positioning X, run 3 on); conforms: 1. Figures judged: 4."
        );
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
                ["accuracy, ISO 230-2", "X", "conforms"],
                ["accuracy, ISO 230-2", "Y", "does not conform"],
                ["up accuracy, ISO 230-2", "X", "cannot be decided"],
            ]
        );
        assert_eq!(
            section.figures[1]["verdict"]["decision"],
            "does_not_conform"
        );
        assert_eq!(section.figures[0]["verdict"]["guard_band_mm"], 0.001);
    }

    #[test]
    fn nothing_is_decided_of_lengths_that_are_not_those_at_20_degc() {
        let length =
            |value: f64| serde_json::json!({"value_mm": value, "expanded_uncertainty_mm": 0.001});
        let why = "not corrected to 20 °C: no budget was given (--budget)";
        let all = vec![
            serde_json::json!({"test": "X", "iso230_2": {"accuracy": length(0.0085)}, "no_verdict": why}),
            serde_json::json!({"test": "Y", "iso230_2": {"accuracy": {"value_mm": 0.0115, "expanded_uncertainty_mm": null}}, "no_verdict": "read by the machine's scale"}),
            serde_json::json!({"test": "circle", "no_verdict_on_radii": why, "iso230_4": {"mean_radial_deviation": length(0.001), "circular_error": length(0.001)}}),
        ];
        let text = "rule: guard_band\nlimits:\n  iso230_2.accuracy: {upper_um: 10.0}\n  iso230_4.mean_radial_deviation: {upper_um: 10.0}\n  iso230_4.circular_error: {upper_um: 10.0}\n";
        let section = limits(text).unwrap().section(&all).unwrap();
        let decisions: Vec<&str> = section.tables[0]
            .rows
            .iter()
            .map(|row| row[4].as_str())
            .collect();
        let none = "not decided";
        assert_eq!(decisions, [none, none, "conforms", none], "{section:?}");
        assert!(section.figures[0]["verdict"].is_null());
        assert_eq!(section.figures[0]["no_verdict"], why);
        assert!(section.lines[0].contains(why), "{:?}", section.lines);
        assert_eq!(section.lines.len(), 3, "{:?}", section.lines);
    }

    #[test]
    fn nothing_is_decided_of_a_size_that_is_not_that_at_20_degc() {
        let length = serde_json::json!({"value_mm": 0.001, "expanded_uncertainty_mm": 0.000_5});
        let why = "not corrected to 20 °C: the artefact's temperature is not stated";
        let probing = serde_json::json!({"test": "spheres", "no_verdict_on_size": why, "iso230_10_errors": [{"size_error": length, "probing_error": length}]});
        let text = "rule: guard_band\nlimits:\n  iso230_10_errors.0.probing_error: {upper_um: 2.0}\n  iso230_10_errors.0.size_error: {upper_um: 2.0}\n";
        let section = limits(text).unwrap().section(&[probing]).unwrap();
        assert_eq!(section.figures[0]["verdict"]["decision"], "conforms");
        assert!(section.figures[1]["verdict"].is_null());
        assert_eq!(section.figures[1]["no_verdict"], why);
    }

    #[test]
    fn radii_of_a_circle_at_20_degc_are_judged() {
        let length = serde_json::json!({"value_mm": 0.001, "expanded_uncertainty_mm": 0.000_5});
        let circle = serde_json::json!({"test": "circle", "no_verdict_on_radii": null, "iso230_4": {"mean_radial_deviation": length}});
        let text = "rule: guard_band\nlimits:\n  iso230_4.mean_radial_deviation: {upper_um: 2.0}\n";
        let section = limits(text).unwrap().section(&[circle]).unwrap();
        assert_eq!(section.figures[0]["verdict"]["decision"], "conforms");
    }

    #[test]
    fn an_angle_is_judged_in_seconds_of_arc_by_hand() {
        // With U = 1.5'' against 6'': 4 + 1.5 < 6 conforms; 5 + 1.5 > 6 > 5 - 1.5 is open; 8 - 1.5 > 6 does not.
        let arcsec = |arcsec: f64| (arcsec / 3600.0).to_radians();
        let test = |value: f64| {
            serde_json::json!({"test": format!("C {value}"), "iso230_2_rotary": {"figures": {"both": {
            "accuracy": {"value_rad": arcsec(value), "expanded_uncertainty_rad": arcsec(1.5)}}}}})
        };
        let text = "rule: guard_band\nlimits:\n  iso230_2_rotary.figures.both.accuracy: {upper_arcsec: 6.0}\n";
        let all = [test(4.0), test(5.0), test(8.0)];
        let section = limits(text).unwrap().section(&all).unwrap();
        let rows = &section.tables[0].rows;
        let said: Vec<[&str; 3]> = rows
            .iter()
            .map(|row| [2, 3, 4].map(|i| row[i].as_str()))
            .collect();
        assert_eq!(
            said,
            [
                ["4.00 ± 1.50 arcsec", "≤ 6 arcsec", "conforms"],
                ["5.00 ± 1.50 arcsec", "≤ 6 arcsec", "cannot be decided"],
                ["8.00 ± 1.50 arcsec", "≤ 6 arcsec", "does not conform"],
            ]
        );
        let guard_rad = section.figures[0]["verdict"]["guard_band_rad"]
            .as_f64()
            .unwrap();
        assert!((guard_rad - arcsec(1.5)).abs() < 1e-18);
    }

    #[test]
    fn a_limit_in_the_wrong_unit_and_an_angle_without_uncertainty_are_told() {
        let angle = serde_json::json!({"value_rad": 1e-5, "expanded_uncertainty_rad": null});
        let tests = [serde_json::json!({"test": "C", "iso230_2_rotary": {"accuracy": angle}})];
        let of = |limit: &str| {
            let text = format!("rule: guard_band\nlimits:\n  iso230_2_rotary.accuracy: {limit}\n");
            limits(&text).unwrap().section(&tests)
        };
        let wrong = format!("{:#}", of("{upper_um: 6.0}").unwrap_err());
        assert!(
            wrong.contains("is an angle: lower_arcsec and upper_arcsec"),
            "{wrong}"
        );
        let section = of("{upper_arcsec: 6.0}").unwrap();
        assert!(section.figures[0]["verdict"].is_null(), "{section:?}");
        assert!(
            section.lines[0].contains("angular_reference"),
            "{:?}",
            section.lines
        );
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
        assert!(
            said.contains("limits.iso230_2.accuracy.lower_um = "),
            "{said}"
        );
        let said = refused("rule: simple\nlimits:\n  iso230_2.accuracy: {upper_um: lots}\n");
        let line =
            "limits.yaml:3:33: limits.iso230_2.accuracy.upper_um = lots: must be a number, in µm";
        assert!(said.ends_with(line), "{said}");
        let said = refused("rule: simple\nlimits: {}\n");
        assert!(said.contains("must name one figure at least"), "{said}");
        let said = refused(
            "rule: {probability: {at_least: 0.4}}\nlimits:\n  iso230_2.accuracy: {upper_um: 2.0}\n",
        );
        assert!(said.contains("0.4"), "{said}");
    }
}
