//! Recordings of the kinds that workshops have, each with the right figures and the right causes.
//!
//! `recordings/NAME/expected.yaml` states what is right. A check that fails today is marked there with its reason; the table
//! of [`page`] then shows the recording as wrong. A mark whose check holds fails the test.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests read files and start the program"
)]
#![expect(
    clippy::print_stderr,
    reason = "the time of each recording is of interest"
)]

mod check;
mod expected;
mod page;
mod run;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use abbe_tests::program::abbe;
use abbe_tests::python::{interpreter, succeeded};
use expected::{Recording, recordings};
use page::Verdict;
use run::Outcome;

fn home() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("real")
}

/// Every recording with what the program did; computed once.
fn rows() -> &'static [(Recording, Outcome)] {
    static ROWS: OnceLock<Vec<(Recording, Outcome)>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let all = recordings(&home().join("recordings")).into_iter();
        let run = |recording: Recording| {
            let began = Instant::now();
            let outcome = run::outcome(&recording);
            eprintln!(
                "{:6.2} s  {}",
                began.elapsed().as_secs_f64(),
                recording.name
            );
            (recording, outcome)
        };
        all.map(run).collect()
    })
}

#[test]
fn every_recording_is_right_or_has_the_reason_why_it_is_not() {
    let broken =
        rows().iter().filter_map(
            |(recording, outcome)| match page::verdict(recording, outcome) {
                Verdict::Broken(reasons) => Some(reasons.join("\n")),
                Verdict::Right | Verdict::KnownWrong(_) => None,
            },
        );
    let broken: Vec<String> = broken.collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_recording_compares_something() {
    assert!(rows().len() > 40, "{}", rows().len());
    for (recording, outcome) in rows() {
        assert!(outcome.checks.len() > 1, "{}", recording.name);
    }
}

/// With `REAL_TABLE=write` the page is written instead (`tests/real/table`).
#[test]
fn the_page_has_what_the_program_prints_now() {
    let (file, now) = (home().join("RESULTS.md"), page::markdown(rows()));
    if std::env::var("REAL_TABLE").as_deref() == Ok("write") {
        std::fs::write(&file, now).unwrap();
        return;
    }
    let written = std::fs::read_to_string(&file).unwrap();
    let differences = page::differences(&written, &now);
    assert!(
        differences.is_empty(),
        "RESULTS.md is not of this program; tests/real/table writes it:\n{}",
        differences.join("\n")
    );
}

/// Files below a folder with their texts, by name.
fn texts(folder: &Path) -> Vec<(PathBuf, String)> {
    let files = walkdir::WalkDir::new(folder).sort_by_file_name();
    let files = files.into_iter().map(Result::unwrap);
    let files = files.filter(|entry| entry.file_type().is_file());
    let text = |path: &Path| std::fs::read_to_string(path).unwrap();
    files
        .map(|entry| {
            let below = entry.path().strip_prefix(folder).unwrap().to_owned();
            (below, text(entry.path()))
        })
        .collect()
}

#[test]
fn tables_and_figures_are_those_of_their_scripts() {
    let Some(python) = interpreter("tables_and_figures_are_those_of_their_scripts") else {
        return;
    };
    let made = tempfile::TempDir::new().unwrap();
    let run = |script: &str| {
        let mut command = std::process::Command::new(&python);
        command.arg(home().join(script)).arg(made.path());
        succeeded(&command.output().unwrap())
    };
    run("look_alikes.py");
    run("nist.py");
    let tables = texts(made.path());
    assert!(tables.len() > 15, "{}", tables.len());
    run("figures.py");
    for (path, text) in texts(made.path()) {
        let kept = std::fs::read_to_string(home().join("recordings").join(&path)).unwrap();
        // Of `expected.yaml` the script writes the end alone.
        let is_same = match path.extension() {
            Some(end) if end == "yaml" => kept.ends_with(&text),
            _ => kept == text,
        };
        assert!(is_same, "{}", path.display());
    }
}

/// The first draws of the command that README.md names, of which it judges a thousand.
#[test]
fn random_lead_errors_get_no_false_name() {
    let Some(python) = interpreter("random_lead_errors_get_no_false_name") else {
        return;
    };
    let mut command = std::process::Command::new(&python);
    command.arg(home().join("smooth_leads.py"));
    command.arg("--program").arg(abbe());
    command.args(["--count", "40"]);
    let said = succeeded(&command.output().unwrap());
    assert!(said.contains("40 diagnosed, 0 refused"), "{said}");
    assert!(said.contains("with a false name: 0 of 40"), "{said}");
}
