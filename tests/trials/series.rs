//! A series of trials as a person runs it.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_tests::program::{Process, command};
use serde_json::Value;
use tempfile::TempDir;

/// A folder that the diagnosis may look into, also where it runs as nobody.
pub fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let open = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(folder.path(), open).unwrap();
    folder
}

/// Where a series keeps its seals.
pub fn seals(folder: &Path) -> PathBuf {
    folder.join("seals")
}

/// Runs `abbe trials` in a folder; the table, and what was said.
pub fn run(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let table = folder.join("table.json");
    let mut command = command(0, &["trials"]);
    command
        .args(arguments)
        .arg("--out")
        .arg(folder.join("out"))
        .arg("--sealed")
        .arg(seals(folder))
        .arg("--json")
        .arg(&table);
    let ended = Process::start(command).ended_within(Duration::from_secs(300));
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let table = serde_json::from_str(&std::fs::read_to_string(table).unwrap()).unwrap();
    (table, ended.said)
}

/// Lines of the journal.
fn journal(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("out/journal.jsonl")).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn a_series_goes_on_behind_its_last_line_and_repeats_itself() {
    let folder = folder();
    let arguments = ["--arm", "iv", "--seed", "77", "--in-process", "--n"];
    run(folder.path(), &[&arguments[..], &["1"]].concat());
    let first = journal(folder.path());
    let (table, _) = run(folder.path(), &[&arguments[..], &["2"]].concat());
    let both = journal(folder.path());
    assert_eq!(both.len(), 2);
    assert_eq!(both[0], first[0]);
    assert_eq!(table["trials"], 2);
    std::fs::remove_file(folder.path().join("out/journal.jsonl")).unwrap();
    run(folder.path(), &[&arguments[..], &["1"]].concat());
    let again = journal(folder.path());
    for key in ["truth", "said"] {
        assert_eq!(again[0][key], first[0][key]);
    }
}

#[test]
fn an_arm_that_is_none_is_refused_with_those_that_are() {
    let mut command = command(0, &["trials", "--arm", "vii"]);
    command.current_dir(std::env::temp_dir());
    let ended = Process::start(command).ended_within(Duration::from_secs(10));
    assert_eq!(ended.status.code(), Some(2));
    assert!(
        ended.said.contains("must be one of i ii iii iv v vi alone"),
        "{}",
        ended.said
    );
}
