//! Ringing against the mode integrated finely through a smooth move.

use std::f64::consts::TAU;

use metrology::AxisSet;

use crate::effects::scene::{TICK_S, greatest, integrate, response_of, run, three_axes};

/// A move of 40 mm within 0.16 s whose acceleration is a sine, then rest.
fn pose(t: f64) -> (f64, f64) {
    let share = ((t - 0.1) / 0.16).clamp(0.0, 1.0);
    let inside = share > 0.0 && share < 1.0;
    let place = 40.0 * (share - (TAU * share).sin() / TAU);
    let acceleration = 40.0 * TAU / (0.16 * 0.16) * (TAU * share).sin();
    (place, if inside { acceleration } else { 0.0 })
}

#[test]
fn val_the_mode_integrated_finely() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(1000, AxisSet::XYZ, |t| [pose(t).0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for (frequency_hz, damping) in [(12.0, 0.03), (30.0, 0.05)] {
        let rate = TAU * frequency_hz;
        let mode = |t: f64, y: &[f64; 2]| {
            [
                y[1],
                -0.4 * pose(t).1 - 2.0 * damping * rate * y[1] - rate * rate * y[0],
            ]
        };
        let wanted = integrate([0.0, 0.0], TICK_S / 10.0, 9990, 10, mode);
        let given = [
            ("share", 0.4),
            ("frequency_hz", frequency_hz),
            ("damping", damping),
        ];
        let response = response_of(&machine, &run, "structural_ringing", "X", &given);
        let off = (0..1000).map(|k| response.tip_mm[0][k] - wanted[k][0]);
        let after = greatest((270..1000).map(|k| wanted[k][0])) * 1e3;
        let most = greatest(wanted.iter().map(|y| y[0])) * 1e3;
        let off_um = greatest(off) * 1e3;
        println!(
            "{frequency_hz} Hz: {most:.1} um, after the stop {after:.1} um, off by {off_um:.3} um"
        );
        assert!(off_um < 0.01 * most, "{off_um}");
        assert!(after > 10.0 * off_um);
    }
}
