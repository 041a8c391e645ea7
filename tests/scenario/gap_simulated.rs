//! `abbe diagnose --simulated`: a simulator that is not ours in the place of the machine file's own. Machine and simulator
//! share errors that the machine file does not have; what the simulator lacks is named, and they are not.

use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
use abbe_tests::python::{interpreter, script, succeeded};
use serde_json::Value;
use tempfile::TempDir;

use crate::gap_report::against_schema;

const MACHINE: &str = "launch_configs/gap_first/machine.yaml";
/// What the screw of X has and the simulator's has not.
const PLAY_UM: f64 = 4.0;

fn run(command: std::process::Command) -> Ended {
    let mut command = command;
    command.current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(300))
}

/// Imports a ballbar's table into a bag beside it.
fn imported(table: &Path, radius_mm: f64) -> PathBuf {
    let (map, bag) = (table.with_extension("yaml"), table.with_extension(""));
    let text = format!(
        "start_s: 1767600000\ntest:\n  circle: {{plane: XY, centre_mm: [0.0, 0.0, 30.0], radius_mm: {radius_mm:?}, feed_mm_min: 1500.0, run: run, angle_deg: angle_deg, radial_um: radial_um}}\n"
    );
    std::fs::write(&map, text).unwrap();
    let mut import = command(0, &["import"]);
    import.arg(table).arg("--map").arg(map);
    import.args(["--machine", MACHINE, "-o"]).arg(&bag);
    let ended = run(import);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    bag
}

/// A ballbar of two radii by the Python simulator, as bags: repeats, degrees a reading, play and noise.
fn ballbar(
    python: &PathBuf,
    home: &Path,
    name: &str,
    [repeats, degrees, play_um, noise_um]: [f64; 4],
) -> Vec<PathBuf> {
    let of_radius = |radius_mm: f64| {
        let table = home.join(format!("{name}_r{radius_mm:.0}.csv"));
        let mut simulator = script(python, "ballbar_simulator.py");
        simulator.arg(&table);
        simulator.args([radius_mm, repeats, degrees, play_um, noise_um].map(|n| n.to_string()));
        assert_eq!(succeeded(&simulator.output().unwrap()), "");
        imported(&table, radius_mm)
    };
    [150.0, 75.0].map(of_radius).to_vec()
}

fn diagnose(bags: &[PathBuf], simulated: &[PathBuf], more: &[&Path]) -> Ended {
    let mut diagnose = command(0, &["diagnose"]);
    diagnose.args(bags).args(["--machine", MACHINE]).args(more);
    for bag in simulated {
        diagnose.arg("--simulated").arg(bag);
    }
    run(diagnose)
}

fn diagnosed(home: &Path, bags: &[PathBuf], simulated: &[PathBuf]) -> (Value, String) {
    let json = home.join("gap.json");
    let ended = diagnose(bags, simulated, &[Path::new("--json"), &json]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    eprintln!("{}", ended.said);
    let text = std::fs::read_to_string(json).unwrap();
    (serde_json::from_str(&text).unwrap(), ended.said)
}

/// Status, effect and axis of what is named or one of a set.
fn causes(report: &Value) -> Vec<(&str, &str, &str)> {
    let all = report["causes"].as_array().unwrap().iter();
    let all = all.filter(|cause| cause["status"] != "surrogate");
    all.map(|cause| {
        let of = |key: &str| cause[key].as_str().unwrap();
        (of("status"), of("effect"), of("axis"))
    })
    .collect()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn what_an_independent_simulator_lacks_is_named_and_what_it_has_is_not() {
    let Some(python) = interpreter("diagnose beside a simulator in Python") else {
        return;
    };
    let home = TempDir::new().unwrap();
    let home = home.path();
    let machine = ballbar(&python, home, "machine", [3.0, 1.0, PLAY_UM, 0.1]);
    // Each test once, at half of the machine's readings, without noise and play.
    let simulator = ballbar(&python, home, "simulator", [1.0, 2.0, 0.0, 0.0]);
    let (against_twin, _) = diagnosed(home, &machine, &[]);
    assert_eq!(against_twin.get("simulated"), None);
    let (report, said) = diagnosed(home, &machine, &simulator);

    // At one feed a play that grows with the feed looks the same.
    assert_eq!(causes(&report), [("set", "backlash", "X")]);
    let size = &report["causes"][0]["parameters"][0];
    let [value, low, high] = ["value", "low", "high"].map(|key| number(&size[key]));
    assert!(
        low <= PLAY_UM && PLAY_UM <= high && high - low < 0.6,
        "{size}"
    );
    assert!((value - PLAY_UM).abs() < 0.3, "{size}");
    let rms = |report: &Value| number(&report["gap"]["rms_um"]);
    assert!(rms(&against_twin) > 1.5 * rms(&report), "{}", rms(&report));
    let shrink = &report["shrink"];
    let [before, after] = ["before", "after"].map(|key| number(&shrink["rms_um"][key]));
    assert!(before > 1.0 && after < 0.4 * before, "{shrink}");
    assert!(number(&shrink["gap_closed"]["value"]) > 0.9, "{shrink}");

    let compared = &report["simulated"];
    assert_eq!(
        compared["runs"],
        serde_json::json!({"matched": 12, "of": 12})
    );
    assert_eq!(compared["stood_in"], 8);
    assert_eq!(compared["bags"].as_array().unwrap().len(), 2);
    // Readings on a reversal are left out of both; those beside it have the simulator's readings on one side, or beyond it.
    let lost = compared["unmatched"].as_array().unwrap();
    assert!(
        lost.iter().any(|it| it["reason"] == "direction"),
        "{compared}"
    );
    let is_known = |it: &Value| it["reason"] == "direction" || it["reason"] == "off_path";
    let mut readings = 0.0;
    for own in lost {
        assert!(is_known(own) && own["channel"] == "radial", "{own}");
        readings += number(&own["readings"]);
    }
    assert!((12.0..=120.0).contains(&readings), "{compared}");
    let [matched, of] = ["matched", "of"].map(|key| number(&compared["readings"][key]));
    assert!((of - matched - readings).abs() < 0.5, "{compared}");
    assert_eq!(against_schema(&report), Vec::<String>::new());
    for words in [
        "12 of 12 runs",
        "readings of radial: the simulator turns round",
        "8 of these runs",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn a_simulators_bag_that_is_the_machines_own_or_cut_is_refused_with_the_remedy() {
    let home = TempDir::new().unwrap();
    let table = home.path().join("machine.csv");
    std::fs::copy(root().join("tests/import/ballbar.csv"), &table).unwrap();
    let bag = [imported(&table, 100.0)];
    let ended = diagnose(&bag, &bag, &[]);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    assert!(
        ended.said.contains("name the bag that the simulator made"),
        "{}",
        ended.said
    );

    // Its end is lost, and so is the last circle.
    let cut = table.with_file_name("cut.csv");
    std::fs::copy(&table, &cut).unwrap();
    let cut = imported(&cut, 100.0);
    let files = std::fs::read_dir(&cut)
        .unwrap()
        .map(|file| file.unwrap().path());
    let mcap = files.filter(|file| file.extension().is_some_and(|end| end == "mcap"));
    for path in mcap {
        let file = std::fs::File::options().write(true).open(&path).unwrap();
        let length = file.metadata().unwrap().len();
        file.set_len(length / 4 * 3).unwrap();
    }
    let ended = diagnose(&bag, &[cut], &[]);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    assert!(ended.said.contains("--simulated"), "{}", ended.said);
    assert!(
        ended.said.contains("used whole or not at all"),
        "{}",
        ended.said
    );

    let machine = home.path().join("with.yaml");
    let more = [Path::new("--write-machine"), &machine];
    let ended = diagnose(&bag, &bag, &more);
    assert_eq!(ended.status.code(), Some(2), "{}", ended.said);
}
