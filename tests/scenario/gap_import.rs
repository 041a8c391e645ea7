//! A person with a laser, a ballbar or a logger: `abbe import` of their table, then `abbe diagnose` of the bag.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tempfile::TempDir;

const MACHINE: &str = "launch_configs/gap_first/machine.yaml";
/// One with thermometers on its spindle.
const WARM: &str = "launch_configs/first_run/machine.yaml";

fn run(arguments: &[&str]) -> Ended {
    let mut command = command(0, arguments);
    command.current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(300))
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Imports a table and diagnoses it; the report.
fn diagnosed(csv: &str, map: &str, machine: &str) -> (Value, String) {
    let home = TempDir::new().unwrap();
    let (bag, report) = (home.path().join("bag"), home.path().join("gap.json"));
    let ended = run(&[
        "import",
        csv,
        "--map",
        map,
        "--machine",
        machine,
        "-o",
        &shown(&bag),
    ]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let ended = run(&[
        "diagnose",
        &shown(&bag),
        "--machine",
        machine,
        "--json",
        &shown(&report),
    ]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let text = std::fs::read_to_string(&report).unwrap();
    (serde_json::from_str(&text).unwrap(), ended.said)
}

/// Size of a cause, whatever its status, with the interval.
fn size(report: &Value, effect: &str, axis: &str) -> [f64; 3] {
    let causes = report["causes"].as_array().unwrap();
    let cause = causes
        .iter()
        .find(|cause| cause["effect"] == effect && cause["axis"] == axis);
    let cause = cause.unwrap_or_else(|| panic!("{effect} {axis} is none of {causes:#?}"));
    let of = &cause["parameters"][0];
    ["value", "low", "high"].map(|key| of[key].as_f64().unwrap())
}

#[test]
fn a_ballbar_shows_squareness_and_backlash_with_their_sizes() {
    let (report, said) = diagnosed(
        "tests/import/ballbar.csv",
        "tests/import/ballbar.yaml",
        MACHINE,
    );
    eprintln!("{said}");
    assert_eq!(report["inputs"]["bags"][0]["runs"], 6);
    assert_eq!(report["gap"]["above_floor"], true);
    let [play_um, ..] = size(&report, "backlash", "X");
    assert!((play_um - 4.0).abs() < 0.6, "{play_um}");
    let [angle_urad, ..] = size(&report, "squareness", "XY");
    assert!((angle_urad.abs() - 20.0).abs() < 3.0, "{angle_urad}");
}

#[test]
fn a_laser_shows_scale_and_backlash_with_their_sizes() {
    let (report, said) = diagnosed(
        "tests/import/positioning.csv",
        "tests/import/positioning.yaml",
        MACHINE,
    );
    eprintln!("{said}");
    assert_eq!(report["inputs"]["bags"][0]["runs"], 5);
    let [play_um, ..] = size(&report, "backlash", "X");
    assert!((play_um - 5.0).abs() < 0.6, "{play_um}");
}

#[test]
fn a_log_that_was_made_once_says_what_to_record_and_one_of_three_mornings_is_diagnosed() {
    let home = TempDir::new().unwrap();
    let bag = home.path().join("bag");
    let ended = run(&[
        "import",
        "tests/import/drift.csv",
        "--map",
        "tests/import/drift.yaml",
        "--machine",
        WARM,
        "-o",
        &shown(&bag),
    ]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let ended = run(&["diagnose", &shown(&bag)]);
    assert_eq!(ended.status.code(), Some(1), "{}", ended.said);
    assert!(ended.said.contains("three times"), "{}", ended.said);

    // The nose grows by 3 um/K with a temperature that rises by 6 K each morning, 0.1 um and 0.02 K of noise.
    let mut noise = Pcg64Mcg::seed_from_u64(20_261_121);
    let mut normal = || -> f64 { StandardNormal.sample(&mut noise) };
    let mut table = String::from("run,time_s,z_um,spindle\n");
    for morning in 0..3 {
        for minute in 0..90 {
            let warm_k = 6.0 * (1.0 - (-f64::from(minute) / 30.0).exp());
            let (at_s, z_um) = (
                morning * 86_400 + minute * 60,
                3.0 * warm_k + 0.1 * normal(),
            );
            let degc = 20.0 + warm_k + 0.02 * normal();
            writeln!(table, "{},{at_s},{z_um:.3},{degc:.3}", morning + 1).unwrap();
        }
    }
    let (csv, map) = (home.path().join("warm.csv"), home.path().join("warm.yaml"));
    std::fs::write(&csv, table).unwrap();
    std::fs::write(
        &map,
        "start_s: 1767600000\nat_mm: {X: 0.0, Y: 0.0, Z: 100.0}\ntest:\n  log: {axis: Z, run: run, time_s: time_s, displacement_um: z_um, temperature_degc: {spindle_front: spindle}}\n",
    )
    .unwrap();
    let (report, said) = diagnosed(&shown(&csv), &shown(&map), WARM);
    eprintln!("{said}");
    assert_eq!(report["inputs"]["bags"][0]["runs"], 3);
    assert_eq!(report["gap"]["above_floor"], true);
    assert_eq!(report["where"][0]["covariate"], "temperature_spindle_front");
    let [grown_um, ..] = size(&report, "spindle_growth", "");
    assert!((15.0..40.0).contains(&grown_um.abs()), "{grown_um}");
}
