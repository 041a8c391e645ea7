//! Drift against a sinusoidal day.

use std::f64::consts::TAU;

use metrology::Axis;
use twin::{Channel, History};

use crate::effects::past::{instants, predict, read, stands, warm};
use crate::effects::scene::bench;

const ID: (&str, &str) = ("ambient_drift", "Y");

#[test]
fn val_ambient_drift_etve_day() {
    let machine = bench();
    let at_s = instants(49, 300.0);
    let mut run = stands(&at_s, |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Y));
    // Taylor of 10 um sin(2 pi t / 24 h).
    let rate = TAU / 24.0;
    let given = [
        ("rate_um_per_h", 10.0 * rate),
        ("free_cube_um_per_h3", -10.0 * rate.powi(3) / 6.0),
    ];
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    let day_mm = |t: f64| 0.010 * (TAU * t / 86_400.0).sin();
    let worst = at_s
        .iter()
        .zip(&seen)
        .map(|(t, mm)| (mm - day_mm(*t)).abs())
        .fold(0.0, f64::max);
    println!("day: worst {worst:.2e} mm");
    // The next term of the series at four hours: 10 um (pi/3)^5 / 120.
    assert!((worst - 1.05e-4).abs() < 5e-6, "{worst}");
}

#[test]
fn eq2_air_that_warms_moves_the_tip_at_once() {
    let machine = bench();
    let mut run = stands(&[1815.0, 3615.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Y));
    let history = warm(30.0, 200, "air", &|t| 19.0 + t / 1800.0);
    let given = [("rate_um_per_h", 0.0), ("free_air_um_per_k", 4.0)];
    let seen = predict(&machine, &history, &run, ID, &given);
    assert!(
        (seen[0] - 0.004).abs() < 1e-9 && (seen[1] - 0.008).abs() < 1e-9,
        "{seen:?}"
    );
}

/// By hand: 1 - exp(-1/4), 1 - exp(-1) and 1 - exp(-4) of 10 µm.
#[test]
fn eq2_a_set_up_that_settles_in_four_minutes_by_hand() {
    let machine = bench();
    let mut run = stands(&[60.0, 240.0, 960.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Y));
    let given = [("rate_um_per_h", 0.0), ("free_in_4_min_um", 10.0)];
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    for (mm, right_um) in seen.iter().zip([2.212, 6.321, 9.817]) {
        assert!((1e3 * mm - right_um).abs() < 0.001, "{seen:?}");
    }
}
