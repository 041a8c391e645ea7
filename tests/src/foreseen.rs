//! What a preflight foresees of a shipped scenario is what the diagnosis of its run finds: runs, channels, repeats, and no
//! effect named that would not have shown.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use crate::program::{Ended, Process, command};
use serde_json::Value;

/// Longest preflight or diagnosis, s: they run beside other tests.
const PATIENCE_S: u64 = 600;
/// How both refuse a plan in which nothing is measured that a diagnosis uses.
const NO_TEST: &str = "holds a reading";

/// A preflight under way beside the run.
pub struct Foreseen(Process);

impl Foreseen {
    /// Begins it for a scenario's folder.
    #[must_use]
    pub fn begin(folder: &Path) -> Self {
        let mut preflight = command(0, &["preflight"]);
        preflight.arg(folder).arg("--json");
        Self(Process::start(preflight))
    }

    /// Compares with the report of the run, or with a diagnosis of its bag where the scenario makes none. A plan without a test
    /// that a diagnosis uses is refused by both, for the same reason.
    ///
    /// # Panics
    /// When they differ, or one of them fails.
    pub fn agrees(self, folder: &Path, run: &Path) {
        let gap = run.join("gap.json");
        let diagnosed = (!gap.is_file()).then(|| {
            let mut diagnose = command(0, &["diagnose"]);
            diagnose.arg(run.join("bag"));
            diagnose.arg("--machine").arg(folder.join("machine.yaml"));
            diagnose.arg("--json").arg(&gap);
            ended(Process::start(diagnose))
        });
        let foreseen = ended(self.0);
        if foreseen.status.code() == Some(1) {
            assert!(foreseen.said.contains(NO_TEST), "{}", foreseen.said);
            let diagnosed = diagnosed.expect("a diagnosis that was not foreseen");
            assert_eq!(diagnosed.status.code(), Some(1), "{}", diagnosed.said);
            assert!(diagnosed.said.contains(NO_TEST), "{}", diagnosed.said);
            return;
        }
        if let Some(diagnosed) = diagnosed {
            // 3: a busy computer left something out, which is named.
            let is_made = matches!(diagnosed.status.code(), Some(0 | 3));
            assert!(is_made, "{}", diagnosed.said);
        }
        let text = std::fs::read_to_string(&gap).unwrap();
        let differ = differences(&planned(&foreseen), &serde_json::from_str(&text).unwrap());
        assert!(differ.is_empty(), "{}: {differ:#?}", folder.display());
    }
}

fn ended(process: Process) -> Ended {
    process.ended_within(Duration::from_secs(PATIENCE_S))
}

/// What a preflight that succeeded says: its forecast, and the cycles that nodes ask for.
fn planned(ended: &Ended) -> Value {
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let begin = ended.said.find('{').unwrap();
    // The expected time of a long one may stand behind it.
    let mut values = serde_json::Deserializer::from_str(&ended.said[begin..]).into_iter();
    let told: Value = values.next().unwrap().unwrap();
    told["gap"].clone()
}

fn texts<'v>(list: &'v Value, key: &str) -> BTreeSet<&'v str> {
    let all = list.as_array().unwrap().iter();
    all.map(|one| one[key].as_str().unwrap()).collect()
}

/// What of a forecast the report of the run does not bear out.
///
/// # Panics
/// When one of them lacks what every forecast or report has.
#[must_use]
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
