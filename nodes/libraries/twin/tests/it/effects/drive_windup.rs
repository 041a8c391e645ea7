//! Wind-up of a drive against a mass on a spring.

use machine::file::{AxisEntry, GuideFrictionEntry};
use metrology::{Axis, AxisSet};

use crate::effects::scene::{TICK_S, greatest, integrate, response_of, run, three_axes};

#[test]
fn val_a_mass_on_a_spring() {
    let machine = three_axes("[w X' Y' b Z t]");
    let (radius_mm, rate, natural) = (20.0, 10.0, 150.0_f64);
    let run = run(2000, AxisSet::XYZ, |t| {
        [radius_mm * (rate * t).cos(), 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let ratio = (rate / natural).powi(2);
    let spring = |t: f64, y: &[f64; 2]| {
        [
            y[1],
            natural * natural * (radius_mm * (rate * t).cos() - y[0]),
        ]
    };
    let slide = integrate(
        [radius_mm / (1.0 - ratio), 0.0],
        TICK_S / 10.0,
        19_990,
        10,
        spring,
    );
    let given = [("windup_um", 1000.0 / (natural * natural) * 1e3)];
    let response = response_of(&machine, &run, "drive_windup", "X", &given);
    let off = (2..1998)
        .map(|k| slide[k][0] - run.motion.position[Axis::X][k] - response.drive[Axis::X][k]);
    let most_um = greatest(response.drive[Axis::X].iter().copied()) * 1e3;
    let off_um = greatest(off) * 1e3;
    println!("wind-up {most_um:.2} um, off by {off_um:.3} um");
    assert!(off_um < 1.2 * ratio * most_um, "{off_um}");
}

/// A slide that a spring drags at constant speed through friction lags by friction over stiffness: Hooke.
#[test]
fn val_a_spring_that_drags_its_mass_through_friction() {
    let mut machine = three_axes("[w X' Y' b Z t]");
    let natural = 120.0_f64;
    let (coulomb_mm_s2, viscous_per_s, speed_mm_s) = (60.0, 0.4, 50.0);
    let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) else {
        panic!("X is linear")
    };
    entry.guide_friction = Some(GuideFrictionEntry {
        coulomb_mm_s2,
        viscous_per_s,
    });
    let run = run(1000, AxisSet::XYZ, |t| {
        [speed_mm_s * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let drag = |t: f64, y: &[f64; 2]| {
        let force = natural * natural * (speed_mm_s * t - y[0]) - 40.0 * (y[1] - speed_mm_s);
        [
            y[1],
            force - coulomb_mm_s2 * y[1].signum() - viscous_per_s * y[1],
        ]
    };
    let slide = integrate([0.0, speed_mm_s], TICK_S / 10.0, 9990, 10, drag);
    let given = [("windup_um", 1e6 / (natural * natural))];
    let response = response_of(&machine, &run, "drive_windup", "X", &given);
    let lag_mm = slide[990][0] - run.motion.position[Axis::X][990];
    let off_um = (response.drive[Axis::X][990] - lag_mm) * 1e3;
    println!("lag {:.3} um, off by {off_um:.5} um", lag_mm * 1e3);
    assert!(off_um.abs() < 1e-3, "{off_um}");
}

#[test]
fn eq1_a_screw_is_softer_at_its_free_end() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(101, AxisSet::XYZ, |t| {
        [160.0 + 500.0 * (t - 0.05).powi(2), 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let given = [("windup_um", 2.0), ("free_by_place_um", 1.0)];
    let response = response_of(&machine, &run, "drive_windup", "X", &given);
    // 1000 mm/s2 at half of the half travel.
    assert!((response.drive[Axis::X][50] + 2.5e-3).abs() < 1e-6);
}
