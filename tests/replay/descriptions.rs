//! A description of a bag (`metadata.yaml`) that is damaged or contradicts its files is named with exit code 3; a bag without
//! messages is no bag that is equal.

use std::path::Path;

use abbe_tests::program::root;
use tempfile::TempDir;

use crate::contract::changed_of;
use crate::rewrite::Change;
use crate::spoiled::run;

/// A copy of a bag whose description is what `change` makes of it.
fn described(bag: &str, change: impl Fn(&str) -> String) -> TempDir {
    let home = tempfile::tempdir().unwrap();
    let from = root().join("bags").join(bag);
    for name in ["bag_0.mcap", "metadata.yaml"] {
        std::fs::copy(from.join(name), home.path().join(name)).unwrap();
    }
    let file = home.path().join("metadata.yaml");
    let text = change(&std::fs::read_to_string(&file).unwrap());
    std::fs::write(&file, text).unwrap();
    home
}

fn done(verb: &str, bag: &Path) -> (i32, String) {
    run(&[verb, &bag.display().to_string()])
}

type Spoil = (&'static str, fn(&str) -> String, &'static str);
const SPOILS: [Spoil; 7] = [
    (
        "another count",
        |text| text.replacen("  message_count: 1", "  message_count: 91", 1),
        "message_count = 91",
    ),
    (
        "a topic fewer",
        |text| text.replace("name: /axes/state", "name: /axes/other"),
        "/axes/state: is missing",
    ),
    (
        "another type",
        |text| text.replace("type: abbe_msgs/msg/AxisState", "type: x_msgs/msg/Y"),
        "type = x_msgs/msg/Y",
    ),
    ("no YAML", |_| "\t{[".to_owned(), "damaged"),
    ("empty", |_| String::new(), "damaged"),
    (
        "cut in the middle",
        |text| text[..text.len() / 2].to_owned(),
        "damaged",
    ),
    (
        "without its files",
        |text| text.replace("relative_file_paths", "relative_files"),
        "relative_file_paths is missing",
    ),
];

#[test]
fn a_wrong_description_is_named_by_every_verb_and_ends_with_3() {
    for verb in ["check", "report"] {
        let (code, said) = done(verb, described("cold_reference", str::to_owned).path());
        assert_eq!(code, 0, "{verb}: {said}");
        for (how, change, words) in SPOILS {
            let (code, said) = done(verb, described("cold_reference", change).path());
            assert_eq!(code, 3, "{verb} {how}: {said}");
            assert!(said.contains("metadata.yaml"), "{verb} {how}: {said}");
            assert!(said.contains(words), "{verb} {how}: {said}");
        }
    }
}

#[test]
fn a_check_of_a_bag_without_messages_is_refused() {
    for bag in ["cold_reference", "dual_loop", "host_clocks"] {
        let empty = changed_of(
            &root().join("bags").join(bag),
            &Change {
                messages: Some(&|messages| messages.clear()),
                ..Change::default()
            },
        );
        let (code, said) = done("check", empty.path());
        assert_eq!(code, 1, "{bag}: {said}");
        assert!(said.contains("holds no message"), "{bag}: {said}");
        assert!(said.contains(&empty.path().display().to_string()), "{said}");
    }
}
