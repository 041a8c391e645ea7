//! Five axes: a block's faces, level and with the table tilted.

use metrology::Axis;
use nalgebra::Vector3;
use test_namespaces::isolated;

use crate::linuxcnc::rig::Rig;

/// Three faces of block_1 in workpiece coordinates, level and at A = -30 deg.
fn program() -> String {
    let mut text = "G21 G90\nG0 Z60\n".to_owned();
    for (name, angle_deg) in [("block_1", 0), ("block_1_tilted", -30)] {
        text.push_str(&format!(
            "G0 Z80\nG0 A{angle_deg}\nG0 X-180 Y-140 Z40\nG1 Z26 F1200\n\
             (feature: {name}/z)\nG38.2 Z20 F120\nG0 Z40\n\
             G0 X-240 Y-140\nG1 Z0 F3000\nG1 X-226 F1200\n\
             (feature: {name}/x)\nG38.2 X-218 F120\nG0 X-240\nG0 Z60\n\
             G0 X-180 Y-200\nG1 Z0 F3000\nG1 Y-186 F1200\n\
             (feature: {name}/y)\nG38.2 Y-178 F120\nG0 Y-200\nG0 Z80\n"
        ));
    }
    text.push_str("G0 A0\nM2\n");
    text
}

/// Point of the workpiece from slide positions, the A axis running through y = 0, z = 50 mm.
fn workpiece_from_machine(position_mm: Vector3<f64>, a_rad: f64) -> Vector3<f64> {
    let pivot_mm = Vector3::new(0.0, 0.0, 50.0);
    let tilt = nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), -a_rad);
    tilt * (position_mm - pivot_mm) + pivot_mm
}

#[test]
fn a_block_is_found_at_its_place_level_and_tilted() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_block_cycle") else {
            return;
        };
        rig.touch(&program());
        assert_eq!(rig.triggers.len(), 6);
        // 2 mm/s and at most 6 ms from contact to latch.
        let tolerance_mm = 0.012;
        for trigger in &rig.triggers {
            let point_mm = workpiece_from_machine(trigger.latched.xyz(), trigger.latched[Axis::A]);
            let approach = workpiece_from_machine(trigger.approach, trigger.latched[Axis::A])
                - workpiece_from_machine(Vector3::zeros(), trigger.latched[Axis::A]);
            let (axis, contact_mm, sign) = match &trigger.feature_id[trigger.feature_id.len() - 1..]
            {
                "x" => (0, -223.0, 1.0),
                "y" => (1, -183.0, 1.0),
                _ => (2, 23.0, -1.0),
            };
            println!(
                "{}: {:.4} mm, A {:.3} deg, feed {:.4} mm/s",
                trigger.feature_id,
                point_mm[axis],
                trigger.latched[Axis::A].to_degrees(),
                trigger.feed_mm_s
            );
            let depth_mm = (point_mm[axis] - contact_mm) * sign;
            assert!((0.0..tolerance_mm).contains(&depth_mm), "{trigger:?}");
            assert!((approach[axis] * sign - 1.0).abs() < 1e-6, "{approach}");
            assert!((trigger.feed_mm_s - 2.0).abs() < 0.01, "{trigger:?}");
        }
        let tilted = rig
            .triggers
            .iter()
            .filter(|t| t.feature_id.contains("tilted"))
            .count();
        assert_eq!(tilted, 3);
    });
}
