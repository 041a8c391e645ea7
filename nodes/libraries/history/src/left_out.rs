//! The account of a report or diagnosis: figures that are there without a finite number, and are therefore not kept.

use serde_json::Value;

/// Deepest level below a test that is looked at, as for the figures that are kept.
const DEEPEST: usize = 12;
/// Keys of a quantity's value and of its expanded uncertainty.
const LIMITED_QUANTITIES: [(&str, &str); 2] = [
    ("value_mm", "expanded_uncertainty_mm"),
    ("value_rad", "expanded_uncertainty_rad"),
];

/// A figure that cannot be kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Title of its test; empty: a figure of the run.
    pub test: String,
    /// Its name with the key of its value.
    pub name: String,
    /// What stands there; JSON has null for NaN and for an infinity.
    pub value: String,
}

/// Figures of a report or of a diagnosis whose value is no finite number; coefficients that are not determined have none and
/// are not listed.
#[must_use]
pub fn left_out(report: &Value) -> Vec<LeftOut> {
    let mut all = Vec::new();
    for test in report["tests"].as_array().into_iter().flatten() {
        let title = test["test"].as_str().unwrap_or_default();
        below(test, title, "", 0, &mut all);
        coefficients(&test["geometry"], title, &mut all);
    }
    for (name, location) in report["location_errors"].as_object().into_iter().flatten() {
        if location["estimable"] != Value::Bool(false) {
            let name = format!("location.{name}.value");
            take(location.get("value"), "", &name, &mut all);
        }
    }
    take(report.get("latency_s"), "", "latency_s", &mut all);
    let sizes = if report["schema"] == "abbe.gap/1" {
        &report["gap"]
    } else {
        &report["gap"]["gap"]
    };
    for key in ["rms_um", "p95_um", "floor_um"] {
        take(sizes.get(key), "Diagnosis", &format!("gap.{key}"), &mut all);
    }
    all
}

/// Quantities at or below a value.
fn below(value: &Value, test: &str, name: &str, depth: usize, all: &mut Vec<LeftOut>) {
    let Some(entries) = value.as_object().filter(|_| depth < DEEPEST) else {
        return;
    };
    let is_quantity = |(value, expanded): &&(&str, &str)| {
        entries.contains_key(*value) && entries.contains_key(*expanded)
    };
    if let Some((key, expanded)) = LIMITED_QUANTITIES.iter().find(is_quantity) {
        take(entries.get(*key), test, &format!("{name}.{key}"), all);
        // A null is an uncertainty that was not stated.
        if entries.get(*expanded).is_some_and(|value| !value.is_null()) {
            take(
                entries.get(*expanded),
                test,
                &format!("{name}.{expanded}"),
                all,
            );
        }
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

/// The coefficients that a model determines.
fn coefficients(model: &Value, test: &str, all: &mut Vec<LeftOut>) {
    let deviation = "residual_standard_deviation_mm";
    take(
        model.get(deviation),
        test,
        &format!("geometry.{deviation}"),
        all,
    );
    for coefficient in model["coefficients"].as_array().into_iter().flatten() {
        let Some(name) = coefficient["name"].as_str() else {
            continue;
        };
        if coefficient["estimable"] != Value::Bool(false) {
            let name = format!("geometry.{name}.value");
            take(coefficient.get("value"), test, &name, all);
        }
    }
}

/// Lists what is there and no finite number.
fn take(value: Option<&Value>, test: &str, name: &str, all: &mut Vec<LeftOut>) {
    let Some(value) = value else { return };
    if value.as_f64().is_some_and(f64::is_finite) {
        return;
    }
    let text: String = value.to_string().chars().take(60).collect();
    all.push(LeftOut {
        test: test.to_owned(),
        name: name.to_owned(),
        value: text,
    });
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn names(report: &Value) -> Vec<String> {
        left_out(report).into_iter().map(|it| it.name).collect()
    }

    #[test]
    fn figures_without_a_finite_number_are_listed_and_those_with_one_are_not() {
        for value in [
            json!(null),
            json!("NaN"),
            json!("inf"),
            json!([1.0]),
            json!(true),
        ] {
            let quantity = json!({"value_mm": value, "expanded_uncertainty_mm": 0.001});
            let good = json!({"value_mm": 0.002, "expanded_uncertainty_mm": null});
            let report = json!({
                "tests": [{"test": "X", "iso230_2": {"accuracy": quantity, "reversal": good},
                    "geometry": {"residual_standard_deviation_mm": value, "coefficients": [
                        {"name": "EXX1", "estimable": true, "value": value},
                        {"name": "EXX2", "estimable": false, "value": null},
                        {"name": "EC0Y", "value": 1e-5}]}}],
                "latency_s": value,
                "location_errors": {"EA0C": {"value": value}, "EB0C": {"estimable": false, "value": null}},
                "gap": {"gap": {"rms_um": value, "p95_um": 1.0}},
            });
            let wanted = [
                "iso230_2.accuracy.value_mm",
                "geometry.residual_standard_deviation_mm",
                "geometry.EXX1.value",
                "location.EA0C.value",
                "latency_s",
                "gap.rms_um",
            ];
            assert_eq!(names(&report), wanted, "{value}");
            let gap = json!({"schema": "abbe.gap/1", "gap": {"rms_um": 1.0, "floor_um": value}});
            assert_eq!(names(&gap), ["gap.floor_um"], "{value}");
        }
    }

    #[test]
    fn a_report_without_such_figures_has_none() {
        assert_eq!(names(&json!({})), Vec::<String>::new());
        assert_eq!(
            names(&json!({"tests": [], "gap": null})),
            Vec::<String>::new()
        );
        assert_eq!(names(&json!(5)), Vec::<String>::new());
    }

    #[test]
    fn an_uncertainty_that_is_no_number_is_listed() {
        let quantity = json!({"value_rad": 1e-5, "expanded_uncertainty_rad": "NaN"});
        let report = json!({"tests": [{"test": "C", "accuracy": quantity}]});
        assert_eq!(names(&report), ["accuracy.expanded_uncertainty_rad"]);
    }
}
