//! One wrong stamp in a recording: every verb leaves the same message out, names topic, reason and number, ends with 3, and
//! says of everything else what it says without that message.

use std::path::Path;

use abbe_tests::program::root;
use serde_json::Value;
use tempfile::TempDir;

use crate::contract::changed_of;
use crate::rewrite::{Change, Copied};
use crate::spoiled::{report, run};

/// What is done to the seconds of a stamp.
type Spoil = (&'static str, fn(i32) -> i32);
const SPOILS: [Spoil; 4] = [
    ("2035", |_| 2_051_222_400),
    ("1970", |_| 0),
    ("back", |sec| sec - 500),
    ("a day ahead", |sec| sec + 86_400),
];

/// A bag in which the stamp of one message of `topic`, that in the middle, is wrong; or in which it is missing.
fn changed(bag: &str, topic: &str, spoil: Option<fn(i32) -> i32>) -> TempDir {
    let change = |messages: &mut Vec<Copied>| {
        let of_topic = messages.iter().enumerate();
        let of_topic = of_topic.filter(|(_, message)| message.topic == topic);
        let places: Vec<usize> = of_topic.map(|(place, _)| place).collect();
        let place = places[places.len() / 2];
        let Some(spoil) = spoil else {
            messages.remove(place);
            return;
        };
        let sec = messages[place].data[4..8].try_into().unwrap();
        let sec = spoil(i32::from_le_bytes(sec));
        messages[place].data[4..8].copy_from_slice(&sec.to_le_bytes());
    };
    changed_of(
        &root().join("bags").join(bag),
        &Change {
            messages: Some(&change),
            ..Change::default()
        },
    )
}

fn is_told(left_out: &Value, topic: &str, how: &str) {
    assert_eq!(left_out["topic"], topic, "{how}: {left_out:#}");
    assert_eq!(left_out["reason"], "other_time", "{how}: {left_out:#}");
    assert_eq!(left_out["messages"], 1, "{how}: {left_out:#}");
    assert!(left_out["first"]["number"].as_u64().unwrap() > 1, "{how}");
    let what = left_out["what"].as_str().unwrap();
    assert!(what.contains("header.stamp = "), "{how}: {what}");
}

#[test]
fn a_report_leaves_out_a_message_with_a_wrong_stamp_of_every_topic() {
    for (bag, topic) in [
        ("grid_circles", "/axes/state"),
        ("grid_circles", "/grid/position"),
        ("cold_reference", "/probe/point"),
        ("cold_reference", "/temperature/bed"),
    ] {
        let without = report(changed(bag, topic, None).path());
        for (how, spoil) in SPOILS {
            let found = report(changed(bag, topic, Some(spoil)).path());
            assert_eq!(found.code, 3, "{how} {topic}: {}", found.said);
            is_told(&found.json["loss"]["left_out"][0], topic, how);
            assert_eq!(found.json["tests"], without.json["tests"], "{how} {topic}");
            let line = format!("abbe: {topic}: 1 of ");
            assert!(found.said.contains(&line), "{how}: {}", found.said);
        }
    }
}

fn json_of(verb: &[&str], bag: &Path) -> (i32, String, Value) {
    let bag = bag.display().to_string();
    let (code, said) = run(&[&verb[..1], &[bag.as_str()], &verb[1..]].concat());
    let ends = said.find('{').zip(said.find("\n}"));
    let (begin, end) = ends.unwrap_or_else(|| panic!("{said}"));
    let json = serde_json::from_str(&said[begin..end + 2]).unwrap();
    (code, said, json)
}

#[test]
fn a_diagnosis_goes_on_without_a_message_with_a_wrong_stamp() {
    let machine = root().join("launch_configs/gap_first/machine.yaml");
    let machine = machine.display().to_string();
    let verb = ["diagnose", "--machine", &machine, "--json", "-"];
    let topic = "/axes/state";
    let diagnosed = |spoil| {
        let (code, said, mut json) =
            json_of(&verb, changed("rosbag2_touches", topic, spoil).path());
        json["runtime_s"] = Value::Null;
        json["inputs"] = Value::Null;
        let loss = json.as_object_mut().unwrap().remove("loss");
        (code, said, json, loss)
    };
    let without = diagnosed(None);
    assert_eq!(without.0, 0, "{}", without.1);
    for (how, spoil) in SPOILS {
        let (code, said, json, loss) = diagnosed(Some(spoil));
        assert_eq!(code, 3, "{how}: {said}");
        is_told(&loss.unwrap()[0]["left_out"][0], topic, how);
        assert_eq!(json, without.2, "{how}");
    }
}

#[test]
fn a_check_leaves_out_an_input_with_a_wrong_stamp() {
    for (how, spoil) in SPOILS {
        for topic in ["/axes/state", "/probe/trigger"] {
            let bag = changed("cold_reference", topic, Some(spoil));
            let (code, said, json) = json_of(&["check", "--json"], bag.path());
            assert_eq!(code, 3, "{how} {topic}: {said}");
            is_told(&json["loss"]["left_out"][0], topic, how);
        }
    }
}

#[test]
fn topics_whose_stamps_are_all_two_hours_off_are_named_by_report_and_diagnosis() {
    let verbs = ["report", "diagnose"];
    for prefix in ["/temperature/", "/probe/trigger", "/test/segment"] {
        let change = |messages: &mut Vec<Copied>| {
            for message in messages
                .iter_mut()
                .filter(|it| it.topic.starts_with(prefix))
            {
                let sec = message.data[4..8].try_into().unwrap();
                let sec = i32::from_le_bytes(sec) + 7_200;
                message.data[4..8].copy_from_slice(&sec.to_le_bytes());
            }
        };
        let bag = changed_of(
            &root().join("bags/cold_reference"),
            &Change {
                messages: Some(&change),
                ..Change::default()
            },
        );
        let bag = bag.path().display().to_string();
        let words = "its stamps are 2.0 h later than those of the other topics";
        for verb in verbs {
            let (code, said) = run(&[verb, &bag]);
            assert!(said.contains(words), "{verb} {prefix}: {said}");
            assert_ne!(code, 0, "{verb} {prefix}: {said}");
            let is_report = verb == "report";
            assert!(code == 3 || !is_report, "{verb} {prefix}: {said}");
            assert!(!said.contains("No temperature was recorded"), "{said}");
        }
    }
}
