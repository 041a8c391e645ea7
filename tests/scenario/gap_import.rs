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

fn causes(report: &Value) -> &[Value] {
    report["causes"].as_array().unwrap()
}

/// What is told with a status, with its first parameter as value, low and high.
fn told<'r>(report: &'r Value, status: &str) -> Vec<(&'r str, &'r str, [f64; 3])> {
    let told = causes(report)
        .iter()
        .filter(|cause| cause["status"] == status);
    told.map(|cause| {
        let first = &cause["parameters"][0];
        let size = ["value", "low", "high"].map(|key| first[key].as_f64().unwrap());
        let of = |key: &str| cause[key].as_str().unwrap();
        (of("effect"), of("axis"), size)
    })
    .collect()
}

/// What could stand in the place of a cause.
fn instead<'r>(report: &'r Value, effect: &str) -> Vec<&'r str> {
    let cause = causes(report)
        .iter()
        .find(|cause| cause["effect"] == effect);
    let others = cause.unwrap()["confusable_with"].as_array().unwrap().iter();
    let open = others.filter(|other| other["excluded"] == false);
    open.map(|other| other["effect"].as_str().unwrap())
        .collect()
}

/// The interval holds the truth and is no wider than `within`.
fn holds([value, low, high]: [f64; 3], truth: f64, within: f64) {
    assert!(
        low <= truth && truth <= high,
        "{truth}: {value} ({low} to {high})"
    );
    assert!(high - low <= within, "{value} ({low} to {high})");
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
    let [("backlash", "X", play_um), ("squareness", "XY", angle_urad)] = told(&report, "named")[..]
    else {
        panic!("{:#?}", causes(&report));
    };
    holds(play_um, 4.0, 0.6);
    let [value, low, high] = angle_urad;
    // Its sign is that of the tilt of Y to X, the table's that of the angle beyond 90 degrees.
    holds([-value, -high, -low], 20.0, 6.0);
    assert_eq!(told(&report, "set"), []);
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
    // At stops of one feed a play that grows with the feed looks the same.
    assert_eq!(told(&report, "named"), []);
    let [("backlash", "X", play_um)] = told(&report, "set")[..] else {
        panic!("{:#?}", causes(&report));
    };
    holds(play_um, 5.0, 0.6);
    assert_eq!(instead(&report, "backlash"), ["feed_lost_motion"]);
    // One line cannot tell a scale of the axis from one of the laser. 1.1 um at the ends, of four runs, are below what is named.
    let [("scale_error", "X", scale_um_per_m)] = told(&report, "surrogate")[..] else {
        panic!("{:#?}", causes(&report));
    };
    holds(scale_um_per_m, 4.0, 3.0);
    assert!(instead(&report, "scale_error").contains(&"length_wavelength"));
}

/// A laser's table: 12 um/m of scale, 5 um of backlash, 0.15 um between runs, 0.2 um of noise.
fn laser(noise: &mut Pcg64Mcg, runs: u32) -> String {
    let mut normal = |size: f64| -> f64 {
        let normal: f64 = StandardNormal.sample(noise);
        size * normal
    };
    let mut table = String::from("run,target_mm,deviation_um\n");
    for run in 1..=runs {
        let own_um = normal(0.15);
        let up = (0..14).map(|k| (1.0, f64::from(k)));
        let down = (0..14).rev().map(|k| (-1.0, f64::from(k)));
        for (sense, k) in up.chain(down) {
            let at_mm = -280.0 + 560.0 * k / 13.0;
            let deviation_um = 12e-3 * at_mm - 2.5 * sense + own_um + normal(0.2);
            writeln!(table, "{run},{at_mm:.3},{deviation_um:.3}").unwrap();
        }
    }
    table
}

#[test]
fn a_scale_that_a_laser_shows_clearly_is_told_with_its_size_and_all_that_make_the_same_line() {
    let home = TempDir::new().unwrap();
    let (csv, map) = (
        home.path().join("laser.csv"),
        home.path().join("laser.yaml"),
    );
    std::fs::write(
        &map,
        "start_s: 1767600000\nat_mm: {Y: 0.0, Z: 120.0}\ntest:\n  positioning: {axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, run: run, target_mm: target_mm, deviation_um: deviation_um}\n",
    )
    .unwrap();
    // What makes the same line is better by a hair with one noise or the other: the scale error leads with each.
    for seed in 20_261_121..20_261_125 {
        let mut noise = Pcg64Mcg::seed_from_u64(seed);
        std::fs::write(&csv, laser(&mut noise, 5)).unwrap();
        let (report, said) = diagnosed(&shown(&csv), &shown(&map), MACHINE);
        eprintln!("{said}");
        assert_eq!(told(&report, "named"), []);
        let [
            ("backlash", "X", play_um),
            ("scale_error", "X", scale_um_per_m),
        ] = told(&report, "set")[..]
        else {
            panic!("{:#?}", causes(&report));
        };
        holds(play_um, 5.0, 0.6);
        holds(scale_um_per_m, 12.0, 3.0);
        let line = instead(&report, "scale_error");
        assert!(line.contains(&"length_wavelength"), "{line:?}");
    }
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
    eprintln!(
        "named {:?} sets {:?}",
        told(&report, "named"),
        told(&report, "set")
    );
}
