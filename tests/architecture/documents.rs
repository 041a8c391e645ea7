//! Documents: ARCHITECTURE.md names every test, every folder, and only paths that exist; links
//! resolve; README and map are short; README and `docs/` use plain words.

use std::collections::{BTreeMap, BTreeSet};

use crate::check;
use crate::tree::{self, File};

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

/// Most lines of README.md and of ARCHITECTURE.md.
const MOST_LINES: [(&str, usize); 2] = [("README.md", 80), ("ARCHITECTURE.md", 250)];

fn too_long(path: &str, text: &str, most: usize) -> Option<String> {
    let lines = text.lines().count();
    (lines > most).then(|| format!("{path}: {lines} lines: at most {most}"))
}

#[test]
fn arch_readme_and_map_are_short() {
    let found = MOST_LINES
        .iter()
        .filter_map(|(path, most)| too_long(path, &tree::text(path).unwrap(), *most));
    check(&found.collect::<Vec<_>>());
    assert!(too_long("a.md", "1\n2\n3\n", 3).is_none());
    assert_eq!(
        too_long("a.md", "1\n2\n3\n4\n", 3).unwrap(),
        "a.md: 4 lines: at most 3"
    );
}

/// Lines of a document with their numbers, without fenced blocks.
fn prose(text: &str) -> Vec<(usize, &str)> {
    let mut is_fenced = false;
    let mut lines = Vec::new();
    for (at, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        } else if !is_fenced {
            lines.push((at + 1, line));
        }
    }
    lines
}

/// A line without its code in backquotes.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join(" ")
}

/// A line without the targets of its links.
fn without_targets(line: &str) -> String {
    let mut rest = line;
    let mut kept = String::new();
    while let Some((before, target)) = rest.split_once("](") {
        kept.push_str(before);
        kept.push(']');
        rest = target.split_once(')').map_or("", |(_, after)| after);
    }
    kept + rest
}

/// Targets of the links and pictures in a line.
fn targets(line: &str) -> Vec<String> {
    let text = without_code(line);
    let mut rest = text.as_str();
    let mut found = Vec::new();
    while let Some((_, target)) = rest.split_once("](") {
        let Some((target, after)) = target.split_once(')') else {
            break;
        };
        found.push(target.to_owned());
        rest = after;
    }
    found
}

/// The anchor that a reader such as GitHub gives to a heading.
fn anchor(heading: &str) -> String {
    let text = without_targets(heading).to_lowercase();
    let kept = text
        .trim()
        .chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Anchors of all headings of a document; a repeated one gets a number.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut all = BTreeSet::new();
    for (_, line) in prose(text) {
        let heading = line.trim_start_matches('#');
        if heading.len() == line.len() || !heading.starts_with(' ') {
            continue;
        }
        let name = anchor(heading);
        let times = seen.entry(name.clone()).or_default();
        all.insert(match *times {
            0 => name,
            n => format!("{name}-{n}"),
        });
        *times += 1;
    }
    all
}

/// `target`, which stands in the document `from`, as a path below the root; `None`: it leaves the root.
fn resolved(from: &str, target: &str) -> Option<String> {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in target.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}

/// Links of `file` without a target; `read` gives the text of a path, empty for a folder.
fn dead_links(file: &File, read: &dyn Fn(&str) -> Option<String>) -> Vec<String> {
    let mut found = Vec::new();
    for (number, line) in prose(&file.text) {
        for target in targets(line) {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let (path, wanted) = match target.split_once('#') {
                Some((path, wanted)) => (path, Some(wanted)),
                None => (target.as_str(), None),
            };
            let place = match path {
                "" => Some(file.path.clone()),
                path => resolved(&file.path, path),
            };
            let text = place.as_deref().and_then(read);
            let is_there = match (&text, wanted) {
                (None, _) => false,
                (Some(text), Some(wanted)) => anchors(text).contains(wanted),
                (Some(_), None) => true,
            };
            if !is_there {
                found.push(format!("{}:{number}: {target}: no such target", file.path));
            }
        }
    }
    found
}

#[test]
fn arch_links_and_anchors_resolve() {
    let read = |path: &str| {
        tree::has(path).then(|| {
            let text = tree::text(path);
            text.unwrap_or_default()
        })
    };
    let documents = tree::files("", ".md");
    check(
        &documents
            .iter()
            .flat_map(|file| dead_links(file, &read))
            .collect::<Vec<_>>(),
    );
    let text = "# A `b` c\n## Twice\n## Twice\n[one](b.md#there) [two](../a/b.md#gone) `[x](y)`\n\
                ```text\n[x](y)\n# no heading\n```\n[three](#a-b-c) [four](#twice-1) [five](../../a.md)\n";
    let file = File {
        path: "a/a.md".to_owned(),
        text: text.to_owned(),
    };
    let few = |path: &str| match path {
        "a/a.md" => Some(text.to_owned()),
        "a/b.md" => Some("## There".to_owned()),
        _ => None,
    };
    assert_eq!(
        dead_links(&file, &few),
        [
            "a/a.md:4: ../a/b.md#gone: no such target",
            "a/a.md:9: ../../a.md: no such target",
        ]
    );
}

/// Phrases that the rules of plain words forbid.
const FORBIDDEN: [&str; 19] = [
    "what is",
    "what are",
    "what was",
    "what were",
    "what has",
    "is none",
    "is to have",
    "joins late",
    "of what",
    "of whom",
    "tell",
    "tells",
    "told",
    "telling",
    "say",
    "says",
    "said",
    "saying",
    "who joins",
];

/// Words of a text in lower case, one blank between them, and one at either end.
fn words(text: &str) -> String {
    let lower = text.to_lowercase();
    let words = lower.split(|c: char| !(c.is_alphanumeric() || c == '\''));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    format!(" {} ", words.join(" "))
}

fn unplain(file: &File) -> Vec<String> {
    let mut found = Vec::new();
    for (number, line) in prose(&file.text) {
        let words = words(&without_targets(&without_code(line)));
        for phrase in FORBIDDEN {
            if words.contains(&format!(" {phrase} ")) {
                found.push(format!("{}:{number}: \"{phrase}\"", file.path));
            }
        }
    }
    found
}

#[test]
fn arch_documents_use_plain_words() {
    let guide = tree::files("docs", ".md");
    assert!(!guide.is_empty(), "docs: no documents");
    let readme = File {
        path: "README.md".to_owned(),
        text: tree::text("README.md").unwrap(),
    };
    let documents = std::iter::once(&readme).chain(&guide);
    check(&documents.flat_map(unplain).collect::<Vec<_>>());
    let bad = File {
        path: "a.md".to_owned(),
        text: "What is left is told.\n`told_before` in [a link](what-is.md)\n```sh\nsay\n```\n"
            .to_owned(),
    };
    assert_eq!(unplain(&bad), ["a.md:1: \"what is\"", "a.md:1: \"told\""]);
}
