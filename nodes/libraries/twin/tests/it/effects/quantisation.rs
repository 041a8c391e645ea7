//! Quantisation against a ramp that is rounded.

use metrology::Axis;
use twin::Channel;

use crate::effects::past::{instants, read, scatter, stands};
use crate::effects::scene::bench;

#[test]
fn val_quantisation_ramp() {
    let step_mm = 0.5e-3;
    let n = 1_000_000;
    let rounding = |k: u32| {
        let at_mm = 1000.0 * step_mm * f64::from(k) / f64::from(n) + 1.7e-5;
        (at_mm / step_mm).round() * step_mm - at_mm
    };
    let drawn = (0..n).map(|k| rounding(k).powi(2)).sum::<f64>() / f64::from(n);
    let mut run = stands(&instants(3, 1.0), |_| [0.0; 3]);
    read(&mut run, &Channel::GridU);
    read(&mut run, &Channel::Length(Axis::X));
    let given = [("step_um", 0.5)];
    let seen = scatter(&bench(), &run, ("quantisation", "grid"), &given);
    println!("ramp: {:.3} % off", 100.0 * (seen[0] / drawn - 1.0));
    assert!((seen[0] / drawn - 1.0).abs() < 1e-3, "{} {drawn}", seen[0]);
    assert!(
        seen[3..].iter().all(|v| *v == 0.0),
        "another instrument is as it was"
    );
}

#[test]
fn angles_are_not_rounded_in_micrometres() {
    let mut run = stands(&instants(2, 1.0), |_| [0.0; 3]);
    read(&mut run, &Channel::Motor(Axis::C));
    read(&mut run, &Channel::Motor(Axis::X));
    let seen = scatter(
        &bench(),
        &run,
        ("quantisation", "motor"),
        &[("step_um", 1.0)],
    );
    assert!(
        seen[..2].iter().all(|v| *v == 0.0) && seen[2] > 0.0,
        "{seen:?}"
    );
}
