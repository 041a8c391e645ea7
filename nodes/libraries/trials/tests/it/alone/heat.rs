//! Effects of heat: a spindle that runs, a column that a cabinet warms, a bed that the hydraulics warm; and a thermometer.

use fake_cnc::plant::Place;
use gap_diagnosis::report::Cause;
use machine::file::{SensorEntry, SensorPlace};
use trials::Rig;

use crate::alone::judge::{is_named, told};
use crate::alone::rigs::{in_both_files, repeating, with_circles};

/// A machine with thermometers on spindle and column.
fn watched(steps: &[&str], times: usize) -> Rig {
    let mut rig = repeating(steps, times);
    in_both_files(&mut rig, |file| {
        let like = file.temperature_sensors[0].clone();
        let places = [
            ("spindle_front", SensorPlace::SpindleFront),
            ("column", SensorPlace::Column),
        ];
        for (id, place) in places {
            let id = id.to_owned();
            file.temperature_sensors.push(SensorEntry {
                id,
                place,
                ..like.clone()
            });
        }
    });
    rig
}

/// Bearings and motor warm shaft, head and column; the blocks are touched every three minutes.
#[test]
fn a_spindle_that_warms_grows() {
    let mut rig = watched(&["blocks", "run, program: warm"], 14);
    let three_minutes = "S10000 M3\nG4 P180\nM5\nM2\n";
    rig.programs
        .insert("warm".to_owned(), three_minutes.to_owned());
    is_named(&told(&[&rig]), "spindle_growth", "");
}

const EVERY_FIVE_MINUTES: [&str; 2] = ["blocks", "wait, seconds: 300"];

/// A cabinet in front of the column.
#[test]
fn a_column_that_is_warm_in_front_bends() {
    let mut rig = watched(&EVERY_FIVE_MINUTES, 20);
    let standing_w = &mut rig.plant.heat.standing_heat_w;
    standing_w.insert(Place::ColumnFront, 600.0);
    is_named(&told(&[&rig]), "column_bend", "");
}

/// Hydraulics that warm bed and base alike push the column away from the table. No thermometer tells how far, but that of the bed
/// warms as the tip drifts: a shift with it, or a drift that it explains better.
#[test]
fn a_bed_that_grows_is_a_drift_along_it() {
    let mut rig = watched(&EVERY_FIVE_MINUTES, 20);
    let standing_w = &mut rig.plant.heat.standing_heat_w;
    standing_w.insert(Place::Bed, 700.0);
    standing_w.insert(Place::BedBase, 900.0);
    let report = told(&[&rig]);
    let is_along_y = |cause: &&Cause| match &*cause.effect {
        "ambient_drift" => cause.axis == "Y",
        "thermal_shift" => cause.parameters.iter().any(|own| own.name == "y_um_per_k"),
        _ => false,
    };
    let own = report.causes.iter().find(is_along_y);
    let own = own.unwrap_or_else(|| panic!("a drift along Y: {:?}", report.causes));
    println!("{} {} {:?}", own.effect, own.axis, own.confusable_with);
    // Of several thermometers that warm alike the shift is one of a set.
    let failed: Vec<String> = { own.why.iter() }
        .filter(|check| check.has_failed())
        .map(|check| format!("{:?}", check.check))
        .collect();
    let may_fail = ["BeatsHeat", "NoRival"];
    assert!(
        failed.iter().all(|own| may_fail.contains(&&**own)),
        "{failed:?}"
    );
    assert!(own.d > 10.0, "D {}", own.d);
}

/// Two thermometers in the shop's air, from a box of sensors that differ by kelvins.
#[test]
fn two_thermometers_that_differ_are_an_offset_of_the_second() {
    let mut rig = with_circles();
    in_both_files(&mut rig, |file| {
        let mut sensors = file.temperature_sensors.iter_mut();
        let ambient = sensors.find(|s| s.place == SensorPlace::Ambient).unwrap();
        ambient.period_s = 2.0;
        let second = SensorEntry {
            id: "ambient_2".to_owned(),
            ..ambient.clone()
        };
        file.temperature_sensors.push(second);
    });
    rig.plant.sensors.offset_k = 1.5;
    is_named(&told(&[&rig]), "thermometer_offset", "ambient_2");
}
