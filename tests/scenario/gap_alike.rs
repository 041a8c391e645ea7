//! Tables from which two effects cannot be told: `abbe diagnose` lists both.

use std::fmt::Write as _;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tempfile::TempDir;

use crate::gap_import::{MACHINE, causes, diagnosed, instead, shown};

/// Writes a table and its map, and diagnoses them.
fn of_text(table: &str, map: &str) -> (Value, String) {
    let home = TempDir::new().unwrap();
    let [csv, yaml] = ["table.csv", "map.yaml"].map(|name| home.path().join(name));
    std::fs::write(&csv, table).unwrap();
    std::fs::write(&yaml, map).unwrap();
    diagnosed(&shown(&csv), &shown(&yaml), MACHINE)
}

/// Noise of so many readings, µm.
fn noise_um(random: &mut Pcg64Mcg, sigma_um: f64) -> f64 {
    let drawn: f64 = StandardNormal.sample(random);
    sigma_um * drawn
}

/// A sheet of five runs with a row for each target, as ISO 230-2 reports print them.
fn sheet(seed: u64, um: impl Fn(u32, f64, bool) -> f64) -> (Value, String) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut text = "run,direction,target_mm,deviation_um\n".to_owned();
    for up in [true, false] {
        for target in 0..15 {
            for run in 1..=5 {
                let at_mm = -280.0 + 37.0 * f64::from(target) + 3.0 * f64::from(target % 3);
                let um = um(run, at_mm, up) + noise_um(&mut random, 0.2);
                let way = if up { "up" } else { "down" };
                let _ = writeln!(text, "{run},{way},{at_mm:.3},{um:.2}");
            }
        }
    }
    let map = "start_s: 1767600000\nat_mm: {Y: 0.0, Z: 120.0}\ntest:\n  positioning: {axis: X, feed_mm_min: 6000.0, dwell_s: 3.0, \
               overrun_mm: 5.0, target_mm: target_mm, deviation_um: deviation_um, direction: direction, run: run}\n";
    of_text(&text, map)
}

/// Runs that go up one after another are a drift in a sheet too, whose rows are not in the order of the measurement.
#[test]
fn a_sheet_sorted_by_target_shows_a_drift_from_run_to_run() {
    let (report, said) = sheet(41, |run, _, _| 4.0 * f64::from(run));
    let drift = causes(&report)
        .iter()
        .find(|cause| cause["effect"] == "ambient_drift");
    let drift = drift.unwrap_or_else(|| panic!("{said}"));
    assert_ne!(drift["status"], "surrogate", "{said}");
    assert!(said.contains("but a drift from run to run"), "{said}");
}

/// A sheet may be of a step cycle, in which an axis that drifts reads like a scale.
#[test]
fn a_scale_in_a_sheet_sorted_by_target_may_be_a_drift() {
    let (report, said) = sheet(42, |_, at_mm, _| 0.04 * at_mm);
    assert!(
        instead(&report, "scale_error").contains(&"ambient_drift"),
        "{said}"
    );
}

/// What stretches one axis of the sole plane of a ballbar reads like what shortens the other.
#[test]
fn a_scale_by_a_ballbar_in_one_plane_is_of_either_axis() {
    let mut random = Pcg64Mcg::seed_from_u64(43);
    let mut text = "run,angle_deg,radial_um\n".to_owned();
    for run in 1..=4 {
        for k in 0..=360 {
            let angle_deg = if run % 2 == 1 { k } else { 360 - k };
            let rad = f64::from(angle_deg).to_radians();
            let um = 3.0 * (2.0 * rad).cos() + noise_um(&mut random, 0.2);
            let _ = writeln!(text, "{run},{angle_deg},{um:.2}");
        }
    }
    let map = "start_s: 1767600000\ntest:\n  circle: {plane: XY, centre_mm: [0.0, 0.0, 120.0], radius_mm: 100.0, feed_mm_min: 1000.0, \
               run: run, angle_deg: angle_deg, radial_um: radial_um}\n";
    let (report, said) = of_text(&text, map);
    let scale = causes(&report)
        .iter()
        .find(|cause| cause["effect"] == "scale_error");
    let scale = scale.unwrap_or_else(|| panic!("{said}"));
    assert_eq!(scale["status"], "set", "{said}");
    let others = scale["confusable_with"].as_array().unwrap();
    let other = if scale["axis"] == "X" { "Y" } else { "X" };
    assert!(
        others.iter().any(|it| it["effect"] == "scale_error"
            && it["axis"] == other
            && it["excluded"] == false),
        "{said}"
    );
}
