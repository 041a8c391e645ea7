//! What a replay must do, and what it must notice.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

use abbe_msgs::msg::ProbeTrigger;
use abbe_msgs::{Message, from_cdr, to_cdr};
use abbe_tests::program::{Process, command};
use abbe_tests::scenario::{SHORT_PLAN, Scenario, mcap_file};
use serde_json::Value;
use tempfile::TempDir;

use crate::rewrite::{Change, Copied, rewrite};
use crate::spoiled::report;

/// A parameter of the thermal model as it stands in the bag, and another value of it.
const CHANGED: (&str, &str) = ("validity_min: 40.0", "validity_min: 41.0");

/// Exit code and JSON of `abbe check --json`; what was said instead where there is no JSON.
pub fn check(bag: &Path) -> (i32, Value) {
    check_with(bag, &[])
}

/// [`check`] with more arguments.
pub fn check_with(bag: &Path, more: &[String]) -> (i32, Value) {
    let bag = bag.display().to_string();
    let mut command = command(0, &["check", "--json", &bag]);
    command.args(more).stderr(std::process::Stdio::null());
    let ended = Process::start(command).ended_within(Duration::from_secs(300));
    let json = serde_json::from_str(&ended.said).unwrap_or(Value::Null);
    (ended.status.code().unwrap(), json)
}

/// What `abbe check` says on the standard error.
pub fn said(bag: &Path) -> String {
    let bag = bag.display().to_string();
    let ended = Process::start(command(0, &["check", &bag])).ended_within(Duration::from_secs(300));
    ended.said
}

/// A scenario and the bag of its run.
pub type Run = (Scenario, PathBuf);

/// The bag of a scenario that is run once for all tests.
pub fn recorded(run: &'static OnceLock<Run>, scenario: fn() -> Scenario) -> &'static Path {
    let (_, bag) = run.get_or_init(|| {
        let scenario = scenario();
        let bag = scenario.run().join("bag");
        (scenario, bag)
    });
    bag
}

/// A short run of `first_run`.
pub fn short_run() -> &'static Path {
    static RUN: OnceLock<Run> = OnceLock::new();
    recorded(&RUN, || {
        let scenario = Scenario::copy_of("first_run");
        scenario.write("plan.yaml", SHORT_PLAN);
        scenario
    })
}

/// A changed copy of the short run.
pub fn changed(change: &Change<'_>) -> TempDir {
    changed_of(short_run(), change)
}

/// A changed copy of a bag of one file.
pub fn changed_of(bag: &Path, change: &Change<'_>) -> TempDir {
    let home = tempfile::tempdir().unwrap();
    rewrite(&mcap_file(bag), home.path(), change);
    home
}

/// A copy of a bag in which message `nth` of `topic`, counted from 0, is changed.
pub fn with_another(bag: &Path, (topic, nth): (&str, usize), change: fn(&mut Vec<u8>)) -> TempDir {
    let change = |messages: &mut Vec<Copied>| {
        let mut of_topic = messages.iter_mut().filter(|m| m.topic == topic);
        change(&mut of_topic.nth(nth).unwrap().data);
    };
    changed_of(
        bag,
        &Change {
            messages: Some(&change),
            ..Change::default()
        },
    )
}

/// Decodes a message, changes it and encodes it again.
pub fn edited<M: Message>(data: &mut Vec<u8>, edit: impl FnOnce(&mut M)) {
    let mut message: M = from_cdr(data).unwrap();
    edit(&mut message);
    *data = to_cdr(&message);
}

/// Latched positions of a touch, changed by one unit in the last place.
pub fn touch_by_one_ulp(data: &mut Vec<u8>) {
    edited(data, |touch: &mut ProbeTrigger| {
        for latched in &mut touch.latched {
            *latched = latched.next_up();
        }
    });
}

/// Messages of a topic that were compared, or that differ, in what [`check`] says.
pub fn count(outcome: &Value, topic: &str, key: &str) -> u64 {
    outcome["compared"][topic][key].as_u64().unwrap_or(0)
}

#[test]
fn replay_from_inputs_reproduces_outputs() {
    let (code, outcome) = check(short_run());
    assert_eq!(code, 0, "{outcome:#}");
    assert_eq!(outcome["equal"], true);
    let compared = outcome["compared"].as_object().unwrap();
    for topic in [
        "/blocks/measurement",
        "/compensation",
        "/latency",
        "/probe/point",
        "/thermal/model",
    ] {
        let messages = compared[topic]["messages"].as_u64().unwrap();
        eprintln!("{topic}: {messages} messages");
        assert!(messages > 0, "{topic}");
    }
    // The compensation was switched on by a service call, which is in the bag.
    assert!(compared["/compensation"]["messages"].as_u64().unwrap() > 1_000);
}

#[test]
fn replay_of_a_copy_is_equal() {
    let copy = changed(&Change::default());
    let (code, outcome) = check(copy.path());
    assert_eq!(code, 0, "{outcome:#}");
}

#[test]
fn replay_of_a_bag_in_several_files_and_without_what_was_left_out_is_equal() {
    let scenario = Scenario::copy_of("first_run");
    scenario.write("plan.yaml", SHORT_PLAN);
    let recording = "recording: {max_file_s: 60.0, compression: lz4, exclude: [/tf, /joint_*]}";
    scenario.replace("scenario.yaml", "recording: {exclude: [/tf]}", recording);
    let bag = scenario.run().join("bag");
    let (code, outcome) = check(&bag);
    assert_eq!(code, 0, "{outcome:#}");
    let bag = recorder::Bag::open(&bag).unwrap();
    assert!(bag.files().count() > 1);
    let topics: Vec<_> = bag.topics().iter().map(|one| one.topic.as_str()).collect();
    assert!(
        topics.contains(&"/axes/state") && topics.contains(&"/axis_compensation/transition_event")
    );
    assert!(!topics.contains(&"/joint_states"), "{topics:?}");
}

#[test]
fn replay_notices_one_ulp_of_an_input() {
    let bag = with_another(short_run(), ("/probe/trigger", 0), touch_by_one_ulp);
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    let first = &outcome["first_difference"];
    eprintln!("{first:#}");
    assert_eq!(first["topic"], "/probe/point");
    assert_eq!(first["discrepancy"]["kind"], "field");
    assert!(first["discrepancy"]["ulps"].as_u64().unwrap() < 100);
}

#[test]
fn replay_notices_the_order_of_two_events() {
    let swap = |messages: &mut Vec<Copied>| {
        let touches: Vec<usize> = (0..messages.len())
            .filter(|place| messages[*place].topic == "/probe/trigger")
            .collect();
        let other = std::mem::take(&mut messages[touches[1]].data);
        messages[touches[1]].data = std::mem::replace(&mut messages[touches[0]].data, other);
    };
    let bag = changed(&Change {
        messages: Some(&swap),
        ..Change::default()
    });
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
}

#[test]
fn replay_notices_a_message_more_and_a_message_less() {
    let without = |messages: &mut Vec<Copied>| {
        let first = messages.iter().position(|m| m.topic == "/probe/point");
        messages.remove(first.unwrap());
    };
    let bag = changed(&Change {
        messages: Some(&without),
        ..Change::default()
    });
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    let kind = &outcome["first_difference"]["discrepancy"]["kind"];
    assert!(
        ["not_recorded", "order", "field"].contains(&kind.as_str().unwrap()),
        "{kind}"
    );
    let without = |messages: &mut Vec<Copied>| {
        let first = messages.iter().position(|m| m.topic == "/probe/trigger");
        messages.remove(first.unwrap());
    };
    let bag = changed(&Change {
        messages: Some(&without),
        ..Change::default()
    });
    assert_eq!(check(bag.path()).0, 1);
}

#[test]
fn a_topic_that_was_taken_out_whole_is_named_with_both_counts() {
    let is_latency = |topic: &str| topic == "/latency";
    for keeps_count in [true, false] {
        let bag = changed(&Change {
            without: Some(&is_latency),
            keeps_count,
            ..Change::default()
        });
        let (code, outcome) = check(bag.path());
        assert_eq!(code, if keeps_count { 3 } else { 0 }, "{outcome:#}");
        let reported = report(bag.path());
        assert_eq!(reported.code == 3, keeps_count, "{}", reported.said);
        for said in [said(bag.path()), reported.said] {
            let is_named = said.contains(" messages were recorded, and the files hold ")
                && said.contains("(/latency 0 of 1)");
            assert_eq!(is_named, keeps_count, "{said}");
        }
    }
}

#[test]
fn replay_notices_a_parameter() {
    let attachment = Some(("params/thermal_model.yaml", CHANGED.0, CHANGED.1));
    let bag = changed(&Change {
        attachment,
        ..Change::default()
    });
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    let bag = changed(&Change {
        attachment,
        keeps_hash: true,
        ..Change::default()
    });
    let words = said(bag.path());
    assert!(words.contains("params/thermal_model.yaml"), "{words}");
}

#[test]
fn replay_of_a_cut_bag_is_equal_up_to_the_cut_and_says_so() {
    let home = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(mcap_file(short_run())).unwrap();
    std::fs::write(
        home.path().join("bag_0.mcap"),
        &bytes[..bytes.len() * 3 / 5],
    )
    .unwrap();
    let (code, outcome) = check(home.path());
    assert_eq!(code, 3, "{outcome:#}");
    assert_eq!(outcome["equal"], true);
    assert_eq!(outcome["losses"].as_array().unwrap().len(), 1);
}

#[test]
fn what_check_cannot_understand_is_usage() {
    for arguments in [
        &["check"][..],
        &["check", "--no-such-flag", "bag"],
        &["check", "one", "two"],
        &["check", "bag", "--resume-after", "half"],
    ] {
        let ended = Process::start(command(0, arguments)).ended_within(Duration::from_secs(60));
        assert_eq!(
            ended.status.code(),
            Some(2),
            "{arguments:?}: {}",
            ended.said
        );
        assert!(ended.said.contains("try '--help'"), "{}", ended.said);
    }
}
