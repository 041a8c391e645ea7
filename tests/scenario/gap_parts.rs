//! A bag with only some of its topics: diagnosed for what it holds, or told what is missing; never by a wrong name.

use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_msgs::Message;
use abbe_msgs::topics::{self, Topic};
use abbe_tests::program::{Ended, Process, command, root};
use abbe_tests::scenario::{Scenario, mcap_file};
use serde_json::Value;

use crate::rewrite::{Change, Copied, rewrite};

/// Every instrument of the machine.
const PLAN: &str = "\
title: a little of everything
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, sense: both, on_the_fly: true, repeats: 3}
  - {do: latency, feature: block_1.x, feeds_mm_min: [60.0, 240.0, 480.0], repeats: 3}
  - {do: scan, axis: X, from_mm: -150.0, to_mm: 150.0, spacing_mm: 33.0, runs: 3, feed_mm_min: 3000.0, overrun_mm: 10.0, beam: along_x}
";
/// What the plant has and the machine file lacks: play, a probe that is late, and guides whose friction turns over on its
/// way, which is a spike at the reversal.
const TRUE: [(&str, &str); 5] = [
    ("backlash", "X"),
    ("backlash", "Y"),
    ("probe_latency", ""),
    ("reversal_spike", "X"),
    ("reversal_spike", "Y"),
];
const PLAY_X: &str = "backlash X";
const PLAY_Y: &str = "backlash Y";
const LATENCY: &str = "probe_latency ";

fn is<M: Message>(message: &Copied, topic: &Topic<M>) -> bool {
    message.topic.trim_start_matches('/') == topic.name
}

fn of_grid(message: &Copied) -> bool {
    is(message, &topics::GRID_POSITION)
}

fn of_length(message: &Copied) -> bool {
    is(message, &topics::LENGTH_POSITION)
}

fn of_touches(message: &Copied) -> bool {
    is(message, &topics::PROBE_TRIGGER) || is(message, &topics::BLOCKS_MEASUREMENT)
}

fn of_thermometers(message: &Copied) -> bool {
    message.topic.contains("temperature/")
}

fn of_states(message: &Copied) -> bool {
    is(message, &topics::AXES_STATE)
}

fn of_tests(message: &Copied) -> bool {
    is(message, &topics::TEST_SEGMENT)
}

fn of_instruments(message: &Copied) -> bool {
    of_grid(message) || of_length(message) || of_touches(message)
}

fn of_motion(message: &Copied) -> bool {
    of_states(message) || of_touches(message)
}

struct Recorded {
    scenario: Scenario,
    file: PathBuf,
}

impl Recorded {
    fn new() -> Self {
        let scenario = Scenario::copy_of("gap_first");
        scenario.write("plan.yaml", PLAN);
        scenario.replace("scenario.yaml", "diagnose: true", "diagnose: false");
        // Nobody diagnoses while it is recorded.
        scenario.replace("gap_diagnosis.yaml", "least_runs: 12", "least_runs: 5000");
        let file = mcap_file(&scenario.run().join("bag"));
        Self { scenario, file }
    }

    /// Diagnoses the bag with its messages changed; the report where there is one.
    fn with(&self, change: &dyn Fn(&mut Vec<Copied>)) -> (Ended, Option<Value>) {
        let [to, json] = ["part", "part.json"].map(|name| self.scenario.out().join(name));
        let change = Change {
            messages: Some(change),
            ..Change::default()
        };
        rewrite(&self.file, &to, &change);
        let mut diagnose = command(0, &["diagnose"]);
        diagnose.arg(&to).arg("--json").arg(&json);
        diagnose.args(["--machine", &self.scenario.argument("machine.yaml")]);
        diagnose.current_dir(root());
        let ended = Process::start(diagnose).ended_within(Duration::from_secs(300));
        std::fs::remove_dir_all(&to).unwrap();
        let report = taken(&json);
        (ended, report)
    }
}

fn taken(json: &Path) -> Option<Value> {
    let text = std::fs::read_to_string(json).ok()?;
    std::fs::remove_file(json).unwrap();
    Some(serde_json::from_str(&text).unwrap())
}

/// What is named, or first of a set, as a play is that was measured at one feed; every name is true.
fn names(report: &Value) -> Vec<String> {
    let is_true = |one: &Value| {
        let pair = ["effect", "axis"].map(|key| one[key].as_str().unwrap());
        TRUE.contains(&pair.into())
    };
    let causes = report["causes"].as_array().unwrap().iter();
    let named = causes.filter(|cause| cause["status"] != "surrogate");
    let name = |cause: &Value| {
        assert!(is_true(cause), "{cause:#}");
        let of = |key: &str| cause[key].as_str().unwrap();
        format!("{} {}", of("effect"), of("axis"))
    };
    named.map(name).collect()
}

#[test]
fn a_bag_with_some_of_its_topics_is_diagnosed_for_what_it_holds_and_never_by_a_wrong_name() {
    let recorded = Recorded::new();
    type Part = fn(&Copied) -> bool;
    let diagnosed: [(&str, Part, &[&str]); 6] = [
        ("grid", of_grid, &[LATENCY]),
        ("length", of_length, &[PLAY_X, PLAY_Y, LATENCY]),
        ("touches", of_touches, &[PLAY_Y]),
        ("thermometers", of_thermometers, &[PLAY_X, PLAY_Y, LATENCY]),
        ("instruments", of_instruments, &[]),
        ("states", of_states, &[]),
    ];
    for (name, part, wanted) in diagnosed {
        let (ended, report) = recorded.with(&|all| all.retain(|m| !part(m)));
        // Without states all that was read lies in a hole.
        let code = if name == "states" { 3 } else { 0 };
        assert_eq!(
            ended.status.code(),
            Some(code),
            "without {name}: {}",
            ended.said
        );
        let named = names(&report.unwrap());
        eprintln!("without {name}: {named:?}");
        for one in wanted {
            assert!(named.iter().any(|n| n == one), "without {name}: {named:?}");
        }
    }
    let missing: [(Part, &str); 2] = [
        (of_tests, "record test/segment"),
        (of_motion, "record axes/state"),
    ];
    for (part, words) in missing {
        let (ended, report) = recorded.with(&|all| all.retain(|m| !part(m)));
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        assert!(ended.said.contains(words), "{words}: {}", ended.said);
        assert_eq!(report, None);
    }
}
