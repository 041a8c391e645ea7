//! Pure crates read no clock, file, environment or entropy, and nothing lifts the ban elsewhere.

use serde::Deserialize;

use crate::check;
use crate::source::{Found, Source, sources};
use crate::tree::{self, PURE};

/// What a pure crate may not name, with why.
const BANNED: [(&str, &str); 20] = [
    ("std::time::Instant", "time arrives with the event"),
    ("std::time::SystemTime", "time arrives with the event"),
    ("Instant::now", "time arrives with the event"),
    ("SystemTime::now", "time arrives with the event"),
    ("std::fs", "no file"),
    ("std::env", "no environment"),
    ("std::net", "no network"),
    ("std::process", "no process"),
    ("std::thread", "no thread"),
    ("std::io::stdin", "no terminal"),
    ("std::io::stdout", "no terminal"),
    ("std::io::stderr", "no terminal"),
    ("println", "a condition is an output"),
    ("eprintln", "a condition is an output"),
    ("HashMap", "its order is not deterministic"),
    ("HashSet", "its order is not deterministic"),
    ("StdRng", "its algorithm may change"),
    ("thread_rng", "entropy"),
    ("from_os_rng", "entropy"),
    ("OsRng", "entropy"),
];

/// `path` names `banned` or something in it.
fn names(path: &str, banned: &str) -> bool {
    let padded = format!("::{path}::");
    padded.contains(&format!("::{banned}::"))
}

fn impurities(path: &str, source: &Source) -> Vec<String> {
    let mut found = Vec::new();
    for Found { text, line } in &source.paths {
        for (banned, reason) in BANNED {
            if names(text, banned) {
                found.push(format!("{path}:{line}: {text}: {reason}"));
            }
        }
    }
    found
}

#[test]
fn arch_pure_crates_name_no_clock_file_environment_or_entropy() {
    let mut found = Vec::new();
    for name in PURE {
        let sources = sources(&format!("{}/src", tree::folder_of(name)));
        assert!(!sources.is_empty(), "{name}");
        found.extend(
            sources
                .iter()
                .flat_map(|(path, source)| impurities(path, source)),
        );
    }
    check(&found);
    let bad = Source::parse("use std::{collections::HashMap, fs};\nfn f() { Instant::now(); }");
    assert_eq!(
        impurities("a.rs", &bad),
        [
            "a.rs:2: Instant::now: time arrives with the event",
            "a.rs:1: std::collections::HashMap: its order is not deterministic",
            "a.rs:1: std::fs: no file",
        ]
    );
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Clippy {
    disallowed_methods: Vec<Ban>,
    disallowed_types: Vec<Ban>,
}

#[derive(Deserialize)]
struct Ban {
    path: String,
    reason: String,
}

/// Bans that clippy.toml must have.
const BANS: [&str; 11] = [
    "std::time::Instant::now",
    "std::time::SystemTime::now",
    "std::env::var",
    "std::fs::read_to_string",
    "std::fs::read",
    "std::fs::write",
    "std::fs::File::open",
    "std::fs::File::create",
    "std::thread::sleep",
    "std::collections::HashMap",
    "std::collections::HashSet",
];

fn missing_bans(clippy: &str) -> Vec<String> {
    let clippy: Clippy = toml::from_str(clippy).unwrap();
    let bans = || {
        clippy
            .disallowed_methods
            .iter()
            .chain(&clippy.disallowed_types)
    };
    let missing = BANS
        .iter()
        .filter(|path| !bans().any(|ban| ban.path == **path));
    let mut found: Vec<_> = missing
        .map(|path| format!("clippy.toml: no ban of {path}"))
        .collect();
    let silent = bans().filter(|ban| ban.reason.is_empty());
    found.extend(silent.map(|ban| format!("clippy.toml: no reason for {}", ban.path)));
    found
}

#[test]
fn arch_clippy_bans_clocks_files_and_unordered_maps() {
    check(&missing_bans(&tree::text("clippy.toml").unwrap()));
    let bad =
        "disallowed-methods = [{ path = \"std::env::var\", reason = \"\" }]\ndisallowed-types = []";
    assert_eq!(missing_bans(bad).len(), BANS.len());
}

/// Where a ban may be lifted: the edges of the suite, the build script of the wire, tests and benches.
const EDGES: [&str; 13] = [
    "nodes/libraries/node_runtime/src/",
    "nodes/recorder/src/",
    "nodes/replayer/node/src/",
    "nodes/linuxcnc_bridge/src/io",
    "nodes/mtconnect_bridge/src/io",
    "nodes/opcua_bridge/src/io",
    "nodes/libraries/history/src/store/server/tls.rs",
    "nodes/libraries/reports/src/whole_file.rs",
    "nodes/abbe/",
    "nodes/abbe_trials/",
    "nodes/sequencer/node/src/",
    "msgs/generator/",
    "tests/",
];

fn may_lift(path: &str) -> bool {
    let is_edge = EDGES.iter().any(|edge| path.starts_with(edge));
    is_edge || path.contains("/tests/") || path.contains("/benches/")
}

fn lifted(path: &str, text: &str) -> Vec<String> {
    if may_lift(path) {
        return Vec::new();
    }
    let bans = ["clippy::disallowed_methods", "clippy::disallowed_types"];
    let lines = text.lines().enumerate();
    let with_ban = lines.filter(|(_, line)| bans.iter().any(|ban| line.contains(ban)));
    with_ban
        .map(|(at, line)| format!("{path}:{}: {}: not here", at + 1, line.trim()))
        .collect()
}

#[test]
fn arch_bans_are_lifted_only_at_the_edges() {
    let files = tree::files("", ".rs");
    check(
        &files
            .iter()
            .flat_map(|file| lifted(&file.path, &file.text))
            .collect::<Vec<_>>(),
    );
    let bad = "#![expect(clippy::disallowed_methods, reason = \"quick\")]";
    assert_eq!(lifted("nodes/probe/src/queue.rs", bad).len(), 1);
    assert!(lifted("nodes/probe/tests/queue.rs", bad).is_empty());
}
