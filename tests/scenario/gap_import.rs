//! A person with a laser, a ballbar or a logger: `abbe import` of their table, then `abbe diagnose` of the bag.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use abbe_tests::program::{Ended, Process, command, root};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tempfile::TempDir;

pub(crate) const MACHINE: &str = "launch_configs/gap_first/machine.yaml";
/// One with thermometers on its spindle.
const WARM: &str = "launch_configs/first_run/machine.yaml";

fn run(arguments: &[&str]) -> Ended {
    let mut command = command(0, arguments);
    command.current_dir(root());
    Process::start(command).ended_within(Duration::from_secs(300))
}

pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Imports a table into a folder; the bag.
fn imported(home: &Path, csv: &str, map: &str, machine: &str) -> PathBuf {
    let bag = home.join("bag");
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
    bag
}

/// Imports a table and diagnoses it; the report.
pub(crate) fn diagnosed(csv: &str, map: &str, machine: &str) -> (Value, String) {
    let home = TempDir::new().unwrap();
    let bag = imported(home.path(), csv, map, machine);
    let report = home.path().join("gap.json");
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

pub(crate) fn causes(report: &Value) -> &[Value] {
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
pub(crate) fn instead<'r>(report: &'r Value, effect: &str) -> Vec<&'r str> {
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
    // At one feed a play that grows with the feed looks the same.
    let [("backlash", "X", play_um)] = told(&report, "set")[..] else {
        panic!("{:#?}", causes(&report));
    };
    assert!(instead(&report, "backlash").contains(&"feed_lost_motion"));
    let [("squareness", "XY", angle_urad)] = told(&report, "named")[..] else {
        panic!("{:#?}", causes(&report));
    };
    holds(play_um, 4.0, 0.6);
    let [value, low, high] = angle_urad;
    // 20 µrad less than 90 degrees: see below.
    holds([value, low, high], -20.0, 6.0);
    assert!(
        said.contains("EC0Y above 0: X+ and Y+ enclose more than 90°"),
        "{said}"
    );
}

/// Sum of the mean deviations within 1.5 degrees of two angles, µm: of the diameter between them.
fn diameter_um(rows: &[[f64; 2]], ends_deg: [f64; 2]) -> f64 {
    let mean = |end_deg: f64| {
        let near = |deg: f64| ((deg - end_deg + 180.0).rem_euclid(360.0) - 180.0).abs() <= 1.5;
        let found: Vec<f64> = rows.iter().filter(|r| near(r[0])).map(|r| r[1]).collect();
        found.iter().sum::<f64>() / found.len() as f64
    };
    ends_deg.map(mean).iter().sum()
}

#[test]
fn a_ballbar_has_one_sign_of_squareness_in_report_and_diagnosis() {
    let text = std::fs::read_to_string(root().join("tests/import/ballbar.csv")).unwrap();
    let rows = text.lines().filter_map(|line| {
        let cells: Vec<f64> = line
            .split(',')
            .filter_map(|cell| cell.parse().ok())
            .collect();
        Some([*cells.get(1)?, *cells.get(2)?])
    });
    let rows: Vec<[f64; 2]> = rows.collect();
    assert_eq!(rows.len(), 6 * 361);
    // The diameter at 45° is the longer one, so X+ and Y+ enclose less than 90°. Over two diameters of 200 mm, half of
    // it each: both senses are in the mean, so that play is not.
    let longer_um = diameter_um(&rows, [45.0, 225.0]) - diameter_um(&rows, [135.0, 315.0]);
    let beyond_90_urad = -1e3 * longer_um / 200.0;
    assert!((beyond_90_urad + 20.0).abs() < 1.0, "{beyond_90_urad}");

    let home = TempDir::new().unwrap();
    let (csv, map) = ("tests/import/ballbar.csv", "tests/import/ballbar.yaml");
    let bag = imported(home.path(), csv, map, MACHINE);
    let page = home.path().join("page");
    let ended = run(&["report", &shown(&bag), "--out", &shown(&page)]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let text = std::fs::read_to_string(page.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    let mut parts = report["tests"].as_array().unwrap().iter();
    let causes = parts.find_map(|part| part.get("breakdown")).unwrap();
    let row = causes["rows"].as_array().unwrap().iter();
    let row = row.clone().find(|row| row["key"] == "squareness").unwrap();
    let of_report_urad = 1e6 * row["value"].as_f64().unwrap();
    let four_points_urad = 1e6 * causes["four_point_squareness_rad"].as_f64().unwrap();
    // Report and four points, E_C0Y by ISO 230-1; the diagnosis is compared above with the same number.
    assert!(
        (of_report_urad - beyond_90_urad).abs() < 1.0,
        "{of_report_urad}"
    );
    assert!(
        (four_points_urad - beyond_90_urad).abs() < 1.0,
        "{four_points_urad}"
    );
    let html = std::fs::read_to_string(page.join("report.html")).unwrap();
    for text in [&ended.said, &html] {
        assert!(text.contains("squareness XY (EC0Y)"), "{text}");
        assert!(
            text.contains("EC0Y above 0: X+ and Y+ enclose more than 90°"),
            "{text}"
        );
    }
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
    let [
        ("backlash", "X", play_um),
        ("scale_error", "X", scale_um_per_m),
    ] = told(&report, "set")[..]
    else {
        panic!("{:#?}", causes(&report));
    };
    holds(play_um, 5.0, 0.6);
    assert_eq!(instead(&report, "backlash"), ["feed_lost_motion"]);
    // One line cannot tell a scale of the axis, 1.1 um at the ends, from one of the laser.
    holds(scale_um_per_m, 4.0, 3.0);
    assert!(instead(&report, "scale_error").contains(&"length_wavelength"));
}

/// An angular error makes the same line where the axis has an Abbe offset: without a word on where the other axes stood it stays among
/// what the line can be.
#[test]
fn an_angular_error_is_among_what_a_slope_can_be_where_nobody_states_the_other_axes() {
    let home = TempDir::new().unwrap();
    let map = home.path().join("laser.yaml");
    let stated = std::fs::read_to_string(root().join("tests/import/positioning.yaml")).unwrap();
    let lines = stated.lines().filter(|line| !line.starts_with("at_mm"));
    std::fs::write(&map, lines.collect::<Vec<_>>().join("\n")).unwrap();
    let (report, said) = diagnosed("tests/import/positioning.csv", &shown(&map), MACHINE);
    assert!(
        instead(&report, "scale_error").contains(&"angular_error"),
        "{said}"
    );
}

/// Of three turns of the screw a curve of slower waves follows more than half: the wave is one of a set with it.
#[test]
fn a_wave_over_three_turns_is_one_of_a_set_with_a_curve() {
    let (report, said) = diagnosed("tests/import/steps.csv", "tests/import/steps.yaml", MACHINE);
    let found = told(&report, "set");
    let names: Vec<&str> = found.iter().map(|(effect, _, _)| *effect).collect();
    assert_eq!(names, ["backlash", "cyclic_error"], "{said}");
    assert_eq!(told(&report, "named"), []);
    assert_eq!(instead(&report, "cyclic_error"), ["pitch_error"]);
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

/// A simulator that has the machine's scale error and no play, and writes tables as a laser does.
#[test]
fn a_table_of_another_simulator_takes_the_place_of_the_prediction() {
    let home = TempDir::new().unwrap();
    let file = |name: &str| home.path().join(name);
    let mut noise = Pcg64Mcg::seed_from_u64(20_261_129);
    std::fs::write(file("laser.csv"), laser(&mut noise, 5)).unwrap();
    let mut table = String::from("run,target_mm,deviation_um\n");
    for run in 1..=5 {
        for k in (0..14).chain((0..14).rev()) {
            let at_mm = -280.0 + 560.0 * f64::from(k) / 13.0;
            writeln!(table, "{run},{at_mm:.3},{:.3}", 12e-3 * at_mm).unwrap();
        }
    }
    std::fs::write(file("simulator.csv"), table).unwrap();
    std::fs::write(
        file("map.yaml"),
        "start_s: 1767600000\nat_mm: {Y: 0.0, Z: 120.0}\ntest:\n  positioning: {axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, run: run, target_mm: target_mm, deviation_um: deviation_um}\n",
    )
    .unwrap();
    let (laser, simulator) = (shown(&file("laser.csv")), shown(&file("simulator.csv")));
    let (map, report) = (shown(&file("map.yaml")), shown(&file("gap.json")));
    let ended = run(&[
        "diagnose",
        &laser,
        "--simulated",
        &simulator,
        "--map",
        &map,
        "--machine",
        MACHINE,
        "--json",
        &report,
    ]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let report: Value = serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    assert_eq!(report["simulated"]["bags"][0]["path"], simulator.as_str());
    let [("backlash", "X", play_um)] = told(&report, "set")[..] else {
        panic!("{:#?}", causes(&report));
    };
    holds(play_um, 5.0, 0.6);
    assert_eq!(told(&report, "named"), []);
}

#[test]
fn a_log_that_was_made_once_and_one_of_three_mornings_are_diagnosed() {
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
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let last_third = "the held-out runs (5, 6)";
    assert!(ended.said.contains(last_third), "{}", ended.said);

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

#[test]
fn an_imported_laser_run_is_exported_by_its_means_up_and_down() {
    let home = TempDir::new().unwrap();
    let (csv, map) = (
        home.path().join("laser.csv"),
        home.path().join("laser.yaml"),
    );
    // Means over two runs, in um: up 2, 3, 4, 5, 6; down 5 less.
    let mut table = String::from("run,way,target,deviation\n");
    for (run, own_um) in [(1, -1.0), (2, 1.0)] {
        for k in 0..5 {
            let (at_mm, um) = (20 * k - 40, f64::from(k) + 2.0 + own_um);
            writeln!(table, "{run},+,{at_mm},{um}").unwrap();
        }
        for k in (0..5).rev() {
            let (at_mm, um) = (20 * k - 40, f64::from(k) - 3.0 + own_um);
            writeln!(table, "{run},-,{at_mm},{um}").unwrap();
        }
    }
    std::fs::write(&csv, table).unwrap();
    std::fs::write(
        &map,
        "start_s: 1767600000\nat_mm: {Y: 0.0, Z: 120.0}\ntest:\n  positioning: {axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, run: run, target_mm: target, deviation_um: deviation, direction: way}\n",
    )
    .unwrap();
    let bag = imported(home.path(), &shown(&csv), &shown(&map), MACHINE);
    let out = home.path().join("out");
    let ended = run(&[
        "export",
        &shown(&bag),
        "--format",
        "linuxcnc",
        "--out",
        &shown(&out),
    ]);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    assert!(
        ended.said.contains("means up and down of 2 runs"),
        "{}",
        ended.said
    );
    // Type 0: nominal, and where the slide is after going up and after going down.
    let text = std::fs::read_to_string(out.join("x.comp")).unwrap();
    let line = |line: &str| -> Option<Vec<f64>> {
        let numbers = line.split(' ').map(|cell| cell.parse().ok());
        numbers.collect::<Option<Vec<f64>>>()
    };
    let rows: Vec<Vec<f64>> = text.lines().map_while(line).collect();
    assert_eq!(rows.len(), 5, "{text}");
    for (k, row) in (0_u32..).zip(&rows) {
        let [at_mm, up_mm, down_mm] = row[..] else {
            panic!("{text}");
        };
        let from_first_mm = (up_mm - at_mm) - (rows[0][1] - rows[0][0]);
        assert!(
            (at_mm - (20.0 * f64::from(k) - 40.0)).abs() < 1e-9,
            "{text}"
        );
        assert!((from_first_mm - 1e-3 * f64::from(k)).abs() < 2e-6, "{text}");
        assert!((up_mm - down_mm - 5e-3).abs() < 2e-6, "{text}");
    }
}

/// A laser's run of 400 mm on an axis that is 2 K too warm and has no error of its own: 11 µm/(m K) · 2 K · 0.4 m = 8.8 µm.
fn warm_laser(home: &Path) -> PathBuf {
    let (csv, map) = (home.join("laser.csv"), home.join("laser.yaml"));
    let mut table = String::from("run,way,target,deviation\n");
    for run in [1, 2] {
        let up = (0..5).map(|k| ("+", k));
        for (way, k) in up.chain((0..5).rev().map(|k| ("-", k))) {
            let (at_mm, um) = (100 * k - 200, 2.2 * f64::from(k));
            writeln!(table, "{run},{way},{at_mm},{um}").unwrap();
        }
    }
    std::fs::write(&csv, table).unwrap();
    std::fs::write(
        &map,
        "start_s: 1767600000\nat_mm: {Y: 0.0, Z: 120.0}\ntest:\n  positioning: {axis: X, feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, run: run, target_mm: target, deviation_um: deviation, direction: way}\n",
    )
    .unwrap();
    imported(home, &shown(&csv), &shown(&map), MACHINE)
}

#[test]
fn an_imported_laser_run_at_22_degc_is_exported_at_20_degc_by_a_budget_by_hand() {
    let home = TempDir::new().unwrap();
    let bag = warm_laser(home.path());
    let budget = home.path().join("budget.yaml");
    std::fs::write(
        &budget,
        "length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}\nmachine: {temperature_deviation_k: 2.0, temperature_half_width_k: 0.2, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}\ndevice: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}\nmisalignment_mm: 0.1\nenvironmental_drift_um: 0.0\n",
    )
    .unwrap();
    let export = |more: &[&str], name: &str| {
        let out = home.path().join(name);
        let line = [
            "export",
            &shown(&bag),
            "--format",
            "linuxcnc",
            "--spacing-mm",
            "100",
        ];
        let folder = ["--out", &shown(&out)];
        let ended = run(&[&line[..], &folder[..], more].concat());
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        let read = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        (read("x.comp"), read("READ_ME_FIRST.txt"))
    };
    // Growth from the first point to the last one, going up, µm.
    let grown_um = |text: &str| {
        let error_mm = |row: usize| {
            let line = text.lines().nth(row).unwrap();
            let cells: Vec<f64> = line.split(' ').map(|cell| cell.parse().unwrap()).collect();
            cells[1] - cells[0]
        };
        (error_mm(4) - error_mm(0)) * 1e3
    };
    let (as_read, notes) = export(&[], "as_read");
    assert!((grown_um(&as_read) - 8.8).abs() < 3e-3, "{as_read}");
    let words = "1 K changes 400 mm, the farthest target from the first, by 4.40 um";
    assert!(as_read.contains(words) && notes.contains(words), "{notes}");
    let (at_20, notes) = export(&["--budget", &shown(&budget)], "at_20");
    assert!(grown_um(&at_20).abs() < 3e-3, "{at_20}");
    for words in [
        "machine 22.00 degC",
        "0.00 um at -200 mm, -8.80 um at 200 mm",
    ] {
        assert!(
            at_20.contains(words) && notes.contains(words),
            "{words}: {notes}"
        );
    }
}
