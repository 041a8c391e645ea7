//! A recording of several files whose names were exchanged, or one of which was copied: a check reads them as a report does.

use std::path::Path;

use abbe_tests::program::root;
use abbe_tests::scenario::mcap_file;
use tempfile::TempDir;

use crate::contract::check;
use crate::rewrite::{Change, Copied, rewrite};
use crate::spoiled::report;

/// Files that a recording is split into.
const FILES: usize = 3;

/// A bag whose file of each name holds that part of the recording.
fn named(names: &[(&str, usize)]) -> TempDir {
    let home = tempfile::tempdir().unwrap();
    let whole = mcap_file(&root().join("bags/cold_reference"));
    for (name, part) in names {
        let keep = |messages: &mut Vec<Copied>| {
            let (n, part) = (messages.len(), *part);
            *messages = messages
                .drain(n * part / FILES..n * (part + 1) / FILES)
                .collect();
        };
        let aside = home.path().join("aside");
        let change = Change {
            messages: Some(&keep),
            ..Change::default()
        };
        rewrite(&whole, &aside, &change);
        let to = home.path().join(format!("{name}.mcap"));
        std::fs::rename(aside.join("bag_0.mcap"), to).unwrap();
        std::fs::remove_dir(aside).unwrap();
    }
    home
}

fn expect_repeats_alone(bag: &Path, part: usize) {
    let (code, json) = check(bag);
    assert_eq!(code, 3, "{part}: {json}");
    assert!(json["first_difference"].is_null(), "{part}: {json}");
    assert!(json["doubtful"].is_null(), "{part}: {json}");
    let reasons = json["loss"]["left_out"].as_array().unwrap();
    assert!(!reasons.is_empty(), "{part}: {json}");
    for left_out in reasons {
        assert_eq!(left_out["reason"], "repeated", "{part}: {json}");
    }
    assert_eq!(report(bag).code, 3, "{part}");
}

#[test]
fn parts_of_exchanged_names_are_equal() {
    for order in [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 0, 1], [2, 1, 0]] {
        let names = ["bag_0", "bag_1", "bag_2"];
        let bag = named(&names.into_iter().zip(order).collect::<Vec<_>>());
        let (code, json) = check(bag.path());
        assert_eq!(code, 0, "{order:?}: {json}");
        assert_eq!(json["equal"], true, "{order:?}: {json}");
        assert_eq!(report(bag.path()).code, 0, "{order:?}");
    }
}

#[test]
fn a_part_that_is_there_twice_is_repeated_and_nothing_differs() {
    for part in 0..FILES {
        let bag = named(&[("bag_0", 0), ("bag_1", 1), ("bag_2", 2), ("bag_9", part)]);
        expect_repeats_alone(bag.path(), part);
        let bag = named(&[("bag_0", 1), ("bag_1", 0), ("bag_2", part), ("bag_9", 2)]);
        expect_repeats_alone(bag.path(), part);
    }
}
