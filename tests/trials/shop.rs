//! Arms of the sessions that shops have: tables are sealed, imported and diagnosed, and a small fixed set does not get worse.

use abbe_tests::program::{Process, trials};
use serde_json::Value;
use std::time::Duration;

use crate::series::{folder, run};

/// The fixed set.
const SET: [&str; 6] = ["--arm", "s1,s2,s3", "--n", "5", "--seed", "21"];

/// k and n of a figure of an arm.
fn count(arm: &Value, what: &str) -> [u64; 2] {
    let lines = arm["lines"].as_array().unwrap();
    let line = { lines.iter() }.find(|line| line["what"] == what);
    let line = line.unwrap_or_else(|| panic!("{what}: {arm}"));
    ["k", "n"].map(|key| line["count"][key].as_u64().unwrap())
}

#[test]
fn a_shops_tables_are_sealed_imported_and_answered_no_worse_than_before() {
    let folder = folder();
    let (table, said) = run(folder.path(), &SET);
    let place = |what: &str| said.find(what).unwrap_or_else(|| panic!("{what}:\n{said}"));
    assert!(place("sealed s1-21-00000: sha256 ") < place("s1 0: "));
    let arms = table["arms"].as_array().unwrap();
    assert_eq!(arms.len(), 3);
    for arm in arms {
        assert_eq!(count(arm, "answered"), [5, 5], "{said}");
        let [named, _] = count(arm, "nothing hidden: a cause named");
        assert_eq!(named, 0, "{said}");
        let [wrong, _] = count(arm, "a wrong name");
        assert!(wrong <= MAX_WRONG, "{said}");
    }
}

/// Shifts whose drawing never changes.
const SHIFTS: [&str; 7] = ["--arm", "s4", "--n", "2", "--seed", "21", "--in-process"];

#[test]
fn shifts_are_answered_and_their_changes_counted_no_worse_than_before() {
    let folder = folder();
    let (table, said) = run(folder.path(), &SHIFTS);
    let arms = table["arms"].as_array().unwrap();
    let [shift] = &arms[..] else {
        panic!("{said}");
    };
    assert_eq!(count(shift, "answered"), [2, 2], "{said}");
    let [wrong, _] = count(shift, "a wrong name");
    assert!(wrong <= MAX_WRONG_SHIFTS, "{said}");
    let [named, _] = count(shift, "nothing hidden: a cause named");
    assert_eq!(named, 0, "{said}");
    let [_, timed] = count(shift, "diagnosed within 5 s (median: half of them)");
    assert_eq!(timed, 2, "{said}");
}

/// Most shifts of two with a wrong name.
const MAX_WRONG_SHIFTS: u64 = 1;

/// Most sessions of five with a wrong name.
const MAX_WRONG: u64 = 2;

#[test]
fn a_shops_arms_stand_in_no_table_with_others_and_need_bags() {
    let home = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        (&["--arm", "i,s1"][..], "run them without other arms"),
        (&["--arm", "s1", "--in-process"], "leave out --in-process"),
    ] {
        let mut command = trials(arguments);
        command.current_dir(home.path());
        let ended = Process::start(command).ended_within(Duration::from_secs(60));
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        assert!(ended.said.contains(words), "{}", ended.said);
    }
}
