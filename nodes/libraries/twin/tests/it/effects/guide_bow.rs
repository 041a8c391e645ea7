//! Bow of a guide against the rigid motion of a slide along an arc.

use metrology::{Axis, AxisSet};
use nalgebra::{Rotation3, Vector3};

use crate::effects::scene::{greatest, response_of, run, three_axes, tip_mm};

#[test]
fn val_a_slide_on_an_arc() {
    let machine = three_axes("[w b X Y Z t]");
    let tool = Vector3::new(10.0, 25.0, -80.0);
    let mut run = run(6001, AxisSet::XYZ, |t| {
        [-300.0 + 100.0 * t, 50.0, 200.0, 0.0, 0.0, 0.0]
    });
    run.segment.tool_offset_mm = tool;
    let arm = tool + Vector3::new(0.0, 50.0, 200.0);
    let radius_mm = 320.0 * 320.0 / (2.0 * 0.008);
    // Upward, and to the left.
    for (on, across, about) in [
        ("ZX", Vector3::z(), -Vector3::y()),
        ("YX", Vector3::y(), Vector3::z()),
    ] {
        let response = response_of(&machine, &run, "guide_bow", on, &[("sagitta_um", 8.0)]);
        let off = (0..run.motion.len()).flat_map(|tick| {
            let q = run.motion.position[Axis::X][tick];
            let angle: f64 = q / radius_mm;
            let slide = Vector3::x() * (radius_mm * angle.sin())
                + across * (2.0 * radius_mm * (0.5 * angle).sin().powi(2));
            let turned = Rotation3::from_scaled_axis(about * angle) * arm;
            let wanted = slide + turned - (Vector3::x() * q + arm);
            (tip_mm(&response, tick) - wanted).as_slice().to_vec()
        });
        let off_um = greatest(off) * 1e3;
        println!("{on} off by {off_um:.1e} um of 8");
        assert!(off_um < 1e-3, "{on} {off_um}");
    }
}
