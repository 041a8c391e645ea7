//! Bags of the tree that other people's recorders wrote of our nodes, and that are never recorded anew: each is read as it
//! was.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use abbe_tests::program::{Process, command, domain, root};
use serde_json::Value;

use crate::contract::{check, said};
use crate::old_bags::sha256;

const END: Duration = Duration::from_secs(120);
/// Number of this test's domain among those of its process.
const DOMAIN: u16 = 3;
/// What the plant's probe has, ms: `launch_configs/gap_first/plant.yaml` as it was when the bag was recorded.
const LATENCY_MS: f64 = 3.7;

/// A bag of another recorder, its file's SHA-256, and its messages.
struct Kept {
    name: &'static str,
    sha256: &'static str,
    messages: u64,
}

/// A line that is here stays as it is.
const RECORDED_BY_OTHERS: &[Kept] = &[Kept {
    name: "rosbag2_touches",
    sha256: "5eba050b813ddfa66cf25e83cc7f8104a9d29d48579931e9acf27618490ba121",
    messages: 13_703,
}];

/// Whether a folder of `bags/` was written by another recorder.
pub fn is_of_another(folder: &Path) -> bool {
    RECORDED_BY_OTHERS
        .iter()
        .any(|kept| folder.ends_with(kept.name))
}

impl Kept {
    fn folder(&self) -> PathBuf {
        root().join("bags").join(self.name)
    }

    fn file(&self) -> PathBuf {
        self.folder().join(format!("{}_0.mcap", self.name))
    }
}

/// Report of `abbe diagnose` by the scenario's machine file.
fn diagnosed(bag: &Path) -> Value {
    let machine = root().join("launch_configs/gap_first/machine.yaml");
    let mut diagnose = command(0, &["diagnose", "--json", "-"]);
    diagnose.arg(bag).arg("--machine").arg(machine);
    diagnose.stderr(Stdio::null());
    let ended = Process::start(diagnose).ended_within(END);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    serde_json::from_str(&ended.said).unwrap()
}

#[test]
fn bags_of_other_recorders_are_never_recorded_anew() {
    let readme = std::fs::read_to_string(root().join("bags/README.md")).unwrap();
    for kept in RECORDED_BY_OTHERS {
        assert_eq!(
            sha256(&kept.file()),
            kept.sha256,
            "bags/{} is another file",
            kept.name
        );
        assert!(
            readme.contains(kept.sha256),
            "bags/README.md: {}",
            kept.name
        );
    }
}

#[test]
fn bags_of_other_recorders_are_played_whole() {
    for kept in RECORDED_BY_OTHERS {
        for bag in [kept.folder(), kept.file()] {
            let mut play = command(domain(DOMAIN), &["play", "--rate", "0", "--delay", "0"]);
            play.arg(&bag);
            let ended = Process::start(play).ended_within(END);
            assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
            let whole = format!(": {} messages, 0 lost", kept.messages);
            assert!(ended.said.contains(&whole), "{}", ended.said);
        }
    }
}

#[test]
fn bags_of_other_recorders_are_no_runs_to_be_computed_again_and_that_is_said() {
    for kept in RECORDED_BY_OTHERS {
        let (code, _) = check(&kept.folder());
        assert_eq!(code, 1, "{}", kept.name);
        let said = said(&kept.folder());
        for words in ["\"abbe.run\"", "no composed run recorded it"] {
            assert!(said.contains(words), "{said}");
        }
    }
}

#[test]
fn a_bag_of_rosbag2_is_diagnosed_as_a_directory_and_as_a_file() {
    let kept = &RECORDED_BY_OTHERS[0];
    for bag in [kept.folder(), kept.file()] {
        let report = diagnosed(&bag);
        let bags = &report["inputs"]["bags"];
        assert_eq!(bags[0]["runs"], 3, "{bags:#}");
        assert_eq!(bags[0]["samples"], 18, "{bags:#}");
        let causes = report["causes"].as_array().unwrap();
        let named: Vec<_> = causes.iter().filter(|c| c["status"] == "named").collect();
        assert_eq!(named.len(), 1, "{causes:#?}");
        assert_eq!(named[0]["effect"], "probe_latency");
        let figures = &named[0]["parameters"][0];
        let [value, low, high] = ["value", "low", "high"].map(|key| figures[key].as_f64().unwrap());
        assert!(low < LATENCY_MS && LATENCY_MS < high, "{figures:#}");
        assert!((value - LATENCY_MS).abs() < 0.2, "{figures:#}");
    }
}
