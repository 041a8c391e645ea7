//! A replay that fresh nodes take over in its middle.

use std::path::Path;

use abbe_msgs::topics::{self, Origin};
use recorder::{Bag, Event, Order};

use crate::contract::{changed, check, check_with, short_run};
use crate::old_bags::kept;
use crate::rewrite::Change;

/// Messages in a bag.
fn messages(bag: &Path) -> u64 {
    let bag = Bag::open(bag).unwrap();
    let mut messages = bag.messages(Order::File);
    let mut count = 0;
    while let Some(event) = messages.next_event() {
        count += u64::from(matches!(event, Event::Message(_)));
    }
    count
}

/// Messages up to the last one that came from outside.
fn up_to_the_last_input(bag: &Path) -> u64 {
    let bag = Bag::open(bag).unwrap();
    let is_raw = |topic: &str| {
        let is_of =
            |name: &str| topic.ends_with(name) || (name.ends_with('/') && topic.contains(name));
        let known = topics::all().iter().find(|it| is_of(it.name));
        known.is_some_and(|it| it.origin == Origin::Raw)
    };
    let mut messages = bag.messages(Order::File);
    let (mut count, mut last) = (0, 0);
    while let Some(event) = messages.next_event() {
        if let Event::Message(message) = event {
            count += 1;
            if is_raw(&bag.topic(message.topic).topic) {
                last = count;
            }
        }
    }
    last
}

/// Holds a bag that fresh nodes take over after these numbers of messages against the whole replay.
pub fn resumes(bag: &Path, after: &[u64]) {
    let straight = check(bag);
    assert_eq!(straight.0, 0, "{:#}", straight.1);
    let more: Vec<String> = after
        .iter()
        .flat_map(|after| ["--resume-after".to_owned(), after.to_string()])
        .collect();
    let resumed = check_with(bag, &more);
    assert!(resumed == straight, "{}: {:#}", bag.display(), resumed.1);
}

/// At so many places that share no period with the machine's messages: also amid the messages of one instant.
pub fn resumes_at(bag: &Path, places: u64) {
    let all = messages(bag);
    let after: Vec<u64> = (0..places).map(|place| place * all / places).collect();
    resumes(bag, &after);
}

/// Halfway.
pub fn resumes_halfway(bag: &Path) {
    resumes(bag, &[messages(bag) / 2]);
}

#[test]
fn replay_snapshot_resumes() {
    resumes_halfway(short_run());
    for bag in kept() {
        resumes_halfway(&bag);
    }
}

#[test]
fn replay_snapshot_resumes_wherever_it_is_taken() {
    resumes_at(short_run(), 97);
}

#[test]
fn replay_needs_what_was_before_the_middle() {
    let bag = changed(&Change {
        messages: Some(&|messages| drop(messages.drain(..messages.len() / 2))),
        ..Change::default()
    });
    let (code, outcome) = check(bag.path());
    assert_eq!(
        code, 1,
        "nodes that had forgotten all said the same: {outcome:#}"
    );
    // Behind the last message, and behind the last input.
    for after in [100_000_000, up_to_the_last_input(short_run())] {
        let beyond = ["--resume-after".to_owned(), after.to_string()];
        assert_eq!(check_with(short_run(), &beyond).0, 1, "{after}");
    }
}
