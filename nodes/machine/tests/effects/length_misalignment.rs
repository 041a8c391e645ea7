//! Cosine error against the projection itself.

use machine::twin::{Channel, History};
use metrology::Axis;

use crate::past::{instants, predict, read, stands};
use crate::scene::bench;

#[test]
fn val_length_misalignment_projected() {
    let machine = bench();
    let mut worst = 0.0_f64;
    for angle_rad in [0.5e-3_f64, 1e-3, 3e-3] {
        let mut run = stands(&instants(11, 1.0), |k| [-250.0 + 50.0 * k as f64, 0.0, 0.0]);
        read(&mut run, &Channel::Length(Axis::X));
        let given = [("cosine_um_per_m", 0.5e6 * angle_rad * angle_rad)];
        let on = ("length_misalignment", "X");
        let seen = predict(&machine, &History::default(), &run, on, &given);
        for (k, seen) in seen.iter().enumerate() {
            let way_mm = 50.0 * k as f64;
            worst = worst.max((seen - way_mm * (angle_rad.cos() - 1.0)).abs());
        }
    }
    println!("cosine: worst {worst:.2e} mm");
    assert!(worst < 1e-8, "{worst}");
}

#[test]
fn eq2_a_curved_motion_goes_with_the_square() {
    let machine = bench();
    let mut run = stands(&instants(2, 1.0), |k| [500.0 * k as f64 - 250.0, 0.0, 0.0]);
    read(&mut run, &Channel::Length(Axis::X));
    let given = [("cosine_um_per_m", 0.0), ("free_curve_um_per_m2", 4.0)];
    let on = ("length_misalignment", "X");
    let seen = predict(&machine, &History::default(), &run, on, &given);
    assert!((seen[1] - 1e-3).abs() < 1e-12, "{seen:?}");
}

#[test]
fn eq1_the_set_up_of_one_axis_is_not_anothers() {
    let machine = bench();
    let mut run = stands(&instants(2, 1.0), |k| [0.0, 500.0 * k as f64 - 250.0, 0.0]);
    read(&mut run, &Channel::Length(Axis::Y));
    let given = [("cosine_um_per_m", 4.0)];
    let of = |axis| {
        let on = ("length_misalignment", axis);
        predict(&machine, &History::default(), &run, on, &given)[1]
    };
    assert!(
        (of("Y") + 2e-3).abs() < 1e-12 && of("X").abs() < 1e-15,
        "{}",
        of("Y")
    );
}
