//! What is wrong with a recording is counted and said, and costs no more of the diagnosis than it must: the same circles
//! with something broken in their bag.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use abbe_msgs::msg::{AxisState, GridSample, TestSegment};
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, from_cdr, to_cdr};
use abbe_tests::program::{command, root};
use abbe_tests::scenario::{Scenario, mcap_file};
use serde_json::Value;

use crate::rewrite::{Change, Copied, rewrite};

/// Two circles, three times each in both senses.
const CIRCLES: &str = "\
title: circles
steps:
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 50.0, feed_mm_min: 1500.0, sense: both, on_the_fly: true, repeats: 3}
  - {do: grid, placement: middle, trajectory: circle, radius_mm: 80.0, feed_mm_min: 2400.0, sense: both, on_the_fly: true, repeats: 3}
";
const RUNS: u64 = 12;
/// After this a diagnosis is taken to hang; and the most memory that it may hold.
const LIMIT: Duration = Duration::from_secs(900);
const MOST_MIB: f64 = 1024.0;
/// How long the machine stands after each circle so that the bag is of ten hours, s.
const STANDS_S: u64 = 3_000;

struct Recorded {
    scenario: Scenario,
    bag: PathBuf,
}

/// A diagnosis with what it took.
struct Diagnosed {
    code: i32,
    report: Value,
    said: String,
    took: Duration,
    peak_mib: f64,
}

impl Recorded {
    fn new() -> Self {
        let scenario = Scenario::copy_of("gap_wear");
        scenario.write("plan.yaml", CIRCLES);
        scenario.replace("scenario.yaml", "diagnose: true", "diagnose: false");
        scenario.replace("gap_diagnosis.yaml", "least_runs: 8", "least_runs: 5000");
        // The play is there from the start.
        scenario.replace("plant.yaml", "after_s: 400.0", "after_s: 0.1");
        let bag = scenario.run().join("bag");
        Self { scenario, bag }
    }

    /// Diagnoses the bag with its messages changed.
    fn with(&self, name: &str, change: &dyn Fn(&mut Vec<Copied>)) -> Diagnosed {
        let to = self.scenario.out().join(name);
        let change = Change {
            messages: Some(change),
            ..Change::default()
        };
        rewrite(&mcap_file(&self.bag), &to, &change);
        let found = diagnosed(&to, &self.scenario.out().join(format!("{name}.json")));
        let [width_um, ..] = play(&found.report);
        eprintln!(
            "{name}: {width_um:.2} um, {:.1} s, {:.0} MiB; {}",
            found.took.as_secs_f64(),
            found.peak_mib,
            found
                .said
                .lines()
                .rev()
                .take(6)
                .collect::<Vec<_>>()
                .join(" | ")
        );
        found
    }
}

/// Runs `abbe diagnose`, looking at what it holds.
fn diagnosed(bag: &Path, json: &Path) -> Diagnosed {
    let mut diagnose = command(0, &["diagnose"]);
    diagnose.arg(bag).arg("--json").arg(json);
    diagnose.current_dir(root());
    let logs = ["page", "log"].map(|end| json.with_extension(end));
    let [page, log] = logs.each_ref().map(|path| File::create(path).unwrap());
    diagnose.stdout(page).stderr(log);
    let began = Instant::now();
    let mut child = diagnose.spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak_mib = 0.0_f64;
    let code = loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let held = text.lines().find(|line| line.starts_with("VmHWM:"));
        let kib = held.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
        peak_mib = peak_mib.max(kib.unwrap_or(0.0) / 1024.0);
        if let Some(code) = child.try_wait().unwrap() {
            break code;
        }
        assert!(began.elapsed() < LIMIT, "{}", bag.display());
        std::thread::sleep(Duration::from_millis(20));
    };
    let said = logs
        .map(|path| std::fs::read_to_string(path).unwrap())
        .concat();
    let code = code.code().unwrap_or(-1);
    let has_lost = said.contains("Lost:");
    assert_eq!(code, if has_lost { 3 } else { 0 }, "{said}");
    let text = std::fs::read_to_string(json).unwrap();
    Diagnosed {
        code,
        report: serde_json::from_str(&text).unwrap(),
        said,
        took: began.elapsed(),
        peak_mib,
    }
}

/// Size of the named play of X with its interval, µm.
fn play(report: &Value) -> [f64; 3] {
    let causes = report["causes"].as_array().unwrap();
    let play = causes
        .iter()
        .find(|c| c["effect"] == "backlash" && c["axis"] == "X" && c["status"] == "named");
    let play = play.unwrap_or_else(|| panic!("{causes:#?}"));
    ["value", "low", "high"].map(|key| play["parameters"][0][key].as_f64().unwrap())
}

fn runs(found: &Diagnosed) -> u64 {
    found.report["inputs"]["bags"][0]["runs"].as_u64().unwrap()
}

fn is<M: Message>(message: &Copied, topic: &Topic<M>) -> bool {
    message.topic.trim_start_matches('/') == topic.name
}

/// Changes what a message says.
fn edit<M: Message>(message: &mut Copied, change: impl FnOnce(&mut M)) {
    let mut decoded: M = from_cdr(&message.data).unwrap();
    change(&mut decoded);
    message.data = to_cdr(&decoded);
}

/// Moves the stamp that a message begins with.
fn shift(message: &mut Copied, seconds: i64) {
    // After the four bytes of the encapsulation stand the header's seconds.
    let at = 4..8;
    let stamp = i32::from_le_bytes(message.data[at.clone()].try_into().unwrap());
    let moved = i32::try_from(i64::from(stamp) + seconds).unwrap();
    message.data[at].copy_from_slice(&moved.to_le_bytes());
}

fn is_stamped(message: &Copied) -> bool {
    is(message, &topics::AXES_STATE)
        || is(message, &topics::GRID_POSITION)
        || is(message, &topics::TEST_SEGMENT)
        || message.topic.contains("temperature/")
}

/// Messages of ten hours: the machine stands after each circle, told once a second.
fn of_ten_hours(messages: &mut Vec<Copied>) {
    let mut all = Vec::with_capacity(messages.len() + 40_000);
    let (mut late_s, mut last) = (0_u64, None::<Copied>);
    for mut message in messages.drain(..) {
        let later = |message: &mut Copied, by_s: u64| {
            message.header.log_time += by_s * 1_000_000_000;
            message.header.publish_time += by_s * 1_000_000_000;
            if is_stamped(message) {
                shift(message, i64::try_from(by_s).unwrap());
            }
            if is(message, &topics::AXES_STATE) {
                let by_s = i32::try_from(by_s).unwrap();
                edit(message, |s: &mut AxisState| s.controller_stamp.sec += by_s);
            }
        };
        later(&mut message, late_s);
        let is_end = is(&message, &topics::TEST_SEGMENT)
            && !from_cdr::<TestSegment>(&message.data).unwrap().begin;
        if is(&message, &topics::AXES_STATE) {
            last = Some(message.clone());
        }
        all.push(message);
        if let (true, Some(last)) = (is_end, &last) {
            for second in 1..STANDS_S {
                let mut standing = last.clone();
                later(&mut standing, second);
                all.push(standing);
            }
            late_s += STANDS_S;
        }
    }
    *messages = all;
}

/// Nothing of the thermometers, and a clock that is set back in the middle.
fn cold_and_set_back(messages: &mut Vec<Copied>) {
    messages.retain(|message| !message.topic.contains("temperature/"));
    let from = messages.len() / 2;
    let later = messages[from..].iter_mut();
    for message in later.filter(|message| is_stamped(message)) {
        shift(message, -100);
    }
}

/// Single readings of the grid encoder that are far off, and a while in which it stands.
fn off_and_standing(messages: &mut [Copied]) {
    let readings = messages.iter_mut();
    let mut readings: Vec<&mut Copied> = readings
        .filter(|message| is(message, &topics::GRID_POSITION))
        .collect();
    for message in readings.iter_mut().skip(97).step_by(997) {
        edit(message, |s: &mut GridSample| s.u_m += 40e-6);
    }
    let first: GridSample = from_cdr(&readings[3_000].data).unwrap();
    for message in &mut readings[3_000..5_000] {
        edit(message, |s: &mut GridSample| {
            [s.u_m, s.v_m] = [first.u_m, first.v_m];
        });
    }
}

/// Where the plate ends for the first coordinate, m: within the second circle.
const END_M: f64 = 0.065;

/// A first coordinate that stays at the end of its range, while the second one goes on.
fn saturated(messages: &mut [Copied]) {
    let readings = messages.iter_mut();
    for message in readings.filter(|message| is(message, &topics::GRID_POSITION)) {
        edit(message, |s: &mut GridSample| {
            s.u_m = s.u_m.clamp(-END_M, END_M);
        });
    }
}

/// Readings of the grid's first coordinate that were left out as outliers.
fn outliers(found: &Diagnosed) -> usize {
    let mut lines = found.said.lines();
    let line = lines.find(|line| line.starts_with("grid.u: ") && line.contains("outliers"));
    let number = line.and_then(|line| line.split_whitespace().nth(1));
    number.map_or(0, |number| number.parse().unwrap())
}

#[test]
fn what_is_broken_in_a_bag_is_counted_and_the_play_is_named_all_the_same() {
    let recorded = Recorded::new();
    let whole = recorded.with("whole", &|_| {});
    let [width_um, low_um, high_um] = play(&whole.report);
    assert_eq!((whole.code, runs(&whole)), (0, RUNS));
    let said = |found: &Diagnosed, words: &str| {
        let [other_um, ..] = play(&found.report);
        let off_um = (other_um - width_um).abs();
        assert!(off_um < 2.0 * (high_um - low_um), "{other_um} {width_um}");
        assert!(found.said.contains(words), "{words}: {}", found.said);
    };

    let jumped = recorded.with("cold_and_set_back", &cold_and_set_back);
    said(&jumped, "1 times the clock jumped back");
    assert!(runs(&jumped) >= RUNS - 1);

    let stood = recorded.with("off_and_standing", &|messages| off_and_standing(messages));
    said(&stood, "readings stood while the axes moved");
    assert_eq!(stood.code, 3, "{}", stood.said);
    assert!(
        outliers(&stood) > outliers(&whole) + 20,
        "{}",
        outliers(&stood)
    );

    let clamped = recorded.with("saturated", &|messages| saturated(messages));
    said(
        &clamped,
        "readings stood in one coordinate that was to move",
    );
    assert_eq!(clamped.code, 3, "{}", clamped.said);
    let named = clamped.report["causes"].as_array().unwrap().iter();
    let named: Vec<_> = named
        .filter(|cause| cause["status"] != "surrogate")
        .collect();
    let is_true = |cause: &&Value| {
        let effect = cause["effect"].as_str().unwrap();
        ["backlash", "reversal_spike"].contains(&effect)
    };
    assert!(named.iter().all(is_true), "{named:#?}");

    let long = recorded.with("ten_hours", &of_ten_hours);
    said(&long, "");
    assert_eq!((long.code, runs(&long)), (0, RUNS));
    assert!(long.peak_mib < MOST_MIB, "{} MiB", long.peak_mib);
}
