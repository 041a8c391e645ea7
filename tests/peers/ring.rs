//! A recorder that keeps the last minutes, filled and asked by a node on Cyclone DDS.

use std::path::Path;
use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::cyclone::{Cyclone, end};
use abbe_tests::program::{Process, command, domain};
use abbe_tests::python::interpreter;
use recorder::{Bag, Event, Order};
use serde_json::json;

use crate::wire::{now, stamp};

const SAVE: &str = "/recorder/save";
/// Longer than a save of a few messages takes.
const PATIENCE: Duration = Duration::from_secs(20);

/// Messages of a bag by topic, in their order, once it is whole.
fn topics_of(bag: &Path) -> Vec<String> {
    let began = Instant::now();
    loop {
        if let Ok(bag) = Bag::open(bag) {
            let mut messages = bag.messages(Order::File);
            let (mut topics, mut whole) = (Vec::new(), true);
            while let Some(event) = messages.next_event() {
                match event {
                    Event::Message(message) => topics.push(bag.topic(message.topic).topic.clone()),
                    Event::Loss(_) => whole = false,
                }
            }
            if whole && !topics.is_empty() {
                return topics;
            }
        }
        assert!(began.elapsed() < PATIENCE, "{} is not there", bag.display());
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn count(topics: &[String], topic: &str) -> usize {
    let absolute = format!("/{}", topic.trim_start_matches('/'));
    topics.iter().filter(|name| **name == absolute).count()
}

#[test]
fn the_last_seconds_are_saved_when_asked_for_and_when_an_error_begins() {
    let Some(python) = interpreter("the last seconds are saved") else {
        return;
    };
    let (home, domain) = (tempfile::tempdir().unwrap(), domain(6));
    let folder = home.path().join("kept");
    let mut record = command(domain, &["record", "--ring", "2", "--save-on-error"]);
    record.arg("-o").arg(&folder);
    record.args(["--exclude", "/rosout", "--exclude", "/joint_*"]);
    let recorder = Process::start(record);
    let (latency, diagnostics) = (&topics::LATENCY, &topics::DIAGNOSTICS);
    let writers = [end(latency), end(diagnostics), end(&topics::JOINT_STATES)];
    let mut voice = Cyclone::start(&python, domain, &[], &writers);
    for topic in [latency.name, diagnostics.name] {
        voice.matched_after_s(topic);
    }
    let mut asking = Cyclone::asking(&python, domain, &[(SAVE, "std_srvs/srv/Trigger")], &[]);
    asking.matched_after_s(SAVE);
    std::thread::sleep(Duration::from_millis(500));
    let header = || json!({"stamp": stamp(now()), "frame_id": ""});
    voice.write(
        latency.name,
        &json!({"header": header(), "latency_s": 0.0037}),
    );
    let healthy = |level: u8| {
        let status = json!({"level": level, "name": "/mill: spindle", "message": "hot"});
        json!({"header": header(), "status": [status]})
    };
    // Until what is latched has long left the window.
    for _ in 0..35 {
        voice.write(diagnostics.name, &healthy(0));
        voice.write(topics::JOINT_STATES.name, &json!({"header": header()}));
        std::thread::sleep(Duration::from_millis(100));
    }
    asking.ask(SAVE, 1, &json!({}));
    let answer = asking.reply(SAVE, 1);
    assert_eq!(answer["success"], true, "{answer}");
    let said = answer["message"].as_str().unwrap();
    eprintln!("{said}");
    assert!(said.contains("kept_0"), "{said}");
    let saved = topics_of(&folder.join("kept_0"));
    assert_eq!(
        saved[0], "/latency",
        "latched, it is there although it is old"
    );
    assert_eq!(count(&saved, latency.name), 1);
    let within = count(&saved, diagnostics.name);
    // Twenty of ours in two seconds, and the recorder's own.
    assert!((17..=26).contains(&within), "{within}");
    assert_eq!(count(&saved, "/rosout") + count(&saved, "/joint_states"), 0);
    for level in [2, 2, 2] {
        voice.write(diagnostics.name, &healthy(level));
        std::thread::sleep(Duration::from_millis(300));
    }
    topics_of(&folder.join("kept_1"));
    std::thread::sleep(Duration::from_secs(1));
    assert!(
        !folder.join("kept_2").exists(),
        "an error that stands is saved once"
    );
    voice.stop();
    asking.stop();
    recorder.stop();
}
