//! The figures of a report, as `abbe report --json` and `report.json` of a run have them.
//!
//! Taken are quantities with an expanded uncertainty below each test, by the names that `limits.yaml` uses; determined
//! coefficients and standard deviations of geometric models; latency, location of rotary axes and tool error of a run; and the
//! figures of a diagnosis under `gap`. Single points of a test are left out.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use crate::conditions::with_conditions;
use crate::entry::Figure;
use crate::error::HistoryError;
use crate::gap_figures;

/// Coverage factor of expanded uncertainties in reports.
const COVERAGE_FACTOR: f64 = 2.0;
/// Deepest level below a test that is looked at.
const DEEPEST: usize = 12;
/// Quantities with uncertainty: key of value and of expanded uncertainty, unit.
const QUANTITIES: [(&str, &str, &str); 2] = [
    ("value_mm", "expanded_uncertainty_mm", "mm"),
    ("value_rad", "expanded_uncertainty_rad", "rad"),
];

/// The figures of a report; each test, name and axis once.
///
/// # Errors
/// When the text is no such report.
pub fn report_figures(report: &Value) -> Result<Vec<Figure>, HistoryError> {
    let entries = report.as_object().ok_or(HistoryError::NoReport)?;
    let of_run = ["latency_s", "tool_error_in_blocks_span", "location_errors"];
    let is_report = entries.get("tests").is_some_and(Value::is_array)
        || entries.contains_key("gap")
        || of_run.iter().any(|key| entries.contains_key(*key));
    if !is_report {
        return Err(HistoryError::NoReport);
    }
    let mut all = Vec::new();
    for test in entries
        .get("tests")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
    {
        let title = steady_title(test["test"].as_str().unwrap_or_default());
        let title = with_conditions(&title, test);
        below(test, &title, "", 0, &mut all);
        geometry(&test["geometry"], &title, &mut all);
    }
    of_a_run(entries, &mut all);
    if let Some(gap) = entries
        .get("gap")
        .filter(|gap| gap.get("refused").is_none())
    {
        all.extend(gap_figures::of(gap));
    }
    Ok(each_once(all))
}

/// Quantities at or below a value.
fn below(value: &Value, test: &str, name: &str, depth: usize, all: &mut Vec<Figure>) {
    let Some(entries) = value.as_object().filter(|_| depth < DEEPEST) else {
        return;
    };
    if let Some(mut figure) = quantity(entries) {
        test.clone_into(&mut figure.test);
        name.clone_into(&mut figure.name);
        all.push(figure);
        return;
    }
    for (key, entry) in entries {
        let name = if name.is_empty() {
            key.clone()
        } else {
            format!("{name}.{key}")
        };
        below(entry, test, &name, depth + 1, all);
    }
}

fn quantity(entries: &Map<String, Value>) -> Option<Figure> {
    let of = |(value, expanded, unit): &(&str, &str, &str)| {
        let value = entries.get(*value)?.as_f64()?;
        let expanded = entries.get(*expanded)?.as_f64();
        Some(Figure {
            value,
            unit: (*unit).to_owned(),
            standard_uncertainty: expanded.map(|expanded| expanded / COVERAGE_FACTOR),
            ..empty()
        })
    };
    QUANTITIES.iter().find_map(of)
}

/// The coefficients that a model determines.
fn geometry(model: &Value, test: &str, all: &mut Vec<Figure>) {
    let deviation = &model["residual_standard_deviation_mm"];
    let figure = plain("geometry.residual_standard_deviation_mm", deviation, "mm");
    all.extend(figure.map(|figure| Figure {
        test: test.to_owned(),
        ..figure
    }));
    for coefficient in model["coefficients"].as_array().into_iter().flatten() {
        let Some(name) = coefficient["name"].as_str() else {
            continue;
        };
        // A polynomial's coefficients are per length to its power, a table's and a constant's are not: the name has the power.
        let figure = plain(
            &format!("geometry.{name}"),
            &coefficient["value"],
            unit(name),
        );
        all.extend(figure.map(|figure| Figure {
            test: test.to_owned(),
            standard_uncertainty: coefficient["standard_uncertainty"].as_f64(),
            ..figure
        }));
    }
}

/// Unit of a coefficient of ISO 230-1, such as `EXX1` or `EC0Y`.
fn unit(name: &str) -> &'static str {
    let mut letters = name.strip_prefix('E').unwrap_or_default().chars();
    let is_angular = letters
        .next()
        .is_some_and(|direction| "ABC".contains(direction));
    let rest = name.get(2..).unwrap_or_default();
    let power = rest.trim_start_matches(|c: char| c == '0' || c.is_ascii_alphabetic());
    let is_plain = power.is_empty() || rest.contains(" at ");
    match (is_angular, is_plain) {
        (true, true) => "rad",
        (false, true) => "mm",
        // Its own unit: mm or rad per mm to its power.
        (_, false) => "",
    }
}

/// Figures of a run beside those of its tests.
fn of_a_run(entries: &Map<String, Value>, all: &mut Vec<Figure>) {
    let at = |key: &str| entries.get(key).unwrap_or(&Value::Null);
    all.extend(
        plain("latency_s", at("latency_s"), "s").map(|figure| Figure {
            test: "Latency of the probe".to_owned(),
            standard_uncertainty: at("latency_standard_uncertainty_s").as_f64(),
            ..figure
        }),
    );
    for (name, location) in at("location_errors").as_object().into_iter().flatten() {
        if location["estimable"] == Value::Bool(false) {
            continue;
        }
        let figure = plain(&format!("location.{name}"), &location["value"], unit(name));
        all.extend(figure.map(|figure| Figure {
            test: "Location of the rotary axes".to_owned(),
            standard_uncertainty: location["standard_uncertainty"].as_f64(),
            ..figure
        }));
    }
    for pair in ["without_compensation", "with_compensation"] {
        let of_pair = at("tool_error_in_blocks_span")[pair].as_object();
        for (key, value) in of_pair.into_iter().flatten() {
            if key.ends_with("_mm") {
                let figure = plain(&format!("tool_error.{pair}.{key}"), value, "mm");
                all.extend(figure.map(|figure| Figure {
                    test: "Tool error in the blocks' span".to_owned(),
                    ..figure
                }));
            }
        }
    }
}

fn plain(name: &str, value: &Value, unit: &str) -> Option<Figure> {
    Some(Figure {
        name: name.to_owned(),
        value: value.as_f64()?,
        unit: unit.to_owned(),
        ..empty()
    })
}

/// A figure without name and value.
pub(crate) const fn empty() -> Figure {
    Figure {
        test: String::new(),
        name: String::new(),
        axis: String::new(),
        value: 0.0,
        unit: String::new(),
        standard_uncertainty: None,
        interval: None,
        status: String::new(),
    }
}

/// A title without the numbers of its runs, which differ between repetitions of one test: `, run 3 on` or `, runs 3 and 4`.
fn steady_title(title: &str) -> String {
    let Some((before, rest)) = title.split_once(", run") else {
        return title.to_owned();
    };
    let rest = rest.strip_prefix('s').unwrap_or(rest);
    let numbers = rest.trim_start_matches(|c: char| c == ' ' || c.is_ascii_digit());
    if numbers.len() == rest.len() || !rest.starts_with(' ') {
        return title.to_owned();
    }
    let mut rest = numbers;
    while let Some(more) = rest.strip_prefix("and ") {
        rest = more.trim_start_matches(|c: char| c == ' ' || c.is_ascii_digit());
    }
    let rest = rest.strip_prefix("on").unwrap_or(rest);
    let joined = format!("{before}{rest}");
    joined.trim_end().to_owned()
}

/// Figures of one test, name and axis that come again get a number.
fn each_once(figures: Vec<Figure>) -> Vec<Figure> {
    let mut seen: BTreeMap<(String, String, String), usize> = BTreeMap::new();
    let mut all = Vec::with_capacity(figures.len());
    for mut figure in figures {
        let key = (
            figure.test.clone(),
            figure.name.clone(),
            figure.axis.clone(),
        );
        let times = seen.entry(key).or_default();
        *times += 1;
        if *times > 1 {
            figure.test = format!("{} ({times})", figure.test);
        }
        all.push(figure);
    }
    all
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn quantities_have_the_names_of_limits_and_half_their_expanded_uncertainty() {
        let length = |value: f64| json!({"value_mm": value, "expanded_uncertainty_mm": 0.004});
        let report = json!({"tests": [
            {"test": "Positioning X, run 3 on: not compensated, by the laser",
             "iso230_2": {"accuracy": length(0.0085), "n_runs": 5, "up": {"accuracy": length(0.0095)},
                          "points": [{"mean": length(0.1)}], "reversal": {"value_mm": 0.002, "expanded_uncertainty_mm": null}}},
            {"test": "C", "iso230_2_rotary": {"figures": {"both": {"accuracy": {"value_rad": 1e-5, "expanded_uncertainty_rad": 2e-6}}}}},
        ]});
        let figures = report_figures(&report).unwrap();
        let mut seen: Vec<(&str, &str, f64, Option<f64>)> = figures
            .iter()
            .map(|f| {
                (
                    f.name.as_str(),
                    f.unit.as_str(),
                    f.value,
                    f.standard_uncertainty,
                )
            })
            .collect();
        seen.sort_by_key(|(name, ..)| *name);
        assert_eq!(
            seen,
            [
                ("iso230_2.accuracy", "mm", 0.0085, Some(0.002)),
                ("iso230_2.reversal", "mm", 0.002, None),
                ("iso230_2.up.accuracy", "mm", 0.0095, Some(0.002)),
                (
                    "iso230_2_rotary.figures.both.accuracy",
                    "rad",
                    1e-5,
                    Some(1e-6)
                ),
            ]
        );
        assert_eq!(
            figures[0].test,
            "Positioning X: not compensated, by the laser"
        );
    }

    #[test]
    fn titles_lose_the_numbers_of_their_runs_alone() {
        for (title, steady) in [
            (
                "Thermal drift of X, run 12, ISO 230-3: spindle",
                "Thermal drift of X, ISO 230-3: spindle",
            ),
            (
                "Circle XY, R 100.000 mm, runs 3 and 4: compensated",
                "Circle XY, R 100.000 mm: compensated",
            ),
            (
                "Circle XY, runs 3 and 4 and 15: compensated",
                "Circle XY: compensated",
            ),
            (
                "Positioning X, run 3 on: by the scale",
                "Positioning X: by the scale",
            ),
            ("Wear, running in", "Wear, running in"),
            ("Space diagonals, ISO 230-6", "Space diagonals, ISO 230-6"),
        ] {
            assert_eq!(steady_title(title), steady);
        }
    }

    #[test]
    fn a_test_that_comes_twice_gets_a_number() {
        let test = json!({"test": "Circle XY, run 1: compensated", "iso230_4": {"circular_error": {"value_mm": 0.01, "expanded_uncertainty_mm": null}}});
        let mut again = test.clone();
        again["test"] = "Circle XY, run 7: compensated".into();
        let figures = report_figures(&json!({"tests": [test, again]})).unwrap();
        let titles: Vec<&str> = figures.iter().map(|f| f.test.as_str()).collect();
        assert_eq!(
            titles,
            ["Circle XY: compensated", "Circle XY: compensated (2)"]
        );
    }

    #[test]
    fn models_and_runs_give_what_they_determine() {
        let report = json!({
            "tests": [{"test": "Geometric errors", "geometry": {"residual_standard_deviation_mm": 0.0004, "coefficients": [
                {"name": "EC0Y", "estimable": true, "value": 2e-5, "standard_uncertainty": 1e-6},
                {"name": "EXX1", "estimable": true, "value": 3e-5, "standard_uncertainty": 1e-6},
                {"name": "EXX2", "estimable": false, "value": null, "standard_uncertainty": null}]}}],
            "latency_s": 0.0012, "latency_standard_uncertainty_s": 2e-6,
            "location_errors": {"EA0C": {"value": 1e-5, "standard_uncertainty": 1e-6, "estimable": true}},
            "tool_error_in_blocks_span": {"without_compensation": {"change_since_cold_p95_mm": 0.02, "poses": 40, "label": "off"}},
            "gap": {"refused": "nothing was repeated"},
        });
        let figures = report_figures(&report).unwrap();
        let seen: Vec<(&str, &str)> = figures
            .iter()
            .map(|f| (f.name.as_str(), f.unit.as_str()))
            .collect();
        assert_eq!(
            seen,
            [
                ("geometry.residual_standard_deviation_mm", "mm"),
                ("geometry.EC0Y", "rad"),
                ("geometry.EXX1", ""),
                ("latency_s", "s"),
                ("location.EA0C", "rad"),
                (
                    "tool_error.without_compensation.change_since_cold_p95_mm",
                    "mm"
                ),
            ]
        );
    }

    #[test]
    fn what_is_no_report_is_refused() {
        for text in [
            "[]",
            "1",
            "{}",
            "{\"tests\": 3}",
            "{\"schema\": \"abbe.check/1\"}",
        ] {
            let value: Value = serde_json::from_str(text).unwrap();
            assert!(
                matches!(report_figures(&value), Err(HistoryError::NoReport)),
                "{text}"
            );
        }
    }
}
