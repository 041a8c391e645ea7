//! Wind-up of a screw under friction against Hooke's law.

use std::f64::consts::PI;

use metrology::{Axis, AxisSet};

use crate::effects::scene::{response_of, run, three_axes};

/// A screw of 32 mm, steel of 206 GPa, drags its slide against 500 N: it is longer or shorter by F d / (E A).
#[test]
fn val_hooke_s_law_of_a_screw() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(4001, AxisSet::XYZ, |t| {
        let up = if t < 2.0 { t } else { 4.0 - t };
        [-300.0 + 300.0 * up, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let strain = 500.0 / (206_000.0 * PI * 16.0 * 16.0);
    let given = [
        ("windup_um_per_m", strain * 1e6),
        ("presliding_mm", 0.05),
        ("bearing_half_travels", -1.0),
    ];
    let response = response_of(&machine, &run, "friction_windup", "X", &given);
    for place in [200, 700, 1500_usize] {
        let from_fixed_mm = run.motion.position[Axis::X][place] + 320.0;
        let (up, down) = (
            response.drive[Axis::X][place],
            response.drive[Axis::X][4000 - place],
        );
        let reversal_mm = down - up;
        let wanted_mm = 2.0 * strain * from_fixed_mm;
        println!(
            "at {from_fixed_mm} mm: {:.4} um, Hooke {:.4} um",
            reversal_mm * 1e3,
            wanted_mm * 1e3
        );
        assert!((reversal_mm - wanted_mm).abs() < 1e-9);
    }
}
