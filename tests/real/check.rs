//! Compares what the program printed with what is right.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::expected::{Diagnose, Figure, Follow, Must, Report};

/// Largest difference from numpy, µm or arcsec: rounding of sums.
const NUMPY_WITHIN: f64 = 1e-6;
/// Seconds of arc of a radian.
const ARCSEC_PER_RAD: f64 = 648_000.0 / std::f64::consts::PI;

/// One comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Check {
    /// Its name, which `known_wrong` uses.
    pub name: String,
    /// Whether it holds.
    pub holds: bool,
    /// The value that was found, in words.
    pub found: String,
}

impl Check {
    /// A comparison with what was found.
    pub fn new(name: impl Into<String>, holds: bool, found: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            holds,
            found: found.into(),
        }
    }
}

/// The exit code and words of a command.
pub fn ended(name: &str, exit: [Option<i32>; 2], says: &[String], text: &str) -> Vec<Check> {
    let [wanted, found] = exit;
    let code = found.map_or("a signal".to_owned(), |code| code.to_string());
    let exit = Check::new(format!("{name} exit"), wanted == found, code);
    let words = says.iter().map(|words| {
        let holds = text.contains(words.as_str());
        let found = if holds { "in the text" } else { "absent" };
        Check::new(format!("{name} \"{words}\""), holds, found)
    });
    std::iter::once(exit).chain(words).collect()
}

/// The evaluated tests of a kind in a `report.json`, in their order.
fn tests<'r>(report: &'r Value, key: &str) -> Vec<&'r Value> {
    let all = report["tests"].as_array().into_iter().flatten();
    all.filter_map(|test| test.get(key)).collect()
}

/// A figure of a test in µm or arcsec, counts as they are; `None`: not there or `null`.
fn figure(test: &Value, key: &str, name: &str) -> Option<f64> {
    match name {
        "runs" => return number(test, &["/n_runs", "/figures/n_runs"]),
        "targets" => {
            let points = test
                .get("points")
                .or_else(|| test.pointer("/figures/points"));
            let mut at: Vec<String> = { points?.as_array()?.iter() }
                .map(|point| {
                    [&point["target_mm"], &point["target_rad"]]
                        .map(Value::to_string)
                        .concat()
                })
                .collect();
            // A rotary axis has a point for each side of a target.
            at.sort();
            at.dedup();
            return u32::try_from(at.len()).ok().map(f64::from);
        }
        _ => {}
    }
    if key == "iso230_4" {
        return number(test, &[&format!("{}/value_mm", of_circle(name)?)]).map(|mm| 1e3 * mm);
    }
    let (letter, side) = name.split_once('_').unwrap_or((name, ""));
    let quantity = match letter {
        "A" => "accuracy",
        "R" => "repeatability",
        "E" => "systematic_error",
        "M" => "mean_systematic_error",
        "B" if side == "mean" => "mean_reversal",
        "B" => "reversal",
        _ => name,
    };
    let side = if side == "mean" { "" } else { side };
    let place = match (key, side) {
        ("iso230_2", "up" | "down") => format!("/{side}/{quantity}"),
        ("iso230_2", _) => format!("/{quantity}"),
        ("iso230_2_rotary", "up" | "down") => format!("/figures/{side}/{quantity}"),
        ("iso230_2_rotary", _) => format!("/figures/both/{quantity}"),
        _ => format!("/figures/{quantity}"),
    };
    let linear = number(test, &[&format!("{place}/value_mm")]).map(|mm| 1e3 * mm);
    let angular = || number(test, &[&format!("{place}/value_rad")]);
    linear.or_else(|| angular().map(|rad| rad * ARCSEC_PER_RAD))
}

/// Where a figure of a circle stands.
fn of_circle(name: &str) -> Option<&'static str> {
    match name {
        "G_ccw" => Some("/counter_clockwise/circular_error"),
        "G_cw" => Some("/clockwise/circular_error"),
        "G" => Some("/both/circular_error"),
        "D" => Some("/both/mean_radial_deviation"),
        "H" => Some("/both/hysteresis_1996"),
        _ => None,
    }
}

fn number(value: &Value, places: &[&str]) -> Option<f64> {
    let mut found = places.iter().filter_map(|place| value.pointer(place));
    found.next().and_then(Value::as_f64)
}

fn compared(name: String, found: Option<f64>, wanted: Option<f64>, within: f64) -> Check {
    let holds = match (found, wanted) {
        (Some(found), Some(wanted)) => (found - wanted).abs() <= within,
        (None, None) => true,
        _ => false,
    };
    let found = found.map_or("no figure".to_owned(), |found| format!("{found:.2}"));
    Check::new(name, holds, found)
}

/// The figures of a `report.json` against the right ones and against numpy's.
pub fn figures(
    of: &str,
    wanted: &Report,
    numpy: &[BTreeMap<String, Option<f64>>],
    report: &Value,
) -> Vec<Check> {
    let found = tests(report, &wanted.test);
    let stated = wanted.figures.iter().map(|(name, right)| {
        let value = found.first().and_then(|t| figure(t, &wanted.test, name));
        compared(
            format!("{of} {name}"),
            value,
            Some(right.value),
            right.within,
        )
    });
    let mut checks: Vec<Check> = stated.collect();
    if !numpy.is_empty() {
        let words = format!("{} evaluated", found.len());
        let holds = found.len() == numpy.len();
        checks.push(Check::new(format!("{of} tests"), holds, words));
    }
    for (k, figures) in numpy.iter().enumerate() {
        let number = if numpy.len() > 1 {
            format!(" {}", k + 1)
        } else {
            String::new()
        };
        checks.extend(figures.iter().map(|(name, right)| {
            let value = found.get(k).and_then(|t| figure(t, &wanted.test, name));
            compared(
                format!("{of} numpy{number} {name}"),
                value,
                *right,
                NUMPY_WITHIN,
            )
        }));
    }
    checks
}

/// A cause as `backlash X`.
fn cause_name(cause: &Value) -> String {
    let word = |key: &str| cause[key].as_str().unwrap_or_default();
    format!("{} {}", word("effect"), word("axis"))
        .trim()
        .to_owned()
}

/// Whether a listed name is that of a cause; a `*` in place of the axis stands for any.
fn is_of(listed: &str, cause: &str) -> bool {
    let effect = listed.strip_suffix(" *");
    listed == cause || (effect.is_some() && cause.split(' ').next() == effect)
}

/// The causes of a status, each with those that cannot be told from it.
pub fn causes(report: &Value, status: &str) -> Vec<String> {
    let all = report["causes"].as_array().into_iter().flatten();
    let those = all.filter(|cause| cause["status"] == status);
    let with_others = those.map(|cause| {
        let others = cause["confusable_with"].as_array().into_iter().flatten();
        let open = others.filter(|other| other["excluded"] == false);
        let open: Vec<String> = open.map(cause_name).collect();
        if open.is_empty() {
            cause_name(cause)
        } else {
            format!("{} (or {})", cause_name(cause), open.join(", "))
        }
    });
    with_others.collect()
}

/// Named causes and sets against those that must, may and must not be named.
pub fn diagnosis(wanted: &Diagnose, report: &Value) -> Vec<Check> {
    let all = report["causes"].as_array().into_iter().flatten();
    let named = all
        .filter(|cause| cause["status"] == "named")
        .map(cause_name);
    let named: Vec<String> = named.collect();
    let mut checks: Vec<Check> = vec![];
    for must in &wanted.must {
        checks.extend(must_be_named(must, report));
    }
    for wrong in &wanted.must_not {
        let holds = !named.iter().any(|name| is_of(wrong, name));
        let found = if holds { "not named" } else { "named" };
        checks.push(Check::new(format!("not {wrong}"), holds, found));
    }
    let is_listed = |name: &String| {
        let must = wanted.must.iter().flat_map(|must| &must.one_of);
        let mut all = must.chain(&wanted.may).chain(&wanted.must_not);
        all.any(|listed| is_of(listed, name))
    };
    let others: Vec<&str> = { named.iter() }
        .filter(|name| !is_listed(name))
        .map(String::as_str)
        .collect();
    // Without a report nothing was diagnosed, which is no absence of wrong names.
    let holds = report.is_object() && others.is_empty();
    checks.push(Check::new("nothing else named", holds, others.join(", ")));
    checks
}

fn must_be_named(must: &Must, report: &Value) -> Vec<Check> {
    let name = must.one_of.join(" or ");
    let mut all = report["causes"].as_array().into_iter().flatten();
    let found = all.find(|cause| {
        let is_told = cause["status"] == "named" || cause["status"] == "set";
        is_told && must.one_of.iter().any(|one| is_of(one, &cause_name(cause)))
    });
    let words = found.map_or("not named", |cause| {
        cause["status"].as_str().unwrap_or_default()
    });
    let mut checks = vec![Check::new(name.clone(), found.is_some(), words)];
    checks.extend(must.sizes.iter().flat_map(|(parameter, right)| {
        let check = format!("{name} {parameter}");
        size(check, found, parameter, right)
    }));
    checks
}

/// The size of a cause, and its interval, which holds the right value.
fn size(check: String, cause: Option<&Value>, parameter: &str, right: &Figure) -> [Check; 2] {
    let parameters = cause.and_then(|cause| cause["parameters"].as_array());
    let mut those = parameters.into_iter().flatten();
    let found = those.find(|one| one["name"] == parameter);
    let of = |key: &str| found.and_then(|one| one[key].as_f64());
    let interval = [of("low"), of("high")];
    let holds =
        matches!(interval, [Some(low), Some(high)] if low <= right.value && right.value <= high);
    let [low, high] = interval.map(|end| end.map_or("?".to_owned(), |end| format!("{end:.2}")));
    let within = Check::new(
        format!("{check} interval"),
        holds,
        format!("{low} to {high}"),
    );
    [
        compared(check, of("value"), Some(right.value), right.within),
        within,
    ]
}

/// What a log goes with: the line `CHANNEL goes with THERMOMETER lagged by N min, S µm/K`, with several terms.
pub fn follows(wanted: &[Follow], text: &str) -> Vec<Check> {
    // A person reads a minus sign, which a parser of numbers does not take.
    let text = text.replace('−', "-");
    let found = |follow: &Follow| -> Option<[f64; 2]> {
        let lines = text.lines().filter(|line| line.contains(" goes with "));
        let start = format!("with {} ", follow.thermometer);
        let mut terms = lines.filter_map(|line| line.split_once(&start).map(|(_, term)| term));
        let term = terms
            .find(|term| term.starts_with("lagged by ") || term.starts_with("without a lag"))?;
        let (lag, rest) = term.split_once(", ")?;
        let lag_min = lag
            .strip_prefix("lagged by ")
            .map_or(Some(0.0), |lag| lag.strip_suffix(" min")?.parse().ok())?;
        Some([lag_min, rest.split_once(" µm/K")?.0.parse().ok()?])
    };
    let checks = wanted.iter().flat_map(|follow| {
        let name = &follow.thermometer;
        let [lag_min, um_per_k] = found(follow).map_or([None; 2], |found| found.map(Some));
        let of = |key: &str, value: Option<f64>, right: &Figure| {
            compared(
                format!("follows {name} {key}"),
                value,
                Some(right.value),
                right.within,
            )
        };
        [
            of("lag", lag_min, &follow.lag),
            of("size", um_per_k, &follow.size),
        ]
    });
    checks.collect()
}

/// Rows of numbers of a text, such as a table for a control.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let cells = |line: &str| -> Option<Vec<f64>> {
        line.split([' ', '\t', ',', ';'])
            .filter(|cell| !cell.is_empty())
            .map(|cell| cell.parse().ok())
            .collect()
    };
    text.lines().filter_map(cells).collect()
}

/// Every wanted row of numbers stands in a text.
pub fn has_rows(wanted: &[Vec<f64>], within: f64, text: &str) -> Check {
    let found = rows(text);
    let near = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= within)
    };
    let there = { wanted.iter() }
        .filter(|row| found.iter().any(|other| near(row, other)))
        .count();
    let words = format!("{there} of {} rows", wanted.len());
    Check::new("export rows", there == wanted.len(), words)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn right(value: f64, within: f64) -> Figure {
        let unit = "um".to_owned();
        Figure {
            value,
            unit,
            within,
        }
    }

    fn failed(checks: &[Check]) -> Vec<&str> {
        let failed = checks.iter().filter(|check| !check.holds);
        failed.map(|check| check.name.as_str()).collect()
    }

    #[test]
    fn a_wrong_figure_and_an_absent_one_are_found() {
        let wanted = Report {
            of: vec![],
            exit: 0,
            says: vec![],
            test: "iso230_2".to_owned(),
            figures: BTreeMap::from([
                ("A".to_owned(), right(11.26, 0.005)),
                ("B".to_owned(), right(6.31, 0.005)),
                ("E_up".to_owned(), right(4.0, 0.005)),
            ]),
        };
        let report = json!({"tests": [{"iso230_2": {
            "accuracy": {"value_mm": 0.011_262}, "reversal": {"value_mm": 0.006_32}, "points": [{"target_mm": 1.0}, {"target_mm": 2.0}], "n_runs": 5,
        }}]});
        let exact =
            |a: f64| BTreeMap::from([("A".to_owned(), Some(a)), ("targets".to_owned(), Some(2.0))]);
        assert_eq!(
            failed(&figures("map", &wanted, &[exact(11.262)], &report)),
            ["map B", "map E_up"]
        );
        let off = figures("map", &wanted, &[exact(11.262_002), exact(1.0)], &report);
        let all = [
            "map B",
            "map E_up",
            "map tests",
            "map numpy 1 A",
            "map numpy 2 A",
            "map numpy 2 targets",
        ];
        assert_eq!(failed(&off), all);
        let none = figures("map", &wanted, &[], &Value::Null);
        assert_eq!(failed(&none), ["map A", "map B", "map E_up"]);
    }

    fn cause(effect: &str, status: &str, width_um: f64) -> Value {
        json!({"effect": effect, "axis": "X", "status": status,
            "parameters": [{"name": "width_um", "value": width_um, "low": width_um - 0.3, "high": width_um + 0.3}]})
    }

    #[test]
    fn a_missing_cause_a_wrong_size_and_a_wrong_name_are_found() {
        let wanted = Diagnose {
            exit: 0,
            says: vec![],
            follows: vec![],
            must: vec![Must {
                one_of: vec!["backlash X".to_owned()],
                sizes: BTreeMap::from([("width_um".to_owned(), right(5.0, 0.5))]),
            }],
            may: vec!["scale_error X".to_owned()],
            must_not: vec!["cyclic_error *".to_owned()],
        };
        let of = |causes: &[Value]| {
            let report = json!({ "causes": causes });
            let checks = diagnosis(&wanted, &report);
            failed(&checks).join("; ")
        };
        let play = cause("backlash", "set", 5.2);
        assert_eq!(of(&[play.clone(), cause("scale_error", "named", 0.0)]), "");
        assert_eq!(
            of(&[cause("backlash", "named", 6.0)]),
            "backlash X width_um; backlash X width_um interval"
        );
        assert_eq!(
            of(&[cause("backlash", "surrogate", 5.0)]),
            "backlash X; backlash X width_um; backlash X width_um interval"
        );
        assert_eq!(
            of(&[play.clone(), cause("cyclic_error", "named", 0.0)]),
            "not cyclic_error *"
        );
        assert_eq!(
            of(&[play, cause("straightness", "named", 0.0)]),
            "nothing else named"
        );
        let refused = diagnosis(&wanted, &Value::Null);
        assert_eq!(
            failed(&refused),
            [
                "backlash X",
                "backlash X width_um",
                "backlash X width_um interval",
                "nothing else named"
            ]
        );
    }

    #[test]
    fn a_log_that_goes_with_another_thermometer_or_lag_is_found() {
        let wanted = [Follow {
            thermometer: "rear".to_owned(),
            lag: right(60.0, 5.0),
            size: right(0.93, 0.05),
        }];
        let of = |text: &str| {
            let checks = follows(&wanted, text);
            failed(&checks).join("; ")
        };
        let first = "length.Z goes with rear lagged by 59.4 min, 0.93 µm/K, and with table without a lag, -3.2 µm/K: on runs";
        assert_eq!(of(first), "");
        assert_eq!(
            of(
                "a goes with table without a lag, -3.2 µm/K, and with rear lagged by 61.0 min, 0.90 µm/K"
            ),
            ""
        );
        assert_eq!(
            of("a goes with rear without a lag, 0.93 µm/K: on"),
            "follows rear lag"
        );
        assert_eq!(
            of("a goes with front lagged by 60.0 min, 0.93 µm/K"),
            "follows rear lag; follows rear size"
        );
    }

    #[test]
    fn a_code_a_word_and_a_row_that_differ_are_found() {
        let says = ["spindle_frnt".to_owned()];
        let checks = ended("import", [Some(1), Some(0)], &says, "2 runs");
        assert_eq!(failed(&checks), ["import exit", "import \"spindle_frnt\""]);
        let wanted = [vec![0.0, 0.001, -0.002], vec![42.0, 0.1, 0.2]];
        let text = "# x\n0.0 0.00100 -0.0020\n42 0.1 0.3\n";
        assert_eq!(has_rows(&wanted, 1e-6, text).found, "1 of 2 rows");
        assert!(has_rows(&wanted[..1], 1e-6, text).holds);
    }
}
