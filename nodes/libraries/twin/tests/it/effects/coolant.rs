//! The step of the coolant against the heat balance of a wall.

use metrology::Axis;
use twin::{Channel, History};

use crate::effects::past::{integrate, predict, read, stands};
use crate::effects::scene::bench;

#[test]
fn val_coolant_wall() {
    let machine = bench();
    // A wall of 20 mm cast iron, coolant 4 K colder than the shop on one side, air on the other.
    let (capacity, coolant_w, air_w) = (7200.0 * 500.0 * 0.02, 300.0, 10.0);
    let wall = |_: f64, [k]: [f64; 1]| [(coolant_w * (-4.0 - k) - air_w * k) / capacity];
    let mm_per_k = 10.5e-6 * 300.0;
    let lag_s = capacity / (coolant_w + air_w);
    let end_k = -4.0 * coolant_w / (coolant_w + air_w);
    let given = [
        ("step_um", end_k * mm_per_k * 1e3),
        ("at_min", 10.0),
        ("lag_min", lag_s / 60.0),
    ];
    let at_s = [300.0, 600.0, 660.0, 900.0, 2400.0];
    let mut run = stands(&at_s, |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    let seen = predict(
        &machine,
        &History::default(),
        &run,
        ("coolant", "Z"),
        &given,
    );
    let mut worst = 0.0_f64;
    for (t, seen) in at_s.iter().zip(&seen) {
        let flowing_s = f64::max(t - 600.0, 0.0);
        let [wall_k] = integrate(wall, [0.0], flowing_s, 2000);
        worst = worst.max((seen - wall_k * mm_per_k).abs());
    }
    println!("wall: worst {worst:.2e} mm of {}", seen[4]);
    assert!(worst < 1e-12 && seen[4] < -0.012, "{worst} {seen:?}");
}

#[test]
fn eq2_growth_is_zero_in_the_middle_of_the_travel() {
    let machine = bench();
    let given = [
        ("step_um", 0.0),
        ("at_min", 0.0),
        ("lag_min", 1.0),
        ("free_growth_um_per_m", 20.0),
    ];
    let mut run = stands(&[3600.0, 3601.0], |k| [0.0, 0.0, [190.0, 440.0][k]]);
    read(&mut run, &Channel::Length(Axis::Z));
    let seen = predict(
        &machine,
        &History::default(),
        &run,
        ("coolant", "Z"),
        &given,
    );
    assert!(
        seen[0].abs() < 1e-15 && (seen[1] - 0.005).abs() < 1e-9,
        "{seen:?}"
    );
}
