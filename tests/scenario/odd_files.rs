//! Inputs that are no regular files, at every entrance of the program: refused by their kind, and nothing waits for them.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use abbe_tests::program::{Process, command, root};
use abbe_tests::scenario::Scenario;

/// A pipe, which blocks whoever opens it; a device without an end; a folder.
const KINDS: [(&str, &str); 3] = [
    ("pipe", "is a pipe (FIFO)"),
    ("device", "is a device"),
    ("folder", "is a folder"),
];

/// Makes `path` what it is not to be; what was there is gone.
fn spoil(path: &Path, kind: &str) {
    let _ = std::fs::remove_file(path);
    match kind {
        "pipe" => {
            let made = Command::new("mkfifo").arg(path).status().unwrap();
            assert!(made.success());
        }
        "device" => std::os::unix::fs::symlink("/dev/zero", path).unwrap(),
        _ => std::fs::create_dir(path).unwrap(),
    }
}

/// Ends soon, with exit code 1 and the kind of what it was given.
fn is_refused(what: &str, arguments: &[&str], kind: &str) {
    let ended = Process::start(command(0, arguments)).ended_within(Duration::from_secs(60));
    assert_eq!(ended.status.code(), Some(1), "{what}: {}", ended.said);
    assert!(ended.said.contains(kind), "{what}: {}", ended.said);
}

#[test]
fn no_file_of_a_scenario_that_is_no_regular_file_is_waited_for() {
    for (kind, words) in KINDS {
        for file in [
            "plan.yaml",
            "scenario.yaml",
            "machine.yaml",
            "plant.yaml",
            "fake_cnc.yaml",
            "sequencer.yaml",
            "production.ngc",
            "first_run.launch.xml",
        ] {
            let scenario = Scenario::copy_of("first_run");
            spoil(&scenario.path(file), kind);
            let (folder, out) = (scenario.folder(), scenario.out());
            let [folder, out] = [&folder, &out].map(|path| path.to_str().unwrap());
            let arguments = ["run", "--no-dds", folder, "--runs", out];
            is_refused(&format!("{file}, {kind}"), &arguments, words);
        }
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn no_file_of_a_verb_that_is_no_regular_file_is_waited_for() {
    let home = tempfile::tempdir().unwrap();
    let of = |path: &str| root().join(path).display().to_string();
    let (bag, machine) = (
        of("bags/grid_circles"),
        of("launch_configs/gap_first/machine.yaml"),
    );
    let budget = of("launch_configs/dual_loop/budget.yaml");
    let (map, table) = (
        of("tests/import/ballbar.yaml"),
        of("tests/import/ballbar.csv"),
    );
    let out = home.path().join("out").display().to_string();
    for (kind, words) in KINDS {
        let odd: PathBuf = home.path().join(kind);
        spoil(&odd, kind);
        let odd = odd.to_str().unwrap();
        let mut table_of: Vec<Vec<&str>> = vec![
            vec!["import-map", odd],
            vec![
                "import",
                odd,
                "--map",
                &map,
                "--machine",
                &machine,
                "-o",
                &out,
            ],
            vec![
                "import",
                &table,
                "--map",
                odd,
                "--machine",
                &machine,
                "-o",
                &out,
            ],
            vec![
                "import",
                &table,
                "--map",
                &map,
                "--machine",
                odd,
                "-o",
                &out,
            ],
            vec![
                "import-shift",
                odd,
                "--map",
                odd,
                "--order",
                odd,
                "--machine",
                &machine,
                "-o",
                &out,
            ],
            vec!["report", &bag, "--budget", &budget, "--limits", odd],
            vec!["report", &bag, "--budget", odd],
            vec!["diagnose", &bag, "--machine", odd],
            vec!["record", "--machine", odd, "-o", &out],
        ];
        if kind != "folder" {
            // A folder is a bag without files, or a scenario without a launch file.
            table_of.push(vec!["report", odd]);
            table_of.push(vec!["check", odd]);
            table_of.push(vec!["preflight", odd, "--machine", &machine]);
        }
        for arguments in table_of {
            is_refused(&arguments.join(" "), &arguments, words);
        }
    }
}

#[test]
fn a_log_that_is_no_regular_file_ends_the_bridge_at_once() {
    for (kind, words) in KINDS {
        let home = tempfile::tempdir().unwrap();
        let log = home.path().join("log.shdr");
        spoil(&log, kind);
        let map = home.path().join("map.yaml");
        std::fs::write(&map, "values: {}\n").unwrap();
        let file = home.path().join("bridge.yaml");
        let text = "/**:\n  ros__parameters:\n    source: log\n    log_file: log.shdr\n    map_file: map.yaml\n";
        std::fs::write(&file, text).unwrap();
        let file = file.to_str().unwrap();
        let arguments = [
            "node",
            "mtconnect_bridge",
            "--ros-args",
            "--params-file",
            file,
        ];
        is_refused(&format!("log, {kind}"), &arguments, words);
        spoil(&map, kind);
        is_refused(&format!("map, {kind}"), &arguments, words);
        let odd = home.path().join("odd.yaml");
        spoil(&odd, kind);
        let odd = odd.to_str().unwrap();
        let arguments = ["node", "probe", "--ros-args", "--params-file", odd];
        is_refused(&format!("parameters, {kind}"), &arguments, words);
    }
}

#[test]
fn no_output_that_is_no_regular_file_is_waited_for_or_said_to_be_written() {
    let home = tempfile::tempdir().unwrap();
    let of = |path: &str| root().join(path).display().to_string();
    let (bag, table) = (
        of("bags/cold_reference"),
        of("tests/import/positioning.csv"),
    );
    let keep = ["--keep", "--kept-as", "m", "--kept-at", "2026-01-01"];
    for (kind, words) in KINDS {
        let odd: PathBuf = home.path().join(kind);
        spoil(&odd, kind);
        let odd = odd.to_str().unwrap();
        let report = ["report", &table];
        for arguments in [
            vec!["history", "--store", odd],
            vec!["history", "add", &bag, "--store", odd],
            [&report[..], &keep, &["--store", odd]].concat(),
            vec!["diagnose", &bag, "--html", odd],
            vec!["diagnose", &bag, "--json", odd],
            vec!["diagnose", &bag, "--write-machine", odd],
        ] {
            is_refused(&arguments.join(" "), &arguments, words);
        }
    }
}
