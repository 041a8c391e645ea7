//! The JSON Schema and the report name the same keys, no others allowed, and all but those that came later required; both take the sample by which
//! the form was agreed.

use gap_diagnosis::GapReport;
use serde_json::Value;

const TEXT: &str = include_str!("../../schema/abbe.gap.1.schema.json");

/// A report in which every list has an entry and every option a value.
const FULL: &str = r#"{
"schema": "abbe.gap/1",
"inputs": {"bags": [{"path": "", "sha256": "", "runs": 0, "samples": 0}], "machine_sha256": ""},
"noise_floor": [{"channel": "grid.u", "sigma_um": 0.2, "ar": [0.6], "repeats": 3, "reproduced": true,
  "vibrations": [{"plane": "XY", "frequency_hz": 47.3, "frequency_half_width_hz": 0.2, "rms_um": 0.21, "runs": 12, "of": 12, "sampled_hz": 250.0,
    "period_mm": 0.35, "chance": 1e-9}]}],
"gap": {"rms_um": 8.1, "p95_um": 14.0, "floor_um": 0.3, "above_floor": true,
  "per_channel": [{"channel": "grid.u", "rms_um": 8.1, "p95_um": 14.0, "floor_um": 0.3, "above_floor": true}]},
"where": [{"channel": "grid.u", "direction": "X", "covariate": "", "share_unique": 0.6, "share_shared": 0.1, "p_value": 0.001,
  "z": 19.0, "per_condition": [{"condition": "", "rms_um": 1.0}]}],
"causes": [{"effect": "backlash", "axis": "X", "status": "set", "confidence": 0.97,
  "parameters": [{"name": "width_um", "value": 5.9, "low": 5.6, "high": 6.2, "at_bound": false}], "D": 88.0,
  "confusable_with": [{"effect": "", "axis": "", "cos": 0.6, "excluded": true}],
  "constancy": {"passed": true, "worst_z": 1.2, "split_by": "feed"},
  "why": [{"check": "above_noise", "name": "size over noise, D", "value": 88.0, "limit": 6.5, "passes": "at_least", "unit": "", "verdict": "passed"}]}],
"unknown": {"flagged": false, "score": 1.4, "threshold": 3.1,
  "description": {"covariate": "", "parity": "", "period": "", "feed_exponent": null, "time_constant_s": null}},
"shrink": {"fit_runs": [1], "held_out_runs": [7], "rms_um": {"before": 8.1, "after": 0.5}, "p95_um": {"before": null, "after": null},
  "gap_closed": {"value": 0.995, "low": 0.99, "high": 0.998},
  "leave_one_out": [{"effect": "backlash", "axis": "X", "rms_um_without": 7.9}]},
"not_excited": [{"effect": "probe_latency", "needs": ""}],
"next_experiments": [{"run": "", "separates": [""], "delta": 31.0, "minutes": 1.5}],
"over_session": [{"effect": "backlash", "axis": "X", "from_run": 25, "holds": false, "changes_from_run": 31, "change_share": 0.2,
  "growth_share_per_h": 0.1, "chance": 0.001}],
"does_not_repeat": [{"channel": "touch", "feature": "block_1.x", "size_um": 5.0, "last_run": 3, "from_run": 4, "of_set_up": true,
  "evenly": true, "chance": 1e-6}],
"follows": [{"channel": "length.Z", "share": 0.97,
  "thermometers": [{"thermometer": "spindle_front", "um_per_k": 3.0, "standard_error_um_per_k": 0.02, "lag_min": 12.0}]}],
"runtime_s": 1.3 }"#;

/// What `abbe diagnose` adds to a report, where there is any.
const ADDED: &str = r#"{
"loss": [null, {"places": [{"file": "b_0.mcap"}], "left_out": [{"topic": "axes/state"}]}],
"machine_defaults": ["axes.X.lead_mm = 10.0"],
"simulated": {"bags": [{"path": "", "sha256": "", "runs": 1, "samples": 2}], "runs": {"matched": 1, "of": 2},
  "readings": {"matched": 1, "of": 2}, "stood_in": [], "unmatched": []},
"made_with": {"without": ["backlash"], "ablated": ["held_out"]},
"alarms": {"state": "alarm", "figures": [{"figure": "gap.rms_um"}], "without_figure": ["gap.q"]} }"#;

/// The sample by which the form was agreed, to the letter.
const SAMPLE: &str = r#"{ "schema": "abbe.gap/1",
  "inputs": {"bags": [{"path":"","sha256":"","runs":0,"samples":0}], "machine_sha256": ""},
  "noise_floor": [{"channel":"grid.u","sigma_um":0.21,"ar":[0.6],"repeats":3,"reproduced":true}],
  "gap": {"rms_um":8.1,"p95_um":14.0,"floor_um":0.3,"above_floor":true,"per_channel":[]},
  "where": [{"channel":"grid.u","direction":"X","covariate":"sense*log_distance_since_reversal_x",
             "share_unique":0.61,"share_shared":0.07,"p_value":0.001,"z":19.0,"per_condition":[]}],
  "causes": [{"effect":"backlash","axis":"X","status":"named","confidence":0.97,
              "parameters":[{"name":"width_um","value":5.9,"low":5.6,"high":6.2,"at_bound":false}],
              "D":88.0,"confusable_with":[{"effect":"reversal_spike","axis":"X","cos":0.62,"excluded":true}],
              "constancy":{"passed":true,"worst_z":1.2,"split_by":"feed"}}],
  "unknown": {"flagged":false,"score":1.4,"threshold":3.1,
              "description":{"covariate":"","parity":"","period":"","feed_exponent":null,"time_constant_s":null}},
  "shrink": {"fit_runs":[1,2],"held_out_runs":[7,8],"rms_um":{"before":8.1,"after":0.5},"p95_um":{"before":14.0,"after":0.9},
             "gap_closed":{"value":0.995,"low":0.990,"high":0.998},
             "leave_one_out":[{"effect":"backlash","axis":"X","rms_um_without":7.9}]},
  "not_excited": [{"effect":"probe_latency","needs":"touches at two feeds or more"}],
  "next_experiments": [{"run":"circle XY R50 F3000 both senses","separates":["servo_mismatch XY","squareness XY"],"delta":31.0,"minutes":1.5}],
  "runtime_s": 1.3 }"#;

/// Keys that a report need not have, with their place.
const OPTIONAL: [(&str, &str); 12] = [
    ("report", "over_session"),
    ("report", "does_not_repeat"),
    ("report", "follows"),
    ("report.noise_floor[]", "vibrations"),
    ("report", "loss"),
    ("report", "machine_defaults"),
    ("report", "simulated"),
    ("report", "made_with"),
    ("report", "alarms"),
    ("report.causes[]", "why"),
    ("report.does_not_repeat[]", "evenly"),
    ("report.does_not_repeat[]", "feature"),
];

/// Lists without an entry: of them nothing would be compared.
fn empty(at: &str, value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                empty(&format!("{at}.{key}"), value, found);
            }
        }
        Value::Array(items) => {
            if items.is_empty() {
                found.push(at.to_owned());
            }
            for item in items {
                empty(at, item, found);
            }
        }
        _ => {}
    }
}

/// Where value and schema name other things.
fn differences(at: &str, schema: &Value, value: &Value, found: &mut Vec<String>) {
    let schema = schema["anyOf"]
        .as_array()
        .and_then(|all| all.iter().find(|one| one["type"] == "object"))
        .unwrap_or(schema);
    match value {
        Value::Object(fields) => {
            let properties = schema["properties"].as_object();
            let keys = |map: Option<&serde_json::Map<String, Value>>| {
                let mut keys: Vec<String> =
                    map.into_iter().flat_map(|m| m.keys().cloned()).collect();
                keys.sort();
                keys
            };
            let mut required: Vec<String> = schema["required"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(|key| key.as_str().map(str::to_owned))
                .collect();
            required.sort();
            let there = keys(Some(fields));
            let mut named = keys(properties);
            // The keys that are not always there.
            let is_optional =
                |key: &String| OPTIONAL.contains(&(at, key.as_str())) && !required.contains(key);
            named.retain(|key| !is_optional(key) || there.contains(key));
            let must_be: Vec<String> = there
                .iter()
                .filter(|key| !is_optional(key))
                .cloned()
                .collect();
            if named != there || required != must_be {
                found.push(format!("{at}: {there:?}"));
            }
            if schema["additionalProperties"] != Value::Bool(false) {
                found.push(format!("{at}: takes other keys"));
            }
            for (key, value) in fields {
                differences(
                    &format!("{at}.{key}"),
                    &schema["properties"][key],
                    value,
                    found,
                );
            }
        }
        Value::Array(items) => {
            if schema["type"] != "array" {
                found.push(format!("{at}: no array"));
            }
            for item in items {
                differences(&format!("{at}[]"), &schema["items"], item, found);
            }
        }
        _ => {}
    }
}

fn schema() -> Value {
    serde_json::from_str(TEXT).expect("JSON")
}

#[test]
fn the_schema_names_every_key_of_the_report_and_no_other() {
    let mut schema = schema();
    let report: GapReport = serde_json::from_str(FULL).expect("a report");
    let report = serde_json::to_value(report).expect("JSON");
    let mut found = vec![];
    empty("report", &report, &mut found);
    differences("report", &schema, &report, &mut found);
    assert_eq!(found, Vec::<String>::new());
    schema["properties"]["unknown"]["properties"]["score2"] = Value::Null;
    differences("report", &schema, &report, &mut found);
    assert_eq!(found.len(), 1, "a key too many is found");
}

#[test]
fn the_agreed_sample_is_of_the_schema_and_is_written_as_it_was_read() {
    let sample: Value = serde_json::from_str(SAMPLE).expect("JSON");
    let mut found = vec![];
    differences("report", &schema(), &sample, &mut found);
    assert_eq!(found, Vec::<String>::new());
    let report: GapReport = serde_json::from_str(SAMPLE).expect("a report");
    assert_eq!(serde_json::to_value(report).expect("JSON"), sample);
}

#[test]
fn what_only_pages_tell_is_not_written_and_reports_of_before_that_had_it_are_read() {
    let mut old: Value = serde_json::from_str(SAMPLE).expect("JSON");
    old["noise_floor"][0]["between_runs_um"] = Value::from(0.1);
    old["causes"][0]["parameters"][0]["determined"] = Value::from(false);
    let mut found = vec![];
    differences("report", &schema(), &old, &mut found);
    assert_eq!(found.len(), 2, "{found:?}");
    let report: GapReport = serde_json::from_value(old).expect("a report of before");
    assert_eq!(report.noise_floor[0].between_runs_um, Some(0.1));
    assert_eq!(report.causes[0].parameters[0].determined, Some(false));
    let sample: Value = serde_json::from_str(SAMPLE).expect("JSON");
    assert_eq!(serde_json::to_value(report).expect("JSON"), sample);
}

#[test]
fn a_report_with_every_key_that_is_written_is_read_back_equal() {
    let mut whole: Value = serde_json::from_str(FULL).expect("JSON");
    let added: Value = serde_json::from_str(ADDED).expect("JSON");
    for (key, value) in added.as_object().expect("keys") {
        let mut one: Value = serde_json::from_str(SAMPLE).expect("JSON");
        one[key] = value.clone();
        let report: GapReport = serde_json::from_value(one.clone()).expect(key);
        assert_eq!(serde_json::to_value(report).expect("JSON"), one, "{key}");
        whole[key] = value.clone();
    }
    let report: GapReport = serde_json::from_value(whole.clone()).expect("every key");
    let written = serde_json::to_value(&report).expect("JSON");
    assert_eq!(written, whole);
    let again: GapReport = serde_json::from_value(written).expect("as written");
    assert_eq!(again, report);
    // And the schema has no key that was not tried.
    let schema = schema();
    let known = schema["properties"].as_object().expect("keys");
    let tried = whole.as_object().expect("keys");
    let untried: Vec<&String> = known
        .keys()
        .filter(|key| !tried.contains_key(*key))
        .collect();
    assert_eq!(untried, Vec::<&String>::new());
}
