//! `abbe diagnose` as a person uses it on a recorded bag: the report against its schema, what each exit code
//! means, and a bag that was cut.

use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
use abbe_tests::python::{interpreter, script, succeeded};
use abbe_tests::scenario::{Scenario, mcap_file};
use serde_json::Value;

use crate::page;

const SCHEMA: &str = include_str!("../../nodes/gap_diagnosis/schema/abbe.gap.1.schema.json");

/// Two circles, three times each.
const CIRCLES: &str = "\
title: circles
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 3000.0, sense: both, on_the_fly: true, repeats: 3}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 25.0, feed_mm_min: 3000.0, sense: both, on_the_fly: true, repeats: 3}
";
/// The same, each once.
const ONCE: &str = "\
title: circles once
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 3000.0, sense: both, on_the_fly: true}
";

struct Recorded {
    scenario: Scenario,
    bag: PathBuf,
}

fn recorded(plan: &str) -> Recorded {
    let scenario = Scenario::copy_of("gap_first");
    scenario.write("plan.yaml", plan);
    scenario.replace("scenario.yaml", "diagnose: true", "diagnose: false");
    let bag = scenario.run().join("bag");
    Recorded { scenario, bag }
}

fn diagnose(bag: &Path, more: &[&str]) -> Ended {
    let mut command = command(0, &["diagnose"]);
    command.arg(bag).args(more).current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(300))
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Where a value does not obey its schema; of JSON Schema only what this one uses is known.
pub fn against_schema(report: &Value) -> Vec<String> {
    let mut found = vec![];
    check(
        "report",
        &serde_json::from_str(SCHEMA).unwrap(),
        report,
        &mut found,
    );
    found
}

fn check(at: &str, schema: &Value, value: &Value, found: &mut Vec<String>) {
    for (keyword, rule) in schema.as_object().unwrap() {
        let obeys = match keyword.as_str() {
            "$schema" | "$id" | "title" | "description" | "required" => true,
            "type" => match rule {
                Value::Array(types) => types.iter().any(|one| is_of(one, value)),
                one => is_of(one, value),
            },
            "const" => value == rule,
            "enum" => rule.as_array().unwrap().contains(value),
            "minimum" => value.as_f64().is_none_or(|v| v >= rule.as_f64().unwrap()),
            "maximum" => value.as_f64().is_none_or(|v| v <= rule.as_f64().unwrap()),
            "pattern" => {
                assert_eq!(rule, "^([0-9a-f]{64})?$", "{at}");
                let text = value.as_str().unwrap();
                let is_hex = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
                text.is_empty() || text.len() == 64 && text.chars().all(is_hex)
            }
            "anyOf" => rule.as_array().unwrap().iter().any(|one| {
                let mut of_one = vec![];
                check(at, one, value, &mut of_one);
                of_one.is_empty()
            }),
            "items" => {
                for (k, item) in value.as_array().into_iter().flatten().enumerate() {
                    check(&format!("{at}[{k}]"), rule, item, found);
                }
                true
            }
            "properties" => {
                let properties = rule.as_object().unwrap();
                let required = schema.get("required").and_then(Value::as_array);
                let must_be =
                    |key: &str| required.is_some_and(|keys| keys.iter().any(|k| k == key));
                for (key, of_key) in properties {
                    match value.get(key) {
                        Some(inner) => check(&format!("{at}.{key}"), of_key, inner, found),
                        None if must_be(key) => found.push(format!("{at}: no {key}")),
                        None => {}
                    }
                }
                let keys = value.as_object().into_iter().flatten();
                keys.into_iter()
                    .all(|(key, _)| properties.contains_key(key))
            }
            "additionalProperties" => *rule == Value::Bool(false),
            other => panic!("{at}: the keyword {other} is not known here"),
        };
        if !obeys {
            found.push(format!("{at}: {keyword} {rule}: {value}"));
        }
    }
}

fn is_of(name: &Value, value: &Value) -> bool {
    match name.as_str().unwrap() {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        "null" => value.is_null(),
        other => panic!("{other} is no type"),
    }
}

/// What PyPI jsonschema says of the report and of a wrong one.
fn by_a_validator(report: &Path, wrong: &Value) {
    let Some(python) = interpreter("a report by PyPI jsonschema") else {
        return;
    };
    let spoiled = report.with_extension("wrong.json");
    std::fs::write(&spoiled, wrong.to_string()).unwrap();
    let errors = |path: &Path| -> Vec<String> {
        let mut validate = script(&python, "validate_json.py");
        validate.arg(root().join("nodes/gap_diagnosis/schema/abbe.gap.1.schema.json"));
        let output = validate.arg(path).output().unwrap();
        succeeded(&output).lines().map(str::to_owned).collect()
    };
    assert_eq!(errors(report), Vec::<String>::new());
    let found = errors(&spoiled);
    for words in [
        "$.causes: type",
        "$.gap.rms_um: minimum",
        "additionalProperties",
    ] {
        assert!(found.iter().any(|line| line.contains(words)), "{found:?}");
    }
    assert_eq!(found.len(), 3, "{found:?}");
}

/// The terminal has the checks of the backlash with the figures of the report.
fn is_explained(report: &Value, said: &str) {
    let causes = report["causes"].as_array().unwrap();
    let own = |cause: &&Value| cause["effect"] == "backlash" && cause["axis"] == "X";
    let cause = causes
        .iter()
        .find(own)
        .unwrap_or_else(|| panic!("{causes:#?}"));
    let why = cause["why"].as_array().unwrap();
    let noise = why.iter().find(|check| check["check"] == "above_noise");
    let noise = noise.unwrap_or_else(|| panic!("{why:#?}"));
    assert_eq!(noise["value"], cause["D"]);
    let own = said
        .lines()
        .skip_while(|line| !line.contains("check of backlash X"));
    let lines = own.map(|line| line.split_whitespace().collect());
    let lines: Vec<Vec<&str>> = lines.collect();
    let line = lines
        .iter()
        .find(|line| line.starts_with(&["size", "over", "noise,", "D"]));
    let line = line.unwrap_or_else(|| panic!("{said}"));
    assert_eq!(line[5..7], ["at", "least"], "{line:?}");
    let printed = |place: usize| -> f64 { line[place].parse().unwrap() };
    for (place, key) in [(4, "value"), (7, "limit")] {
        let whole = noise[key].as_f64().unwrap();
        assert!((printed(place) / whole - 1.0).abs() < 0.005, "{line:?}");
    }
    let verdict = if noise["verdict"] == "passed" {
        "passed"
    } else {
        "FAILED"
    };
    assert_eq!(line.last(), Some(&verdict));
    if cause["status"] == "named" {
        assert!(
            said.contains("backlash X, named: it passes all of"),
            "{said}"
        );
    }
}

fn loss_is_said_first(said: &str) {
    for word in ["bag_0.mcap", "messages were read before"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let place = |word: &str| said.find(word).unwrap_or(usize::MAX);
    assert!(place("Lost:") < place("Where:"), "{said}");
}

fn is_whole_page(html: &Path) {
    let page = std::fs::read_to_string(html).unwrap();
    for word in [
        "<svg",
        "<details><summary>backlash X",
        "Effects that look alike in this recording",
        "prefers-color-scheme",
    ] {
        assert!(page.contains(word), "{word}");
    }
    page::is_one_file(&page);
}

#[test]
fn a_real_report_obeys_its_schema_and_a_cut_bag_is_read_up_to_the_cut_with_exit_code_3() {
    let Recorded { scenario, bag } = recorded(CIRCLES);
    let out = scenario.out();
    let (report, html) = (out.join("gap.json"), out.join("gap.html"));
    let written = out.join("better.yaml");
    let machine = scenario.argument("machine.yaml");
    let ended = diagnose(
        &bag,
        &[
            "--machine",
            &machine,
            "--json",
            &report.display().to_string(),
            "--html",
            &html.display().to_string(),
            "--write-machine",
            &written.display().to_string(),
            "--explain",
        ],
    );
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    for word in ["Where:", "Which:", "How far:"] {
        assert!(ended.said.contains(word), "{word}: {}", ended.said);
    }
    let whole = json(&report);
    assert_eq!(against_schema(&whole), Vec::<String>::new());
    is_explained(&whole, &ended.said);
    assert_eq!(whole["inputs"]["bags"][0]["runs"], 12);
    let mut wrong = whole.clone();
    wrong["causes"] = Value::String("none".to_owned());
    wrong["gap"]["rms_um"] = Value::from(-1.0);
    wrong["score"] = Value::from(1);
    assert_eq!(against_schema(&wrong).len(), 3, "a wrong report is noticed");
    by_a_validator(&report, &wrong);
    is_whole_page(&html);
    assert!(written.is_file());

    let file = mcap_file(&bag);
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() * 9 / 10]).unwrap();
    let ended = diagnose(
        &bag,
        &[
            "--machine",
            &machine,
            "--json",
            &report.display().to_string(),
        ],
    );
    assert_eq!(ended.status.code(), Some(3), "{}", ended.said);
    loss_is_said_first(&ended.said);
    let cut = json(&report);
    assert_eq!(against_schema(&cut), Vec::<String>::new());
    let runs = cut["inputs"]["bags"][0]["runs"].as_u64().unwrap();
    assert!((6..12).contains(&runs), "{runs}");
}

#[test]
fn what_cannot_be_diagnosed_ends_with_1_and_what_to_record_and_a_wrong_question_with_2() {
    let Recorded { scenario, bag } = recorded(ONCE);
    let machine = scenario.argument("machine.yaml");
    let cannot = |ended: &Ended, words: &[&str]| {
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        for word in words {
            assert!(ended.said.contains(word), "{word}: {}", ended.said);
        }
    };
    // What was run once has noise within the run alone, which is stated.
    let once = diagnose(&bag, &["--machine", &machine]);
    assert_eq!(once.status.code(), Some(0), "{}", once.said);
    let words = "no test was repeated on it, so its noise is that within a run";
    assert!(once.said.contains(words), "{}", once.said);
    let other = "launch_configs/five_axis/machine.yaml";
    cannot(
        &diagnose(&bag, &["--machine", other]),
        &["another machine's"],
    );
    let text = std::fs::read_to_string(&machine).unwrap();
    scenario.write(
        "coarse.yaml",
        &text.replace("lead_mm: 10.0", "lead_mm: 20.0"),
    );
    let coarse = scenario.argument("coarse.yaml");
    cannot(
        &diagnose(&bag, &["--machine", &coarse]),
        &["axes.X.lead_mm: 10 in the recording, 20 in the machine file"],
    );
    let twice = bag.display().to_string();
    cannot(
        &diagnose(&bag, &[&twice, "--machine", &machine]),
        &["is the same as", "name each recording once"],
    );
    cannot(
        &diagnose(&bag, &["--machine", &machine, "--write-machine", &machine]),
        &["machine.yaml: is read as an input"],
    );
    let nothing = scenario.out().join("nothing");
    cannot(&diagnose(&nothing, &["--machine", &machine]), &["nothing"]);
    let absent = scenario.argument("absent.yaml");
    cannot(&diagnose(&bag, &["--machine", &absent]), &["absent.yaml"]);
    for wrong in [&["--wrong"][..], &["--machine"]] {
        let ended = diagnose(&bag, wrong);
        assert_eq!(ended.status.code(), Some(2), "{}", ended.said);
    }
}
