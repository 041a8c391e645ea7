//! The Debian package: what is in it, and that its units would start.
//!
//! Building it needs the cargo subcommand `cargo-deb`, looking at units needs systemd, both of which `tests/run` installs;
//! where one is not there that is said, and is a failure with `CI=true`.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use abbe_tests::program::{Process, abbe, command, domain, root};
use nix::sys::signal::Signal;

fn folder() -> PathBuf {
    root().join("nodes/abbe/debian")
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

/// What a program says, or why it cannot be asked here.
fn asked(program: &str, arguments: &[&str]) -> Option<Output> {
    let output = Command::new(program).args(arguments).output();
    if let Err(error) = &output {
        let reason = format!("{program}: {error} (tests/run installs it)");
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
        eprintln!("NOT TESTED: {reason}");
    }
    output.ok()
}

fn start_node(scenarios: &Path, program: &Path, which: &str) -> Output {
    Command::new(folder().join("start-node"))
        .arg(which)
        .env("ABBE_SCENARIOS", scenarios)
        .env("ABBE_PROGRAM", program)
        .output()
        .unwrap()
}

#[test]
fn the_units_start_with_a_program_and_folders_that_are_there() {
    if asked("systemd-analyze", &["--version"]).is_none() {
        return;
    }
    let home = tempfile::tempdir().unwrap();
    for unit in ["abbe@.service", "abbe-node@.service", "abbe-router.service"] {
        let text = fs::read_to_string(folder().join(unit)).unwrap();
        let scripts = folder().display().to_string();
        let here = text
            .replace("/usr/bin/abbe", &abbe().display().to_string())
            .replace("/usr/lib/abbe", &scripts);
        assert_ne!(here, text, "{unit} starts neither of them");
        let instance = unit.replace("@.", "@short_cell.");
        let path = home.path().join(&instance);
        fs::write(home.path().join(unit), &here).unwrap();
        fs::write(&path, here).unwrap();
        let path = path.display().to_string();
        let output = asked("systemd-analyze", &["verify", "--man=no", &path]).unwrap();
        let said = said(&output);
        let ours: Vec<_> = said.lines().filter(|line| line.contains("abbe")).collect();
        assert_eq!(ours, [""; 0], "{unit}");
    }
}

#[test]
fn a_node_is_started_with_its_scenarios_parameters_and_nothing_else() {
    let home = tempfile::tempdir().unwrap();
    let echo = home.path().join("program");
    fs::write(&echo, "#!/bin/sh\necho \"$@\"\n").unwrap();
    fs::set_permissions(&echo, fs::Permissions::from_mode(0o755)).unwrap();
    let scenarios = root().join("launch_configs");
    let started = start_node(&scenarios, &echo, "short_cell:probe");
    let file = scenarios.join("short_cell/probe.yaml");
    let expected = format!("node probe --ros-args --params-file {}\n", file.display());
    assert_eq!(said(&started), expected);
    let named = start_node(&scenarios, &echo, "three_hosts:host_clock:clock_of_models");
    let file = scenarios.join("three_hosts/clock_of_models.yaml");
    let words = "node host_clock --ros-args -r __node:=clock_of_models --params-file";
    assert_eq!(said(&named), format!("{words} {}\n", file.display()));
    for (wrong, code, word) in [
        ("short_cell", 2, "must be SCENARIO:NODE"),
        (":probe", 2, "must be SCENARIO:NODE"),
        ("short_cell:nobody", 1, "nobody.yaml cannot be read"),
    ] {
        let refused = start_node(&scenarios, &echo, wrong);
        assert_eq!(refused.status.code(), Some(code), "{wrong}");
        assert!(said(&refused).contains(word), "{}", said(&refused));
    }
}

fn start_router(configuration: &Path, program: &Path) -> Output {
    Command::new(folder().join("start-router"))
        .env("ABBE_ROUTER_CONFIGURATION", configuration)
        .env("ABBE_ROUTER", program)
        .env_remove("ZENOH_RUNTIME")
        .output()
        .unwrap()
}

#[test]
fn a_router_is_started_by_its_configuration_or_what_lacks_is_said() {
    let home = tempfile::tempdir().unwrap();
    let echo = home.path().join("zenohd");
    fs::write(&echo, "#!/bin/sh\necho \"$ZENOH_RUNTIME $@\"\n").unwrap();
    fs::set_permissions(&echo, fs::Permissions::from_mode(0o755)).unwrap();
    let shipped = root().join("launch_configs/three_hosts/zenoh_router.json5");
    let started = start_router(&shipped, &echo);
    let threads = "(rx: (worker_threads: 8), net: (worker_threads: 4))";
    let expected = format!("{threads} --config {}\n", shipped.display());
    assert_eq!(said(&started), expected);
    let nowhere = home.path().join("nowhere");
    // Exit codes by which systemd knows that it need not try again.
    for (configuration, program, code, word) in [
        (&nowhere, &echo, 6, "nowhere cannot be read"),
        (&shipped, &nowhere, 5, "cargo install zenohd"),
    ] {
        let refused = start_router(configuration, program);
        assert_eq!(refused.status.code(), Some(code), "{}", said(&refused));
        assert!(said(&refused).contains(word), "{}", said(&refused));
    }
}

/// A recorder that systemd starts again, after a crash or at the next boot, begins a bag of its own.
#[test]
fn a_recorder_that_is_started_again_leaves_the_bags_of_earlier_starts_alone() {
    let state = tempfile::tempdir().unwrap();
    let bag = |start: u32| {
        let folder = state.path().join("three_hosts_bag");
        folder.join(format!("three_hosts_bag_{start}"))
    };
    for start in 0..3 {
        let mut unit = Command::new(folder().join("start-node"));
        let like = command(domain(18), &[]);
        for (name, value) in like.get_envs() {
            match value {
                Some(value) => unit.env(name, value),
                None => unit.env_remove(name),
            };
        }
        unit.arg("three_hosts:recorder")
            .env("ABBE_SCENARIOS", root().join("launch_configs"))
            .env("ABBE_PROGRAM", abbe())
            .current_dir(state.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let recorder = Process::start(unit);
        let deadline = Instant::now() + Duration::from_secs(30);
        let begun = bag(start).join("metadata.yaml");
        while !begun.exists() {
            assert!(
                Instant::now() < deadline,
                "{} is not there",
                begun.display()
            );
            std::thread::sleep(Duration::from_millis(20));
        }
        recorder.signal(Signal::SIGKILL);
        let ended = recorder.ended_within(Duration::from_secs(5));
        assert_eq!(ended.status.code(), None, "{}", ended.said);
    }
    for start in 0..3 {
        assert!(recorder::Bag::open(bag(start)).is_ok(), "{start}");
    }
    assert!(!bag(3).exists());
}

#[test]
fn the_package_holds_program_units_and_scenarios() {
    if asked("cargo-deb", &["--version"]).is_none() || asked("dpkg-deb", &["--version"]).is_none() {
        return;
    }
    let home = tempfile::tempdir().unwrap();
    let package = home.path().join("abbe.deb");
    let built = Command::new("cargo-deb")
        .args([
            "deb",
            "--no-build",
            "--no-strip",
            "--fast",
            "-p",
            "abbe",
            "-o",
        ])
        .arg(&package)
        .current_dir(root())
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", said(&built));
    let package = package.display().to_string();
    let contents = said(&asked("dpkg-deb", &["-c", &package]).unwrap());
    let holds = |rights: &str, path: &str| {
        let mut lines = contents.lines();
        let right = |line: &str| line.starts_with(rights) && line.ends_with(path);
        assert!(lines.any(right), "{rights} {path}\n{contents}");
    };
    holds("-rwxr-xr-x", "./usr/bin/abbe");
    assert!(!contents.contains("abbe-trials"), "{contents}");
    holds("-rwxr-xr-x", "./usr/lib/abbe/start-node");
    holds("-rwxr-xr-x", "./usr/lib/abbe/start-router");
    holds("-rw-r--r--", "./usr/lib/systemd/system/abbe@.service");
    holds("-rw-r--r--", "./usr/lib/systemd/system/abbe-node@.service");
    holds("-rw-r--r--", "./usr/lib/systemd/system/abbe-router.service");
    holds("-rw-r--r--", "./etc/default/abbe");
    holds("-rw-r--r--", "./etc/abbe/zenoh_router.json5");
    let scenarios = "./usr/share/abbe/launch_configs";
    holds(
        "-rw-r--r--",
        &format!("{scenarios}/short_cell/short_cell.launch.xml"),
    );
    holds(
        "-rw-r--r--",
        &format!("{scenarios}/linuxcnc_latency/linuxcnc_bridge.yaml"),
    );
    let control = said(&asked("dpkg-deb", &["-f", &package]).unwrap());
    assert!(control.contains("Package: abbe\n"), "{control}");
    installed(home.path(), &package);
}

/// Does what the scripts of a package do, below `home`.
fn installed(home: &Path, package: &str) {
    let unpacked = home.join("unpacked");
    let to = unpacked.display().to_string();
    assert!(
        asked("dpkg-deb", &["-R", package, &to])
            .unwrap()
            .status
            .success()
    );
    for script in ["postinst", "prerm"] {
        let path = unpacked.join("DEBIAN").join(script);
        let checked = asked("sh", &["-n", &path.display().to_string()]).unwrap();
        assert!(checked.status.success(), "{script}: {}", said(&checked));
    }
    // What postinst does with the program and the scenarios of the package.
    let prefix = home.join("opt");
    let installed = Command::new(unpacked.join("usr/bin/abbe"))
        .arg("install-ros")
        .arg(&prefix)
        .arg("--scenarios")
        .arg(unpacked.join("usr/share/abbe/launch_configs"))
        .output()
        .unwrap();
    assert!(installed.status.success(), "{}", said(&installed));
    assert!(prefix.join("lib/abbe/probe").is_file());
}
