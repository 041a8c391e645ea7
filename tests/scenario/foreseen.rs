//! What a preflight foresees of a shipped scenario is what the diagnosis of its run finds: runs, channels, repeats, and no
//! effect named that would not have shown.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use abbe_tests::program::{Process, command};
use serde_json::Value;

/// Longest preflight or diagnosis, s: they run beside other tests.
const PATIENCE_S: u64 = 600;

/// A preflight under way beside the run.
pub struct Foreseen(Process);

impl Foreseen {
    /// Begins it for a scenario's folder.
    pub fn begin(folder: &Path) -> Self {
        let mut preflight = command(0, &["preflight"]);
        preflight.arg(folder).arg("--json");
        Self(Process::start(preflight))
    }

    /// What it says of the scenario: its forecast, and the cycles that nodes ask for.
    pub fn planned(self) -> Value {
        let ended = self.0.ended_within(Duration::from_secs(PATIENCE_S));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        let begin = ended.said.find('{').unwrap();
        // The expected time of a long one may stand behind it.
        let mut values = serde_json::Deserializer::from_str(&ended.said[begin..]).into_iter();
        let told: Value = values.next().unwrap().unwrap();
        told["gap"].clone()
    }

    /// Compares with the report of the run, or with a diagnosis of its bag where the scenario makes none.
    pub fn agrees(self, folder: &Path, run: &Path) {
        let planned = self.planned();
        let gap = run.join("gap.json");
        if !gap.is_file() {
            let mut diagnose = command(0, &["diagnose"]);
            diagnose.arg(run.join("bag"));
            diagnose.arg("--machine").arg(folder.join("machine.yaml"));
            diagnose.arg("--json").arg(&gap);
            let ended = Process::start(diagnose).ended_within(Duration::from_secs(PATIENCE_S));
            assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        }
        let text = std::fs::read_to_string(&gap).unwrap();
        let differ = differences(&planned, &serde_json::from_str(&text).unwrap());
        assert!(differ.is_empty(), "{}: {differ:#?}", folder.display());
    }
}

fn texts<'v>(list: &'v Value, key: &str) -> BTreeSet<&'v str> {
    let all = list.as_array().unwrap().iter();
    all.map(|one| one[key].as_str().unwrap()).collect()
}

/// What of a forecast the report of the run does not bear out.
pub fn differences(planned: &Value, report: &Value) -> Vec<String> {
    let mut differ = Vec::new();
    let forecast = &planned["forecast"];
    let bags = report["inputs"]["bags"].as_array().unwrap().iter();
    let recorded: u64 = bags.map(|bag| bag["runs"].as_u64().unwrap()).sum();
    let foreseen = forecast["runs"].as_u64().unwrap();
    // Drift and the load of the real machine ask for cycles of their own, of any number, and move those of the period.
    let requests = planned["requested_block_cycles"].as_u64().unwrap();
    let [fewest, most] = if requests == 0 {
        [foreseen, foreseen]
    } else {
        [foreseen.saturating_sub(1), u64::MAX]
    };
    if !(fewest..=most).contains(&recorded) {
        differ.push(format!("{foreseen} runs foreseen, {recorded} made"));
    }
    let channels = texts(&forecast["channels"], "channel");
    // Thermometers that are compared with each other have no floor to assume.
    let floors = texts(&report["noise_floor"], "channel");
    let read: BTreeSet<&str> = floors
        .into_iter()
        .filter(|channel| !channel.starts_with("thermometer"))
        .collect();
    for channel in read.difference(&channels) {
        differ.push(format!("{channel} was read and is not foreseen"));
    }
    let often = forecast["channels"].as_array().unwrap().iter();
    for channel in often.filter(|it| it["repeats"].as_u64().unwrap() > 1) {
        let name = channel["channel"].as_str().unwrap();
        if !read.contains(name) {
            differ.push(format!("{name} would repeat, and has no floor"));
        }
    }
    let hidden = texts(&forecast["not_excited"], "effect");
    for cause in report["causes"].as_array().unwrap() {
        let effect = cause["effect"].as_str().unwrap();
        if cause["status"] != "surrogate" && hidden.contains(effect) {
            differ.push(format!("{effect} would not show, and is named"));
        }
    }
    differ
}

#[test]
fn a_forecast_that_the_run_does_not_bear_out_is_noticed() {
    let planned = serde_json::json!({
        "requested_block_cycles": 0,
        "forecast": {
            "runs": 2,
            "channels": [{"channel": "touch", "repeats": 5}],
            "not_excited": [{"effect": "spindle_growth"}],
        },
    });
    let report = |runs: u64, effect: &str, status: &str, channel: &str| {
        serde_json::json!({
            "inputs": {"bags": [{"runs": runs}]},
            "noise_floor": [{"channel": channel}],
            "causes": [{"effect": effect, "status": status}],
        })
    };
    let of = |report: &Value| differences(&planned, report).len();
    assert_eq!(of(&report(2, "probe_latency", "named", "touch")), 0);
    assert_eq!(of(&report(1, "probe_latency", "named", "touch")), 1);
    assert_eq!(of(&report(17, "probe_latency", "named", "touch")), 1);
    assert_eq!(of(&report(2, "spindle_growth", "named", "touch")), 1);
    assert_eq!(of(&report(2, "spindle_growth", "surrogate", "touch")), 0);
    assert_eq!(of(&report(2, "probe_latency", "set", "grid.u")), 2);
}
