//! Plant files that must be refused, and what is said about them.

use fake_cnc::{Plant, PlantFile};
use metrology::Axis;
use serde_json::Value;

use crate::plant::rig::{PLANT_YAML, machine, truth};

/// What is said when one piece of the first run's file is replaced.
fn told(from: &str, to: &str) -> String {
    assert!(PLANT_YAML.contains(from), "{from}");
    match PlantFile::from_yaml(&PLANT_YAML.replacen(from, to, 1)) {
        Err(error) => error.to_string(),
        Ok(truth) => Plant::new(&machine(), &truth).unwrap_err().to_string(),
    }
}

#[test]
fn an_unknown_key_is_refused_with_its_name_and_place() {
    let told = told("jitter_ms: 0.02", "jitter_ms: 0.02\n  wobble_ms: 1.0");
    assert!(
        told.starts_with("199:14: touch_probe.wobble_ms: unknown key"),
        "{told}"
    );
}

#[test]
fn a_wrong_unit_suffix_is_refused_with_both_names() {
    let told = told("latency_ms: 3.7", "latency_us: 3700.0");
    assert!(
        told.contains("latency_us") && told.contains("latency_ms"),
        "{told}"
    );
}

#[test]
fn a_missing_physical_value_is_refused_with_its_name() {
    let told = told("  latency_ms: 3.7\n", "");
    assert!(
        told.contains("latency_ms") && told.contains("missing"),
        "{told}"
    );
}

#[test]
fn a_missing_seed_is_refused() {
    let told = told("seed: 20240229\n", "");
    assert!(told.contains("seed"), "{told}");
}

#[test]
fn values_out_of_range_are_refused_with_path_value_and_limit() {
    let cases = [
        (
            "force_limit_n: 12000.0",
            "force_limit_n: -1.0",
            "linear_drives.X.force_limit_n = -1",
        ),
        (
            "backlash_um: 2.5",
            "backlash_um: .nan",
            "linear_drives.X.backlash_um = NaN",
        ),
        (
            "breakaway_n: 135.0",
            "breakaway_n: 1.0",
            "linear_drives.X.motor_friction.breakaway_n = 1",
        ),
        (
            "draught_time_s: 900.0",
            "draught_time_s: 0.0",
            "heat.shop_air.draught_time_s = 0",
        ),
        (
            "ends_mm: [-400.0, 400.0]",
            "ends_mm: [-300.0, 400.0]",
            "heat.screws.X.ends_mm[0] = -300",
        ),
        (
            "column_depth_mm: 620.0",
            "column_depth_mm: 0.0",
            "structure.column_depth_mm = 0",
        ),
        (
            "jitter_ms: 0.02",
            "jitter_ms: -0.02",
            "touch_probe.jitter_ms = -0.02",
        ),
        (
            "block_edge_mm: 40.0",
            "block_edge_mm: -40.0",
            "artefacts.block_edge_mm = -40",
        ),
        ("noise_k: 0.03", "noise_k: .inf", "sensors.noise_k = inf"),
        (
            "run_out_um: 2.0",
            "run_out_um: -2.0",
            "geometry.rotary.A.run_out_um = -2",
        ),
    ];
    for (from, to, expected) in cases {
        let told = told(from, to);
        assert!(
            told.starts_with(expected) && told.contains("must be"),
            "{told}"
        );
    }
}

#[test]
fn a_place_without_heat_capacity_is_named() {
    let told = told(
        "    posts: {heat_capacity_j_per_k: 9000.0, to_air_w_per_k: 1.2}\n",
        "",
    );
    assert_eq!(told, "heat.places: no entry for posts");
}

#[test]
fn the_two_files_must_have_the_same_axes() {
    let mut missing = truth();
    missing.linear_drives.remove(&Axis::Z);
    let told = Plant::new(&machine(), &missing).unwrap_err().to_string();
    assert!(told.contains("no entry for axis Z"), "{told}");
    let mut without_c = machine();
    without_c.axes.remove(&Axis::C);
    let told = Plant::new(&without_c, &truth()).unwrap_err().to_string();
    assert!(told.contains("rotary_drives.C"), "{told}");
}

#[test]
fn a_fault_of_an_unknown_block_is_refused() {
    let mut truth = truth();
    truth.faults.missing_blocks.push("block_9".to_owned());
    let told = Plant::new(&machine(), &truth).unwrap_err().to_string();
    assert_eq!(
        told,
        "faults.missing_blocks: \"block_9\" is not in the machine file"
    );
}

#[test]
fn a_drive_too_stiff_for_the_servo_period_is_refused() {
    let mut truth = truth();
    if let Some(drive) = truth.linear_drives.get_mut(&Axis::Y) {
        drive.screw_stiffness_n_per_um = [5000.0, 5000.0];
    }
    let told = Plant::new(&machine(), &truth).unwrap_err().to_string();
    assert!(
        told.starts_with("drive Y: natural frequency times inner step"),
        "{told}"
    );
}

#[test]
fn a_bad_chain_is_refused_with_column_and_word() {
    let mut machine = machine();
    machine.chain = "[w C' A' Y b X Z t]".to_owned();
    let told = Plant::new(&machine, &truth()).unwrap_err().to_string();
    assert!(told.contains("column 10: \"Y\""), "{told}");
}

#[test]
fn other_chains_with_the_same_axes_are_built_too() {
    for chain in [
        "[w C' A' X' Y' b Z t]",
        "[w Y' X' b Z C A t]",
        "[w b X Y Z A C t]",
    ] {
        let mut machine = machine();
        machine.chain = chain.to_owned();
        Plant::new(&machine, &truth()).unwrap();
    }
}

/// Every number of a value with its place in it: `/heat/shop_air/draught_k`.
fn numbers_of(value: &Value, place: &str, all: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                numbers_of(value, &format!("{place}/{key}"), all);
            }
        }
        Value::Array(list) => {
            for (at, value) in list.iter().enumerate() {
                numbers_of(value, &format!("{place}/{at}"), all);
            }
        }
        Value::Number(number) if number.is_f64() => all.push(place.to_owned()),
        _ => {}
    }
}

#[test]
fn every_physical_number_has_a_range_that_a_machine_can_have() {
    let whole = serde_json::to_value(truth()).unwrap();
    let mut places = vec![];
    numbers_of(&whole, "", &mut places);
    assert!(places.len() > 200, "{} numbers", places.len());
    for place in places {
        for wrong in [1e300, -1e300, 1e12, -1e12] {
            let mut changed = whole.clone();
            *changed.pointer_mut(&place).unwrap() = wrong.into();
            let changed: PlantFile = serde_json::from_value(changed).unwrap();
            let shown = match Plant::new(&machine(), &changed) {
                Ok(_) => panic!("{place} = {wrong} is taken"),
                Err(error) => error.to_string(),
            };
            let key = place.rsplit('/').find(|key| key.parse::<usize>().is_err());
            assert!(
                shown.contains(key.unwrap()) && shown.contains(": must be from "),
                "{place}: {shown}"
            );
        }
    }
}

#[test]
fn slips_of_the_pen_are_refused_by_key_value_unit_and_range() {
    for (from, to, words) in [
        (
            "start_temp_degc: 20.0",
            "start_temp_degc: -300.0",
            "heat.shop_air.start_temp_degc = -300 °C: must be from -60 to 100 °C",
        ),
        (
            "latency_ms: 3.7",
            "latency_ms: 1.0e12",
            "touch_probe.latency_ms = 1000000000000 ms: must be from 0 to 1000 ms",
        ),
        (
            "backlash_um: 2.5",
            "backlash_um: 1.0e9",
            "linear_drives.X.backlash_um = 1000000000 µm: must be from 0 to 10000 µm",
        ),
        (
            "heat_capacity_j_per_k: 5200.0",
            "heat_capacity_j_per_k: 1.0e-12",
            "heat.places.spindle_front.heat_capacity_j_per_k = 1e-12 J/K: must be from 0.01 to 10000000000 J/K",
        ),
    ] {
        let shown = told(from, to);
        assert!(shown.contains(words), "{words}: {shown}");
    }
}
