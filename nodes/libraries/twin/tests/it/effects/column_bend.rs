//! Column bend against the curvature of a strip that is warmer on one side.

use metrology::Axis;
use nalgebra::{Rotation3, Vector3};
use twin::{Channel, History};

use crate::effects::past::{integrate, predict, read, stands, warm};
use crate::effects::scene::{bench, three_axes};

const ID: (&str, &str) = ("column_bend", "");

/// A column of cast iron, 1.4 m high and 0.5 m deep, with one side 1 K warmer: shift and tilt of its top.
fn strip_per_k() -> (f64, f64) {
    let (height_mm, depth_mm) = (1400.0, 500.0);
    let curvature_per_mm = 10.5e-6 / depth_mm;
    (
        0.5 * curvature_per_mm * height_mm * height_mm,
        curvature_per_mm * height_mm,
    )
}

#[test]
fn val_column_bend_timoshenko_strip() {
    let machine = bench();
    let (shift_mm, tilt_rad) = strip_per_k();
    let history = warm(60.0, 600, "column", &|t| {
        if t > 0.0 {
            20.0 + 2.0 * (1.0 - (-t / 600.0).exp())
        } else {
            20.0
        }
    });
    let first_k = 2.0 * (1.0 - (-30.0_f64 / 600.0).exp());
    let position = [120.0, -40.0, 260.0];
    let mut run = stands(&[35_000.0], |_| position);
    run.segment.tool_offset_mm = Vector3::new(10.0, 25.0, -80.0);
    read(&mut run, &Channel::Length(Axis::Y));
    read(&mut run, &Channel::Length(Axis::Z));
    let given = [
        ("y_um_per_k", shift_mm * 1e3),
        ("z_um_per_k", 0.0),
        ("tilt_x_urad_per_k", tilt_rad * 1e6),
        ("lag_min", 10.0),
    ];
    let seen = predict(&machine, &history, &run, ID, &given);
    // The head is turned as a rigid body; the Y axis of this machine carries the table, not the head.
    let warming_k = 2.0 - first_k;
    let arm_mm = Vector3::new(120.0 + 10.0, 25.0, 260.0 - 80.0);
    let turned = Rotation3::from_axis_angle(&Vector3::x_axis(), tilt_rad * warming_k);
    let moved = turned * arm_mm - arm_mm + Vector3::y() * shift_mm * warming_k;
    println!(
        "strip: y {} for {}, z {} for {}",
        seen[0], moved.y, seen[1], moved.z
    );
    assert!((seen[0] - moved.y).abs() < 1e-6, "{seen:?} {moved:?}");
    assert!((seen[1] - moved.z).abs() < 1e-6, "{seen:?} {moved:?}");
}

#[test]
fn eq1_lags_as_an_integration_does() {
    let machine = bench();
    let air = |t: f64| 3.0 * (t / 7000.0).sin();
    let mut history = warm(30.0, 500, "air", &|t| 20.0 + air(t));
    let column: Vec<f64> = (0..500).map(|k| 21.0 + 0.0 * f64::from(k)).collect();
    history
        .temperature_degc
        .insert(String::from("column"), column);
    let mut run = stands(&[12_000.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    let given = [
        ("y_um_per_k", 0.0),
        ("z_um_per_k", 10.0),
        ("tilt_x_urad_per_k", 0.0),
        ("lag_min", 60.0),
    ];
    let seen = predict(&machine, &history, &run, ID, &given)[0];
    let zero = air(15.0);
    let [bend] = integrate(
        |t, [y]| [(zero - air(t) - y) / 3600.0],
        [0.0],
        12_000.0,
        4000,
    );
    assert!((seen - 0.010 * bend).abs() < 2e-6, "{seen} {bend}");
}

#[test]
fn a_head_that_carries_every_axis_has_the_whole_arm() {
    let given = [
        ("y_um_per_k", 0.0),
        ("z_um_per_k", 0.0),
        ("tilt_x_urad_per_k", 10.0),
        ("lag_min", 1.0),
    ];
    let history = warm(60.0, 200, "column", &|t| {
        if t < 100.0 { 20.0 } else { 21.0 }
    });
    let seen = |chain: &str| {
        let mut run = stands(&[11_000.0], |_| [0.0, 200.0, 0.0]);
        read(&mut run, &Channel::Length(Axis::Z));
        predict(&three_axes(chain), &history, &run, ID, &given)[0]
    };
    assert!((seen("[w b X Y Z t]") - 0.002).abs() < 1e-9);
    assert!(seen("[w Y' X' b Z t]").abs() < 1e-12);
}

#[test]
fn without_thermometers_nothing_is_known() {
    let machine = bench();
    let mut run = stands(&[12_000.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    let given = [
        ("y_um_per_k", 5.0),
        ("z_um_per_k", 5.0),
        ("tilt_x_urad_per_k", 5.0),
        ("lag_min", 10.0),
    ];
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    assert_eq!(seen, [0.0]);
}
