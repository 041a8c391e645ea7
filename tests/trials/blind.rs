//! The diagnosis of a trial sees the bag and the machine file, and nothing else.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use abbe_tests::program::{abbe, abbe_trials};
use serde_json::Value;

use crate::series::{folder, run, seals};

/// What every program opens: the loader's libraries, the kernel's tables, the shop's time.
const SYSTEM: [&str; 8] = [
    "/etc/",
    "/lib",
    "/usr/lib",
    "/usr/share/zoneinfo",
    "/proc/",
    "/sys/",
    "/dev/null",
    "/opt/",
];

const DIAGNOSE: [&str; 6] = [
    "diagnose",
    "bag",
    "--machine",
    "machine.yaml",
    "--json",
    "-",
];

/// Arm i, one trial, kept; its folder.
fn trial(folder: &Path) -> (PathBuf, String) {
    let arguments = [
        "--arm", "i", "--n", "1", "--seed", "5", "--jobs", "1", "--keep",
    ];
    let (_, said) = run(folder, &arguments);
    let name = said
        .lines()
        .find_map(|line| line.strip_prefix("sealed ")?.split(':').next())
        .unwrap_or_else(|| panic!("no seal was told:\n{said}"));
    (folder.join("out").join(name), said.clone())
}

/// A report without the time that it took.
fn timeless(text: &[u8]) -> Value {
    let mut report: Value = serde_json::from_slice(text).unwrap();
    report["runtime_s"] = Value::Null;
    report
}

#[test]
fn the_seal_is_told_before_the_verdict_and_its_answer_does_not_need_it() {
    let folder = folder();
    let (trial, said) = trial(folder.path());
    let place = |what: &str| said.find(what).unwrap_or_else(|| panic!("{what}:\n{said}"));
    assert!(place("sha256 ") < place(" -> "));
    let sealed = std::fs::read(trial.join("gap.json")).unwrap();
    std::fs::remove_dir_all(seals(folder.path())).unwrap();
    std::fs::remove_file(folder.path().join("out/journal.jsonl")).unwrap();
    let output = Command::new(abbe())
        .args(DIAGNOSE)
        .current_dir(&trial)
        .env_clear()
        .output()
        .unwrap();
    assert!(output.status.success());
    assert_eq!(timeless(&output.stdout), timeless(&sealed));
}

/// As of a root's own clone: others may not pass its folder.
#[test]
fn a_program_that_only_root_may_reach_is_handed_to_nobody_and_a_folder_of_trials_is_named() {
    if !nix::unistd::geteuid().is_root() {
        eprintln!("not root: the diagnosis runs as this user, to whom nothing needs to be handed");
        return;
    }
    let (closed, open) = (tempfile::tempdir().unwrap(), folder());
    let mode = std::fs::Permissions::from_mode(0o700);
    std::fs::set_permissions(closed.path(), mode).unwrap();
    let program = closed.path().join("abbe-trials");
    std::fs::copy(abbe_trials(), &program).unwrap();
    let trials = |out: &Path| {
        let mut command = Command::new(&program);
        command.args(["--arm", "iv", "--n", "1", "--seed", "5", "--jobs", "1"]);
        let out = command.arg("--out").arg(out.join("out")).output().unwrap();
        (
            out.status.code(),
            String::from_utf8_lossy(&out.stderr).into_owned(),
        )
    };
    let (code, said) = trials(open.path());
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = trials(closed.path());
    assert_eq!(code, Some(1), "{said}");
    let name = closed.path().display().to_string();
    assert!(
        said.contains(&format!("only the owner may pass {name}")),
        "{said}"
    );
}

#[test]
fn it_opens_no_file_but_its_inputs() {
    let folder = folder();
    let (trial, _) = trial(folder.path());
    let log = folder.path().join("opened");
    let traced = Command::new("strace")
        .args(["-f", "-e", "trace=open,openat,openat2,creat", "-o"])
        .arg(&log)
        .arg(abbe())
        .args(DIAGNOSE)
        .current_dir(&trial)
        .env_clear()
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    let Ok(status) = traced else {
        // Without a tracer: in a folder of its own, with everything else of the series gone.
        let alone = crate::series::folder();
        let copied = Command::new("cp")
            .arg("-r")
            .arg(&trial)
            .arg(alone.path())
            .status();
        assert!(copied.unwrap().success());
        let before = std::fs::read(trial.join("gap.json")).unwrap();
        let there = alone.path().join(trial.file_name().unwrap());
        std::fs::remove_file(there.join("gap.json")).unwrap();
        std::fs::remove_dir_all(folder.path()).unwrap();
        let output = Command::new(abbe())
            .args(DIAGNOSE)
            .current_dir(there)
            .output()
            .unwrap();
        assert_eq!(timeless(&output.stdout), timeless(&before));
        return;
    };
    assert!(status.success());
    let text = std::fs::read_to_string(&log).unwrap();
    let opened = text
        .lines()
        .filter(|line| !line.contains(" = -1 "))
        .filter_map(path_of);
    let opened: Vec<&str> = opened.collect();
    assert!(
        opened.iter().any(|path| path.starts_with("bag/")),
        "{opened:?}"
    );
    let others: Vec<&&str> = opened.iter().filter(|path| !is_its_own(path)).collect();
    assert!(others.is_empty(), "{others:?}");
    assert!(!is_its_own("../../seals/i-5-00000.json") && !is_its_own("gap.json"));
}

fn path_of(line: &str) -> Option<&str> {
    line.split('"').nth(1)
}

fn is_its_own(path: &str) -> bool {
    path == "bag"
        || path == "machine.yaml"
        || (path.starts_with("bag/") && !path.contains(".."))
        || SYSTEM.iter().any(|place| path.starts_with(place))
}
