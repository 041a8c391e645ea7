//! ARCHITECTURE.md names every invariant's test, every folder, and nothing that is not there.

use std::collections::BTreeSet;

use crate::check;
use crate::tree;

/// Words of `text` that begin like the name of an invariant's test.
fn tests_named(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    let named = words.filter(|word| word.starts_with("arch_") && word.len() > "arch_".len());
    named.map(str::to_owned).collect()
}

/// Names of the test functions in the text of a Rust file.
fn tests_written(text: &str) -> BTreeSet<String> {
    let functions = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("fn arch_"));
    let names = functions.filter_map(|rest| rest.split('(').next());
    names.map(|rest| format!("arch_{rest}")).collect()
}

fn unmatched(map: &BTreeSet<String>, tests: &BTreeSet<String>) -> Vec<String> {
    let unnamed = tests
        .difference(map)
        .map(|test| format!("ARCHITECTURE.md: does not name {test}"));
    let absent = map
        .difference(tests)
        .map(|test| format!("ARCHITECTURE.md: {test}: no such test"));
    unnamed.chain(absent).collect()
}

#[test]
fn arch_every_invariant_has_its_test() {
    let files = tree::files("tests/architecture", ".rs");
    let tests = files
        .iter()
        .flat_map(|file| tests_written(&file.text))
        .collect();
    check(&unmatched(
        &tests_named(&tree::text("ARCHITECTURE.md").unwrap()),
        &tests,
    ));
    let bad = unmatched(
        &tests_named("`arch_gone`"),
        &tests_written("fn arch_new() {"),
    );
    assert_eq!(bad.len(), 2);
}

/// Paths in backquotes that begin with a folder of the tree.
fn paths_named(text: &str) -> BTreeSet<String> {
    let quoted = text.split('`').skip(1).step_by(2);
    let tops = [
        "nodes/",
        "msgs/",
        "tests/",
        "launch_configs/",
        "bags/",
        ".ci/",
    ];
    let is_path = |quoted: &&str| {
        tops.iter().any(|top| quoted.starts_with(top)) && !quoted.contains(['<', '*', ' ', '\n'])
    };
    quoted.filter(is_path).map(str::to_owned).collect()
}

fn absent(paths: &BTreeSet<String>, has: &dyn Fn(&str) -> bool) -> Vec<String> {
    let gone = paths.iter().filter(|path| !has(path.trim_end_matches('/')));
    gone.map(|path| format!("ARCHITECTURE.md: {path}: not there"))
        .collect()
}

#[test]
fn arch_the_map_names_what_is_there() {
    let map = tree::text("ARCHITECTURE.md").unwrap();
    let mut found = absent(&paths_named(&map), &tree::has);
    let folders = tree::folders("nodes")
        .into_iter()
        .map(|name| format!("`nodes/{name}`"));
    let unnamed = folders.filter(|quoted| !map.contains(quoted.as_str()));
    found.extend(unnamed.map(|folder| format!("ARCHITECTURE.md: does not name {folder}")));
    check(&found);
    let bad = paths_named("`nodes/gone` and `nodes/<name>` and `cargo test`");
    assert_eq!(
        absent(&bad, &|_| false),
        ["ARCHITECTURE.md: nodes/gone: not there"]
    );
}
