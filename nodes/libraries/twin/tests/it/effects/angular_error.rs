//! Angular error against a table turned by a rotation matrix.

use metrology::{Axis, AxisSet};
use nalgebra::{Rotation3, Vector3};

use crate::effects::scene::{greatest, response_of, run, three_axes, tip_mm};

/// A table X on a table Y under a fixed spindle: roll, pitch and yaw of X turn the workpiece about the point
/// under the spindle's zero.
#[test]
fn val_a_table_turned_by_a_rotation_matrix() {
    let machine = three_axes("[w X' Y' b Z t]");
    let tool = Vector3::new(12.0, -7.0, -30.0);
    let mut run = run(6001, AxisSet::XYZ, |t| {
        [-300.0 + 100.0 * t, 40.0, 60.0, 0.0, 0.0, 0.0]
    });
    run.segment.tool_offset_mm = tool;
    for (on, about) in [
        ("AX", Vector3::x()),
        ("BX", Vector3::y()),
        ("CX", Vector3::z()),
    ] {
        let given = [("p1_urad", 30.0), ("p2_urad", -20.0)];
        let response = response_of(&machine, &run, "angular_error", on, &given);
        let off = (0..run.motion.len()).flat_map(|tick| {
            let u = run.motion.position[Axis::X][tick];
            let x = u / 320.0;
            let angle = (30.0 * x - 20.0 * (1.5 * x * x - 0.5)) * 1e-6;
            // The tip over the table, seen from the table that X carries away by -u.
            let tip = tool + Vector3::new(u, 40.0, 60.0);
            let wanted = Rotation3::from_scaled_axis(about * angle) * tip - tip;
            let found = tip_mm(&response, tick);
            (found - wanted).as_slice().to_vec()
        });
        let off_um = greatest(off) * 1e3;
        println!("{on} off by {off_um:.1e} um");
        assert!(off_um < 1e-3, "{on} {off_um}");
    }
}

/// The Abbe principle: 10 urad over a height of 250 mm are 2.5 um, over none nothing.
#[test]
fn val_the_abbe_offset_makes_the_error() {
    let machine = three_axes("[w b X Y Z t]");
    for (height_mm, wanted_mm) in [(250.0, 0.0025), (0.0, 0.0)] {
        let run = run(5, AxisSet::XYZ, |_| [320.0, 0.0, height_mm, 0.0, 0.0, 0.0]);
        let given = [("p1_urad", 10.0), ("p2_urad", 0.0)];
        let response = response_of(&machine, &run, "angular_error", "BX", &given);
        assert!((tip_mm(&response, 2).x - wanted_mm).abs() < 1e-12);
    }
}
