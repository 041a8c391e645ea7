//! Interpolation error against the arctangent of a pair of signals that are not quite right.

use std::f64::consts::{PI, TAU};

use metrology::{Axis, AxisSet};

use crate::scene::{greatest, response_of, run, three_axes};

#[test]
fn val_the_arctangent_of_two_unequal_signals() {
    let machine = three_axes("[w X' Y' b Z t]");
    let period_mm = 0.02;
    let (offset, unequal) = (0.02, 0.03);
    let run = run(3000, AxisSet::XYZ, |t| [0.02 * t, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let per_rad_um = period_mm * 1e3 / TAU;
    let given = [
        ("sin_um", offset * per_rad_um),
        ("cos_um", 0.0),
        ("period_um", 20.0),
        ("free_sin2_um", 0.5 * unequal * per_rad_um),
    ];
    let response = response_of(&machine, &run, "interpolation_error", "X", &given);
    let off = run.motion.position[Axis::X]
        .iter()
        .zip(&response.drive[Axis::X]);
    let off_um = greatest(off.map(|(u, error)| {
        let phase = TAU * u / period_mm;
        let (sin, cos) = phase.sin_cos();
        let read = sin.atan2((1.0 + unequal) * cos + offset);
        let ahead = (read - phase + PI).rem_euclid(TAU) - PI;
        // The loop holds the reading at the command, so that the slide is off the other way.
        -ahead * per_rad_um - error * 1e3
    }));
    let most_um = greatest(response.drive[Axis::X].iter().copied()) * 1e3;
    println!("interpolation {most_um:.4} um, off by {off_um:.4} um");
    assert!(off_um < 0.05 * most_um, "{off_um} {most_um}");
}
