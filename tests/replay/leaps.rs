//! Log times that leap: a check ends soon, reports the leap, and calls no difference behind it certain.

use std::time::{Duration, Instant};

use abbe_tests::program::{Process, command, root};

use crate::contract::{changed_of, check};
use crate::rewrite::{Change, Copied};

const DAY: u64 = 86_400_000_000_000;
/// A check of the unchanged bag takes a second or two on a slow computer.
const SOON: Duration = Duration::from_secs(60);

type Spoil = fn(&mut Vec<Copied>);

fn middle(messages: &[Copied]) -> usize {
    messages.len() / 2
}

fn all_from(messages: &mut [Copied], first: usize, by: u64) {
    for message in &mut messages[first..] {
        message.header.log_time = message.header.log_time.saturating_add(by);
    }
}

/// What is done to the log times, and whether they leap within the bag; not if all of it is later.
const SPOILS: [(&str, Spoil, bool); 9] = [
    ("one a day ahead", |m| ahead(m, DAY), true),
    ("one forty years ahead", |m| ahead(m, 40 * 365 * DAY), true),
    ("one behind the year 2106", |m| at(m, 1 << 62), true),
    ("one at 2^63", |m| at(m, 1 << 63), true),
    ("one at 2^64 - 1", |m| at(m, u64::MAX), true),
    ("one at 0", |m| at(m, 0), true),
    (
        "all from the middle on a day later",
        |m| {
            let first = middle(m);
            all_from(m, first, DAY);
        },
        true,
    ),
    (
        "all a century later",
        |m| all_from(m, 0, 70 * 365 * DAY),
        false,
    ),
    (
        "the last at the end of time",
        |m| {
            m.last_mut().unwrap().header.log_time = u64::MAX;
        },
        true,
    ),
];

fn ahead(messages: &mut [Copied], by: u64) {
    let nth = middle(messages);
    messages[nth].header.log_time += by;
}

fn at(messages: &mut [Copied], nanos: u64) {
    let nth = middle(messages);
    messages[nth].header.log_time = nanos;
}

#[test]
fn a_check_does_not_run_through_a_leap_and_reports_it() {
    let bag = root().join("bags/cold_reference");
    for (how, spoil, is_within) in SPOILS {
        let spoiled = |messages: &mut Vec<Copied>| spoil(messages);
        let change = Change {
            messages: Some(&spoiled),
            ..Change::default()
        };
        let bad = changed_of(&bag, &change);
        let began = Instant::now();
        let (code, json) = check(bad.path());
        assert!(began.elapsed() < SOON, "{how}: {:?}", began.elapsed());
        assert_eq!(code, 3, "{how}: {json:#}");
        let leaps = json["leaps"]["count"].as_u64().unwrap();
        assert!(leaps >= 1, "{how}: {json:#}");
        let path = bad.path().display().to_string();
        let verbs: &[&str] = if is_within {
            &["check", "report"]
        } else {
            &["check"]
        };
        for verb in verbs {
            let ended = Process::start(command(0, &[verb, &path])).ended_within(SOON);
            let words = "log times: ";
            assert!(ended.said.contains(words), "{how}: {verb}: {}", ended.said);
        }
    }
    let (code, json) = check(&bag);
    assert_eq!((code, json["leaps"].is_null()), (0, true), "{json:#}");
}
