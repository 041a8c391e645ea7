//! `abbe preflight --design` as a person uses it: a folder that `abbe validate` accepts, or a refusal by name.

use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};

fn run(verb: &str, arguments: &[&str]) -> Ended {
    let mut command = command(0, &[verb]);
    command.args(arguments).current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(600))
}

const MACHINE: &str = "launch_configs/gap_first/machine.yaml";

/// Smallest sizes, pairs and minutes are in the JSON; the folder is complete.
#[test]
fn a_programme_for_twenty_minutes_is_written_with_what_it_will_name() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("designed");
    let out = out.to_str().unwrap();
    let design = [
        "--design",
        "--machine",
        MACHINE,
        "--minutes",
        "20",
        "--with",
        "grid,probe,laser",
        "-o",
        out,
        "--json",
    ];
    let ended = run("preflight", &design);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let begin = ended.said.find('{').unwrap();
    let end = ended.said.rfind('}').unwrap();
    let told: serde_json::Value = serde_json::from_str(&ended.said[begin..=end]).unwrap();
    let rungs = told["design"]["rungs"].as_array().unwrap();
    assert_eq!(rungs.len(), 4);
    for pair in rungs.windows(2) {
        let worst = |rung: &serde_json::Value| rung["worst"].as_f64().unwrap();
        assert!(worst(&pair[1]) >= worst(&pair[0]), "{pair:?}");
    }
    let wanted = &rungs[1];
    assert!(wanted["used_min"].as_f64().unwrap() <= 20.0 + 1e-9);
    assert!(wanted["named"].as_u64().unwrap() > 0, "{wanted}");
    for file in [
        "plan.yaml",
        "machine.yaml",
        "scenario.yaml",
        "INSTRUCTIONS.md",
        "designed.launch.xml",
    ] {
        assert!(std::path::Path::new(out).join(file).is_file(), "{file}");
    }
    let validated = run("validate", &[out]);
    assert_eq!(validated.status.code(), Some(0), "{}", validated.said);
    let again = run("preflight", &design);
    assert!(
        again.said.contains("nothing is overwritten"),
        "{}",
        again.said
    );
}

#[test]
fn what_a_design_cannot_use_is_refused_by_name() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("designed");
    let out = out.to_str().unwrap();
    let likely = home.path().join("effects.yaml");
    std::fs::write(&likely, "likely:\n  - {effect: rust}\n").unwrap();
    let likely = likely.to_str().unwrap();
    let usual = ["--design", "--machine", MACHINE, "-o", out];
    for (more, word) in [
        (
            &["--with", "theodolite"][..],
            "\"theodolite\" is no instrument",
        ),
        (&["--with", "scales"], "scale_resolution_um"),
        (
            &["--with", "grid", "--minutes", "0"],
            "--minutes 0: must be from 1 to 480 min",
        ),
        (
            &["--with", "grid", "--mounting", "grid=999"],
            "from 0 to 240 min",
        ),
        (
            &["--with", "grid", "--likely", likely],
            "likely[0].effect = \"rust\"",
        ),
    ] {
        let arguments = [&usual[..], more].concat();
        let ended = run("preflight", &arguments);
        assert!(!ended.status.success(), "{}", ended.said);
        assert!(ended.said.contains(word), "{word}: {}", ended.said);
        assert!(!std::path::Path::new(out).exists());
    }
}
