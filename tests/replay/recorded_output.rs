//! What a bag has of results is held against them, and is never what they are computed from.

use std::collections::BTreeMap;
use std::path::Path;

use abbe_msgs::topics::{self, Origin};
use recorder::{Bag, Event, Order};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use crate::contract::{changed, changed_of, check, said, short_run};
use crate::rewrite::{Change, Copied};

fn is_computed(topic: &str) -> bool {
    let name = topic.trim_start_matches('/');
    let mut entries = topics::all().iter();
    entries.any(|entry| entry.origin == Origin::Computed && entry.name == name)
}

/// The short run without any result.
pub fn stripped() -> TempDir {
    stripped_of(short_run(), &is_computed)
}

/// A bag without the topics that are results.
pub fn stripped_of(bag: &Path, is_result: &dyn Fn(&str) -> bool) -> TempDir {
    changed_of(
        bag,
        &Change {
            without: Some(is_result),
            ..Change::default()
        },
    )
}

/// Number and SHA-256 of the recorded results, by topic, as `abbe check` sums up what a bag does not have.
pub fn sums(bag: &Path, is_result: &dyn Fn(&str) -> bool) -> Value {
    let bag = Bag::open(bag).unwrap();
    let mut sums = BTreeMap::<String, (u64, Sha256)>::new();
    let mut messages = bag.messages(Order::File);
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}")
        };
        let topic = &bag.topic(message.topic).topic;
        if is_result(topic) {
            let (count, sum) = sums.entry(topic.clone()).or_default();
            *count += 1;
            sum.update(message.log_time_nanos.to_le_bytes());
            sum.update((message.data.len() as u64).to_le_bytes());
            sum.update(message.data);
        }
    }
    let told = sums.into_iter().map(|(topic, (messages, sum))| {
        let digits = sum.finalize();
        let sha256: String = digits.iter().map(|byte| format!("{byte:02x}")).collect();
        (topic, json!({"messages": messages, "sha256": sha256}))
    });
    told.collect()
}

#[test]
fn replay_recorded_output_is_not_read() {
    let bag = stripped();
    let kept = Bag::open(bag.path()).unwrap();
    assert!(!kept.topics().iter().any(|info| is_computed(&info.topic)));
    let (code, outcome) = check(bag.path());
    let expected = sums(short_run(), &is_computed);
    assert!(expected.as_object().unwrap().len() >= 5, "{expected:#}");
    assert_eq!(outcome["not_in_bag"], expected, "{outcome:#}");
    // Nothing was held against anything, so nothing is said to be equal.
    assert_eq!((code, &outcome["equal"]), (1, &json!(false)));
    assert_eq!(outcome["compared"], json!({}));
    let words = said(bag.path());
    assert!(words.contains("nothing to compare"), "{words}");
}

#[test]
fn replay_of_spoiled_results_changes_no_other() {
    let spoil = |messages: &mut Vec<Copied>| {
        for topic in ["/latency", "/blocks/measurement", "/thermal/model"] {
            let first = messages.iter_mut().find(|m| m.topic == topic).unwrap();
            let middle = first.data.len() / 2;
            first.data[middle] ^= 1;
        }
    };
    let bag = changed(&Change {
        messages: Some(&spoil),
        ..Change::default()
    });
    let (code, outcome) = check(bag.path());
    assert_eq!(code, 1, "{outcome:#}");
    let differing = |topic: &str| outcome["compared"][topic]["differing"].as_u64().unwrap();
    for topic in ["/latency", "/blocks/measurement", "/thermal/model"] {
        assert_eq!(differing(topic), 1, "{topic}: {outcome:#}");
    }
    assert_eq!(differing("/compensation"), 0, "{outcome:#}");
}
