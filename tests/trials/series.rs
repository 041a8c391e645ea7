//! A series of trials as a person runs it.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use abbe_tests::program::{Process, trials};
use nix::sys::signal::Signal;
use serde_json::Value;
use tempfile::TempDir;

/// How long a series may take on a computer that is busy with others: trials compute, and nothing here is about how fast.
const PATIENCE: Duration = Duration::from_secs(1_200);

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

/// `abbe-trials` in a folder.
fn series(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = trials(arguments);
    command
        .arg("--out")
        .arg(folder.join("out"))
        .arg("--json")
        .arg(folder.join("table.json"));
    if !arguments.contains(&"--in-process") {
        command.arg("--sealed").arg(seals(folder));
    }
    command
}

/// Runs `abbe-trials` in a folder; the table, and what was said.
pub fn run(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let table = folder.join("table.json");
    let ended = Process::start(series(folder, arguments)).ended_within(PATIENCE);
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
    let timeless = |line: &Value| {
        let mut line = line.clone();
        line["said"]["runtime_s"] = Value::Null;
        [line["truth"].clone(), line["said"].clone()]
    };
    assert_eq!(timeless(&again[0]), timeless(&first[0]));
}

#[test]
fn a_series_whose_d_was_of_another_measure_is_neither_gone_on_with_nor_tabulated_beside_it() {
    let folder = folder();
    let arguments = ["--arm", "iv", "--seed", "78", "--in-process", "--n", "1"];
    run(folder.path(), &arguments);
    let path = folder.path().join("out/journal.jsonl");
    let own = std::fs::read_to_string(&path).unwrap();
    // As a journal of before: without the word.
    let before = own.replace(r#","measure":2"#, "");
    assert_ne!(before, own);
    std::fs::write(&path, &before).unwrap();
    for more in [&["--n", "2"][..], &["--tabulate"]] {
        let arguments = [&arguments[..5], more].concat();
        std::fs::write(
            &path,
            if more.len() > 1 {
                before.clone()
            } else {
                before.clone() + &own
            },
        )
        .unwrap();
        let ended = Process::start(series(folder.path(), &arguments)).ended_within(PATIENCE);
        assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
        assert!(
            ended.said.contains("of the measures 1 and 2"),
            "{}",
            ended.said
        );
    }
    std::fs::write(&path, &before).unwrap();
    let (table, _) = run(folder.path(), &[&arguments[..], &["--tabulate"]].concat());
    assert_eq!(table["trials"], 1);
}

/// Lines of a journal that is still written: whole ones alone.
fn lines(folder: &Path) -> usize {
    let text = std::fs::read_to_string(folder.join("out/journal.jsonl")).unwrap_or_default();
    text.matches('\n').count()
}

#[test]
fn a_series_that_was_killed_goes_on_and_judges_no_trial_twice() {
    let folder = folder();
    let arguments = [
        "--arm",
        "iv",
        "--seed",
        "78",
        "--jobs",
        "1",
        "--in-process",
        "--n",
        "3",
    ];
    let process = Process::start(series(folder.path(), &arguments));
    let end = Instant::now() + PATIENCE;
    while lines(folder.path()) < 1 {
        assert!(Instant::now() < end, "no trial in {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(50));
    }
    process.signal(Signal::SIGKILL);
    let killed = process.ended_within(Duration::from_secs(60));
    assert_eq!(killed.status.code(), None, "{}", killed.said);
    let first = journal(folder.path());
    assert!((1..3).contains(&first.len()), "{}", first.len());
    let path = folder.path().join("out/journal.jsonl");
    let mut text = std::fs::read_to_string(&path).unwrap();
    text.push_str("{\"truth\": {\"arm\": \"nu");
    std::fs::write(&path, text).unwrap();
    let (table, _) = run(folder.path(), &arguments);
    let all = journal(folder.path());
    assert_eq!(all[..first.len()], first);
    let mut numbers: Vec<u64> = all
        .iter()
        .map(|line| line["truth"]["index"].as_u64().unwrap())
        .collect();
    numbers.sort_unstable();
    assert_eq!(numbers, [0, 1, 2]);
    assert_eq!(table["trials"], 3);
}

#[test]
fn a_rule_that_is_switched_off_is_judged_on_the_same_trials() {
    let folder = folder();
    let arguments = [
        "--arm",
        "iv",
        "--seed",
        "79",
        "--in-process",
        "--n",
        "1",
        "--ablate",
        "held_out",
    ];
    let (table, said) = run(folder.path(), &arguments);
    let both = journal(folder.path());
    assert_eq!(both.len(), 2);
    assert_eq!(both[0]["truth"], both[1]["truth"]);
    assert_eq!(both[0]["ablated"], Value::Null);
    assert_eq!(both[1]["ablated"], "held_out");
    let lines = &table["ablations"][0][1];
    assert_eq!(lines[0]["method"], "all rules", "{said}");
    assert_eq!(lines[1]["method"], "without held_out", "{said}");
    assert_eq!(table["trials"], 1);
}

/// A line as the series writes it where the program of a drawn machine ends early.
#[test]
fn a_machine_that_could_not_be_measured_is_counted_and_not_drawn_again() {
    let folder = folder();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    let line = r#"{"arm":"null","index":0,"seed":80,"commit":"c","not_measured":"run 1 failed: line 54: probe closed"}"#;
    std::fs::write(out.join("journal.jsonl"), format!("{line}\n")).unwrap();
    let arguments = ["--arm", "iv", "--seed", "80", "--in-process", "--n", "2"];
    let (table, said) = run(folder.path(), &arguments);
    let both = journal(folder.path());
    assert_eq!(both.len(), 2);
    assert_eq!(both[1]["truth"]["index"], 1);
    assert_eq!(table["trials"], 1);
    assert_eq!(table["not_measured"][0]["index"], 0);
    for wanted in [
        "1 of 2 drawn machines could not be measured and are in no rate.",
        "iv 0: could not be measured: run 1 failed: line 54: probe closed",
    ] {
        assert!(said.contains(wanted), "{said}");
    }
}

#[test]
fn an_arm_that_is_none_is_refused_with_those_that_are() {
    let mut command = trials(&["--arm", "viii"]);
    command.current_dir(std::env::temp_dir());
    let ended = Process::start(command).ended_within(Duration::from_secs(60));
    assert_eq!(ended.status.code(), Some(2));
    assert!(
        ended.said.contains(
            "must be one of i ii iii iv v vi alone vii limit own own-left-out s1 s2 s3 s5 s6 s7"
        ),
        "{}",
        ended.said
    );
}

#[test]
fn a_series_of_no_trials_is_refused_before_a_file_is_written() {
    let home = tempfile::tempdir().unwrap();
    let mut command = trials(&["--n", "0"]);
    command.current_dir(home.path());
    let ended = Process::start(command).ended_within(Duration::from_secs(60));
    assert_eq!(ended.status.code(), Some(2), "{}", ended.said);
    assert!(ended.said.contains("0 is not in 1.."), "{}", ended.said);
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
}
