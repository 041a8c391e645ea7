//! Workpiece expansion against a block of aluminium by hand.

use nalgebra::Vector3;

use crate::effects::past::{integrate, predict, touch, touching, warm};
use crate::effects::scene::bench;

const ID: (&str, &str) = ("workpiece_expansion", "");

/// The worked example of the National Physical Laboratory: a steel rod (11.7e-6 / K) that is measured at 23.7 degC to be
/// 500.035 mm long has 500.013 mm at 20 degC. It is measured along a scale that does not grow.
#[test]
fn val_workpiece_expansion_npl_steel_rod() {
    let run = touching(vec![
        touch(100.0, [-250.0, 0.0, 0.0], Vector3::x(), 2.0),
        touch(200.0, [250.0, 0.0, 0.0], -Vector3::x(), 2.0),
    ]);
    let history = warm(10.0, 60, "air", &|_| 23.7);
    let given = [("difference_um_per_m_k", 11.7), ("lag_min", 20.0)];
    let travel = predict(&bench(), &history, &run, ID, &given);
    let at_20_degc_mm = 500.035 + travel[0] + travel[1];
    println!("rod: {at_20_degc_mm:.6} mm");
    assert!((at_20_degc_mm - 500.013).abs() < 5e-4, "{at_20_degc_mm}");
}

#[test]
fn eq2_workpiece_expansion_of_aluminium() {
    let machine = bench();
    // 300 mm of aluminium (23.1e-6 / K) against steel scales (11.5e-6 / K), 5 K too warm: 17.4 um too long.
    let run = touching(vec![
        touch(100.0, [-150.0, 0.0, 0.0], Vector3::x(), 2.0),
        touch(200.0, [150.0, 0.0, 0.0], -Vector3::x(), 2.0),
    ]);
    let history = warm(10.0, 60, "air", &|_| 25.0);
    let given = [("difference_um_per_m_k", 23.1 - 11.5), ("lag_min", 20.0)];
    let travel = predict(&machine, &history, &run, ID, &given);
    let length_mm = (150.0 - travel[1]) - (-150.0 + travel[0]);
    println!("block: {length_mm}");
    assert!((length_mm - 300.0174).abs() < 1e-9, "{length_mm}");
}

#[test]
fn eq1_the_workpiece_follows_the_air_late() {
    let machine = bench();
    let air = |t: f64| 22.0 + 3.0 * (t / 4000.0).sin();
    let history = warm(20.0, 500, "air", &air);
    let run = touching(vec![touch(9000.0, [0.0, 0.0, 200.0], -Vector3::z(), 2.0)]);
    let given = [
        ("difference_um_per_m_k", 10.0),
        ("lag_min", 45.0),
        ("free_z_um_per_m_k", 2.0),
    ];
    let seen = predict(&machine, &history, &run, ID, &given)[0];
    let start = air(10.0);
    let [temperature] = integrate(|t, [y]| [(air(t) - y) / 2700.0], [start], 9000.0, 9000);
    let wanted = -12e-6 * (temperature - 20.0) * 200.0;
    assert!((seen - wanted).abs() < 1e-6, "{seen} {wanted}");
}
