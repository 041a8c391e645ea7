//! Arms of designed programmes: one design serves all of them, what is sealed is not known to it, and a small fixed set does
//! not get worse.

use abbe_tests::program::{Process, trials};
use serde_json::Value;
use std::time::Duration;

use crate::series::{folder, run};

/// The fixed set.
const SET: [&str; 6] = ["--arm", "s5,s6,s7", "--n", "2", "--seed", "31"];

/// k and n of a figure.
fn count(figure: &Value) -> [u64; 2] {
    ["k", "n"].map(|key| figure[key].as_u64().unwrap())
}

/// k and n of a rate of an arm.
fn rate(arm: &Value, what: &str) -> [u64; 2] {
    let rates = arm["rates"].as_array().unwrap();
    let found = { rates.iter() }.find(|rate| rate["what"] == what);
    let found = found.unwrap_or_else(|| panic!("{what}: {arm}"));
    count(&found["count"])
}

#[test]
fn designed_programmes_are_made_once_a_machine_and_diagnosed_no_worse_than_before() {
    let folder = folder();
    let (table, said) = run(folder.path(), &SET);
    let place = |what: &str| said.find(what).unwrap_or_else(|| panic!("{what}:\n{said}"));
    assert!(place("sealed s5-31-00000: sha256 ") < place("s5 0: "));
    let designs = std::fs::read_dir(folder.path().join("out/designs")).unwrap();
    assert_eq!(designs.count(), 2, "{said}");
    let first_lines = table["first_lines"].as_array().unwrap();
    assert_eq!(first_lines.len(), 10);
    let arms = table["arms"].as_array().unwrap();
    assert_eq!(arms.len(), 3);
    for arm in arms {
        assert_eq!(rate(arm, "diagnosed"), [2, 2], "{said}");
    }
    for arm in &arms[..2] {
        let [wrong, _] = rate(arm, "a cause named that is none");
        assert!(wrong <= MAX_WRONG, "{said}");
    }
}

/// Most machines of two with a wrong name.
const MAX_WRONG: u64 = 1;

#[test]
fn arms_of_designed_programmes_stand_in_no_table_with_others() {
    let home = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        (&["--arm", "i,s5"][..], "run them without other arms"),
        (&["--arm", "s7", "--in-process"], "leave out --in-process"),
        (
            &["--arm", "i", "--programmes", "none.jsonl"],
            "belongs to the table of s5, s6 and s7",
        ),
        (
            &["--arm", "s5", "--programmes", "none.jsonl"],
            "no programme was judged there",
        ),
    ] {
        let mut command = trials(arguments);
        command.current_dir(home.path());
        let ended = Process::start(command).ended_within(Duration::from_secs(60));
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        assert!(ended.said.contains(words), "{}", ended.said);
    }
}
