//! The figures of a diagnosis, `abbe.gap/1`: the gap before and after, the share closed, and each parameter of each cause.
//!
//! A cause that a diagnosis does not name has no figure there: it is not zero.

use serde_json::Value;

use crate::entry::Figure;
use crate::error::HistoryError;
use crate::report_figures::empty;

/// Title under which the figures of a diagnosis stand.
const TEST: &str = "Diagnosis";
/// Half of a 95 % interval over the standard uncertainty, of a normal distribution.
const NORMAL_95: f64 = 1.959_964;
/// µm to mm.
const UM_MM: f64 = 1e-3;

/// A diagnosis.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// SHA-256 of each bag, in order.
    pub bags: Vec<String>,
    /// SHA-256 of the machine file.
    pub machine_sha256: Option<String>,
    /// What it was made with beside the bags, which distinguishes diagnoses of the same bags: machine file, bags of a simulator,
    /// effects and rules that were left out.
    pub made_with: String,
    /// The figures.
    pub figures: Vec<Figure>,
}

/// The figures of a diagnosis with the hashes of its inputs.
///
/// # Errors
/// When it is no `abbe.gap/1`.
pub fn gap_figures(gap: &Value) -> Result<Gap, HistoryError> {
    if gap["schema"] != "abbe.gap/1" {
        return Err(HistoryError::NoReport);
    }
    let bags = gap["inputs"]["bags"].as_array().into_iter().flatten();
    let hashes = bags.filter_map(|bag| bag["sha256"].as_str());
    let machine = gap["inputs"]["machine_sha256"].as_str();
    Ok(Gap {
        bags: hashes.map(str::to_owned).collect(),
        machine_sha256: machine.filter(|hash| !hash.is_empty()).map(str::to_owned),
        made_with: made_with(gap),
        figures: of(gap),
    })
}

/// The texts of a list.
fn texts<'g>(list: &'g Value, key: Option<&str>) -> Vec<&'g str> {
    let all = list.as_array().into_iter().flatten();
    let text = |one: &'g Value| key.map_or(one, |key| &one[key]).as_str();
    all.filter_map(text).collect()
}

fn made_with(gap: &Value) -> String {
    let made = &gap["made_with"];
    let machine = gap["inputs"]["machine_sha256"].as_str().unwrap_or_default();
    let lists = [
        (
            "simulated",
            texts(&gap["simulated"]["bags"], Some("sha256")),
        ),
        ("without", texts(&made["without"], None)),
        ("ablated", texts(&made["ablated"], None)),
    ];
    let mut text = format!("machine {machine}");
    for (key, mut all) in lists {
        all.sort_unstable();
        all.dedup();
        text.push_str(&format!("; {key} {}", all.join(",")));
    }
    text
}

/// The title of a diagnosis: what it was made with distinguishes its series. Bags of a simulator differ from test to test.
fn title(gap: &Value) -> String {
    let mut title = TEST.to_owned();
    if gap["simulated"].is_object() {
        title.push_str(", against the bags of a simulator");
    }
    let made = &gap["made_with"];
    for (key, words) in [("without", "without"), ("ablated", "without the rule")] {
        let mut all = texts(&made[key], None);
        all.sort_unstable();
        all.dedup();
        if !all.is_empty() {
            title.push_str(&format!(", {words} {}", all.join(" and ")));
        }
    }
    title
}

/// The figures of a diagnosis.
pub(crate) fn of(gap: &Value) -> Vec<Figure> {
    let mut all = Vec::new();
    let (size, shrink) = (&gap["gap"], &gap["shrink"]);
    for (name, value) in [
        ("gap.rms", &size["rms_um"]),
        ("gap.p95", &size["p95_um"]),
        ("gap.floor", &size["floor_um"]),
        ("gap.rms_before", &shrink["rms_um"]["before"]),
        ("gap.rms_after", &shrink["rms_um"]["after"]),
    ] {
        all.extend(value.as_f64().map(|um| Figure {
            name: name.to_owned(),
            value: um * UM_MM,
            unit: "mm".to_owned(),
            ..figure()
        }));
    }
    let closed = with_interval("gap.closed", &shrink["gap_closed"]);
    all.extend(closed);
    for cause in gap["causes"].as_array().into_iter().flatten() {
        all.extend(cause_figures(cause));
    }
    let title = title(gap);
    for figure in &mut all {
        title.clone_into(&mut figure.test);
    }
    all
}

fn cause_figures(cause: &Value) -> Vec<Figure> {
    let Some(effect) = cause["effect"].as_str() else {
        return Vec::new();
    };
    let parameters = cause["parameters"].as_array().into_iter().flatten();
    let of = |parameter: &Value| {
        let name = parameter["name"].as_str()?;
        Some(Figure {
            axis: cause["axis"].as_str().unwrap_or_default().to_owned(),
            unit: unit_of(name).to_owned(),
            status: cause["status"].as_str().unwrap_or_default().to_owned(),
            ..with_interval(&format!("effect.{effect}.{name}"), parameter)?
        })
    };
    parameters.filter_map(of).collect()
}

fn figure() -> Figure {
    Figure {
        test: TEST.to_owned(),
        ..empty()
    }
}

/// A value with `low` and `high`; an end that is missing leaves the uncertainty unknown.
fn with_interval(name: &str, value: &Value) -> Option<Figure> {
    let ends = value["low"].as_f64().zip(value["high"].as_f64());
    let interval = ends.map(|(low, high)| [low, high]);
    Some(Figure {
        name: name.to_owned(),
        value: value["value"].as_f64()?,
        standard_uncertainty: interval.map(|[low, high]| (high - low) / (2.0 * NORMAL_95)),
        interval,
        ..figure()
    })
}

/// The unit that a parameter's name ends with: everything from the first known unit on; empty where there is none.
fn unit_of(name: &str) -> &str {
    const UNITS: [&str; 12] = [
        "um", "urad", "mrad", "arcsec", "ms", "us", "s", "k", "mm", "n", "hz", "deg",
    ];
    let mut parts = name.split('_').collect::<Vec<_>>();
    let mut from = name.len();
    let mut unit = "";
    while let Some(part) = parts.pop() {
        from -= part.len();
        let is_unit = UNITS.contains(&part) || part == "per" || is_denominator(part);
        if !is_unit || parts.is_empty() {
            break;
        }
        if part != "per" {
            unit = &name[from..];
        }
        from = from.saturating_sub(1);
    }
    unit
}

/// `m`, `s2`, `mm2`: denominators that no parameter begins with.
fn is_denominator(part: &str) -> bool {
    ["m", "s2", "mm2", "min", "rpm"].contains(&part)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_diagnosis_gives_gap_share_and_causes_with_their_intervals() {
        let gap = json!({
            "schema": "abbe.gap/1",
            "inputs": {"bags": [{"sha256": "ab"}], "machine_sha256": "cd"},
            "gap": {"rms_um": 4.0, "p95_um": 8.0, "floor_um": 1.0},
            "shrink": {"rms_um": {"before": 4.0, "after": null}, "gap_closed": {"value": 0.9, "low": 0.8, "high": 0.95}},
            "causes": [{"effect": "backlash", "axis": "X", "status": "named",
                        "parameters": [{"name": "width_um", "value": 6.0, "low": 5.0, "high": 7.0}]}],
        });
        let read = gap_figures(&gap).unwrap();
        assert_eq!(
            (read.bags, read.machine_sha256.as_deref()),
            (vec!["ab".to_owned()], Some("cd"))
        );
        let names: Vec<&str> = read.figures.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "gap.rms",
                "gap.p95",
                "gap.floor",
                "gap.rms_before",
                "gap.closed",
                "effect.backlash.width_um"
            ]
        );
        assert!((read.figures[0].value - 0.004).abs() < 1e-15);
        let play = read.figures.last().unwrap();
        assert_eq!(
            (play.axis.as_str(), play.unit.as_str(), play.status.as_str()),
            ("X", "um", "named")
        );
        // Half of 2 µm over 1.96.
        assert!((play.standard_uncertainty.unwrap() - 0.510_213).abs() < 1e-6);
        assert_eq!(play.interval, Some([5.0, 7.0]));
    }

    #[test]
    fn the_unit_of_a_parameter_ends_its_name() {
        for (name, unit) in [
            ("width_um", "um"),
            ("expansion_um_per_m_k", "um_per_m_k"),
            ("value_um_per_m", "um_per_m"),
            ("time_constant_s", "s"),
            ("ratio", ""),
            ("um", ""),
        ] {
            assert_eq!(unit_of(name), unit, "{name}");
        }
    }

    #[test]
    fn what_a_diagnosis_was_made_with_tells_it_and_its_series_apart() {
        let gap = |more: Value| {
            let mut gap = json!({
                "schema": "abbe.gap/1", "gap": {"rms_um": 4.0},
                "inputs": {"bags": [{"sha256": "ab"}], "machine_sha256": "cd"},
            });
            for (key, value) in more.as_object().unwrap() {
                gap[key] = value.clone();
            }
            let read = gap_figures(&gap).unwrap();
            (read.made_with, read.figures[0].test.clone())
        };
        let (plain, title) = gap(json!({}));
        assert_eq!(title, "Diagnosis");
        let mut keys = vec![plain];
        for (more, wanted) in [
            (
                json!({"simulated": {"bags": [{"sha256": "01"}]}}),
                "Diagnosis, against the bags of a simulator",
            ),
            (
                json!({"simulated": {"bags": [{"sha256": "02"}]}}),
                "Diagnosis, against the bags of a simulator",
            ),
            (
                json!({"made_with": {"without": ["backlash"]}}),
                "Diagnosis, without backlash",
            ),
            (
                json!({"made_with": {"without": ["pitch", "backlash"], "ablated": ["constancy"]}}),
                "Diagnosis, without backlash and pitch, without the rule constancy",
            ),
            (
                json!({"made_with": {"ablated": ["constancy"]}}),
                "Diagnosis, without the rule constancy",
            ),
            (
                json!({"inputs": {"bags": [{"sha256": "ab"}], "machine_sha256": "ce"}}),
                "Diagnosis",
            ),
        ] {
            let (key, title) = gap(more);
            assert_eq!(title, wanted);
            assert!(!keys.contains(&key), "{key}");
            keys.push(key);
        }
    }

    #[test]
    fn another_schema_is_refused() {
        assert!(gap_figures(&json!({"schema": "abbe.gap/2"})).is_err());
        assert!(gap_figures(&json!([])).is_err());
    }
}
