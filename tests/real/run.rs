//! Runs the program on a recording.

use std::path::Path;

use abbe_tests::program::as_given;
use serde_json::Value;
use tempfile::TempDir;

use crate::check::{self, Check, causes};
use crate::expected::{Diagnose, Export, Of, Other, Recording, Report, Told};

/// What the program did with a recording.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Every comparison.
    pub checks: Vec<Check>,
    /// Figures and causes in words, for the page.
    pub words: Vec<String>,
}

/// A finished command.
struct Ended {
    code: Option<i32>,
    stdout: String,
    /// Standard output, then standard error.
    text: String,
}

fn run(arguments: &[&str]) -> Ended {
    // The domain is not used: none of these verbs opens a network.
    let output = as_given(0, arguments).output().unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let text = stdout.clone() + &String::from_utf8_lossy(&output.stderr);
    Ended {
        code: output.status.code(),
        stdout,
        text,
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Files of a recording as arguments.
struct Files {
    input: String,
    map: Option<String>,
    machine: Option<String>,
    /// A folder that does not exist yet.
    bag: String,
    /// A folder for everything else.
    out: String,
}

/// Runs every command that a recording has right answers for.
///
/// # Panics
/// When the recording lacks a file that a command needs, or the program cannot be started.
pub fn outcome(recording: &Recording) -> Outcome {
    let home = TempDir::new().unwrap();
    let expected = &recording.expected;
    let file = |path: &Path| shown(&recording.folder.join(path));
    let files = Files {
        input: file(&expected.input),
        map: expected.map.as_deref().map(file),
        machine: expected.machine.as_deref().map(file),
        bag: shown(&home.path().join("bag")),
        out: shown(home.path()),
    };
    let mut outcome = Outcome::default();
    let needs_bag = expected.import.is_some()
        || expected.diagnose.is_some()
        || expected.export.is_some()
        || { expected.report.iter() }.any(|report| report.of.contains(&Of::Bag));
    if needs_bag {
        import(expected.import.as_ref(), &files, &mut outcome);
    }
    if let Some(report) = &expected.report {
        for of in &report.of {
            reported(*of, report, recording, &files, &mut outcome);
        }
    }
    if let Some(wanted) = &expected.diagnose {
        diagnosed(wanted, &files, &mut outcome);
    }
    if let Some(wanted) = &expected.export {
        exported(wanted, &files, &mut outcome);
    }
    if let Some(wanted) = &expected.other {
        other(wanted, &files, &mut outcome);
    }
    outcome
}

fn import(told: Option<&Told>, files: &Files, outcome: &mut Outcome) {
    let (map, machine) = (files.map.as_ref().unwrap(), files.machine.as_ref().unwrap());
    let ended = run(&[
        "import",
        &files.input,
        "--map",
        map,
        "--machine",
        machine,
        "-o",
        &files.bag,
    ]);
    let succeeds = Told {
        exit: 0,
        says: vec![],
    };
    let told = told.unwrap_or(&succeeds);
    let exit = [Some(told.exit), ended.code];
    outcome
        .checks
        .extend(check::ended("import", exit, &told.says, &ended.text));
    if told.exit != 0 && ended.code == Some(told.exit) {
        outcome.words.push("import: refused".to_owned());
    }
}

fn reported(of: Of, wanted: &Report, recording: &Recording, files: &Files, outcome: &mut Outcome) {
    let mut arguments = vec!["report"];
    match of {
        Of::Table => arguments.push(&files.input),
        Of::Map => arguments.extend([&files.input, "--map", files.map.as_ref().unwrap()]),
        Of::Bag => arguments.push(&files.bag),
    }
    arguments.push("--json");
    let ended = run(&arguments);
    let report: Value = serde_json::from_str(&ended.stdout).unwrap_or_default();
    let exit = [Some(wanted.exit), ended.code];
    let mut checks = check::ended(of.word(), exit, &wanted.says, &ended.text);
    let figures = check::figures(of.word(), wanted, &recording.expected.numpy, &report);
    if Some(&of) == wanted.of.first() {
        let stated = { figures.iter() }.zip(&wanted.figures);
        let words = stated.map(|(check, (name, figure))| {
            let unit = figure.unit.replace("um", "µm");
            if check.found.starts_with("no ") {
                format!("{name} —")
            } else if unit.is_empty() {
                format!("{} {name}", check.found.trim_end_matches(".00"))
            } else {
                format!("{name} {} {unit}", check.found)
            }
        });
        let words: Vec<String> = words.collect();
        outcome.words.push(words.join(", "));
    }
    checks.extend(figures);
    outcome.checks.extend(checks);
}

fn diagnosed(wanted: &Diagnose, files: &Files, outcome: &mut Outcome) {
    let json = format!("{}/gap.json", files.out);
    let machine = files.machine.as_ref().unwrap();
    let ended = run(&[
        "diagnose",
        &files.bag,
        "--machine",
        machine,
        "--full",
        "--json",
        &json,
    ]);
    let text = std::fs::read_to_string(&json).unwrap_or_default();
    let report: Value = serde_json::from_str(&text).unwrap_or_default();
    let exit = [Some(wanted.exit), ended.code];
    let mut checks = check::ended("diagnose", exit, &wanted.says, &ended.text);
    let follows = check::follows(&wanted.follows, &ended.text);
    let words = { follows.chunks(2) }.zip(&wanted.follows);
    let words = words.map(|(found, follow)| {
        let [lag, size] = [0, 1].map(|k| &found[k].found);
        format!("goes with {}: {lag} min, {size} µm/K", follow.thermometer)
    });
    outcome.words.extend(words);
    checks.extend(follows);
    checks.extend(check::diagnosis(wanted, &report));
    outcome.words.push(in_words(&report));
    outcome.words.extend(sizes(wanted, &checks));
    outcome.checks.extend(checks);
}

/// The named causes, and those of sets with what cannot be told from them.
fn in_words(report: &Value) -> String {
    if !report.is_object() {
        return "diagnose: refused".to_owned();
    }
    let named = causes(report, "named");
    let set = causes(report, "set");
    let mut words = match (named.is_empty(), set.is_empty()) {
        (true, true) => return "nothing named".to_owned(),
        (true, false) => String::new(),
        (false, _) => format!("named: {}", named.join(", ")),
    };
    if !set.is_empty() {
        let lead = if words.is_empty() { "" } else { "; " };
        words += &format!("{lead}one of a set: {}", set.join(", "));
    }
    words
}

/// The sizes that were compared, each with its interval.
fn sizes(wanted: &Diagnose, checks: &[Check]) -> Vec<String> {
    let all = wanted.must.iter().flat_map(|must| {
        let name = must.one_of.join(" or ");
        must.sizes.keys().map(move |size| format!("{name} {size}"))
    });
    let words = all.filter_map(|size| {
        let of = |name: &str| checks.iter().find(|check| check.name == name);
        let (value, interval) = (of(&size)?, of(&format!("{size} interval"))?);
        let is_there = !value.found.starts_with("no ");
        is_there.then(|| format!("{size} {} ({})", value.found, interval.found))
    });
    words.collect()
}

fn exported(wanted: &Export, files: &Files, outcome: &mut Outcome) {
    let out = format!("{}/tables", files.out);
    let arguments = wanted.arguments.iter().map(String::as_str);
    let arguments: Vec<&str> = ["export", &files.bag]
        .into_iter()
        .chain(arguments)
        .chain(["--out", &out])
        .collect();
    let ended = run(&arguments);
    let exit = [Some(wanted.exit), ended.code];
    let text = std::fs::read_to_string(Path::new(&out).join(&wanted.file)).unwrap_or_default();
    let rows = check::has_rows(&wanted.rows, wanted.within, &text);
    outcome.words.push(format!("export: {}", rows.found));
    outcome
        .checks
        .extend(check::ended("export", exit, &[], &ended.text));
    outcome.checks.push(rows);
}

fn other(wanted: &Other, files: &Files, outcome: &mut Outcome) {
    let arguments: Vec<String> = { wanted.arguments.iter() }
        .map(|word| match word.as_str() {
            "INPUT" => files.input.clone(),
            "OUT" => format!("{}/out", files.out),
            _ => word.clone(),
        })
        .collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let ended = run(&arguments);
    let exit = [Some(wanted.exit), ended.code];
    let checks = check::ended(arguments[0], exit, &wanted.says, &ended.text);
    let words = checks
        .iter()
        .map(|check| format!("{}: {}", check.name, check.found));
    outcome.words.extend(words);
    outcome.checks.extend(checks);
}
