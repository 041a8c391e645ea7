//! Squareness against turned axes and the ellipse of a circular test.

use metrology::{Axis, AxisSet};
use nalgebra::{Rotation3, Vector3};

use crate::effects::scene::{circle, greatest, response_of, run, three_axes, tip_mm};

#[test]
fn val_axes_turned_by_rotation_matrices() {
    let machine = three_axes("[w b X Y Z t]");
    let (p, angle) = ([110.0, 70.0, 90.0], 40e-6);
    let run = run(5, AxisSet::XYZ, |_| [p[0], p[1], p[2], 0.0, 0.0, 0.0]);
    let turned = [
        ("XY", Vector3::z(), Vector3::y() * p[1]),
        ("XZ", Vector3::y(), Vector3::z() * p[2]),
        ("YZ", Vector3::x(), Vector3::z() * p[2]),
    ];
    for (on, about, stretch) in turned {
        let response = response_of(&machine, &run, "squareness", on, &[("angle_urad", 40.0)]);
        let turn = Rotation3::from_scaled_axis(about * angle);
        let wanted = turn * stretch - stretch;
        for k in 0..3 {
            let off = tip_mm(&response, 2)[k] - wanted[k];
            assert!(
                off.abs() < 1.1 * 90.0 * 0.5 * angle * angle,
                "{on} {k} {off}"
            );
        }
    }
}

/// An angle that differs by a from 90 degrees makes a circle an ellipse of a R / 2 at 45 degrees, the same
/// in both senses (ISO 230-4, reading of circular plots).
#[test]
fn val_a_circle_becomes_an_ellipse_at_45_degrees() {
    let machine = three_axes("[w X' Y' b Z t]");
    for turns in [1.0, -1.0] {
        let run = circle(150.0, 50.0, turns);
        let response = response_of(&machine, &run, "squareness", "XY", &[("angle_urad", 20.0)]);
        let off = (0..run.motion.len()).map(|k| {
            let [x, y] = [Axis::X, Axis::Y].map(|axis| run.motion.position[axis][k]);
            let tip = tip_mm(&response, k);
            let radial = (tip.x * x + tip.y * y) / 150.0;
            radial + 20e-6 * 150.0 / 2.0 * (2.0 * y.atan2(x)).sin()
        });
        assert!(greatest(off) < 1e-12);
    }
}
