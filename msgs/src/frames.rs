//! Poses of frames, for tf.

use metrology::sample::FrameTransform;

use crate::geometry_msgs::msg::{Quaternion, TransformStamped};
use crate::tf2_msgs::msg::TFMessage;
use crate::wire::{lengths, time};

/// What tf is told: one entry per pose, in their order; translations in m.
#[must_use]
pub fn transforms(poses: &[FrameTransform]) -> TFMessage {
    TFMessage {
        transforms: poses.iter().map(transform).collect(),
    }
}

fn transform(pose: &FrameTransform) -> TransformStamped {
    let mut message = TransformStamped::default();
    message.header.stamp = time(pose.at);
    message.header.frame_id.push_str(&pose.parent);
    message.child_frame_id.push_str(&pose.child);
    message.transform.translation = lengths(&pose.parent_from_child.translation.vector);
    let turn = &pose.parent_from_child.rotation;
    message.transform.rotation = Quaternion {
        x: turn.i,
        y: turn.j,
        z: turn.k,
        w: turn.w,
    };
    message
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

    use metrology::Stamp;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn a_pose_is_told_in_metres_with_its_frames() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
        let pose = FrameTransform {
            at: Stamp::from_nanos(1_500_000_000),
            parent: "mill_3/base_link".into(),
            child: "mill_3/c_rotary".into(),
            parent_from_child: Isometry3::from_parts(Translation3::new(1.0, -20.0, 300.0), turn),
        };
        let message = &transforms(&[pose]).transforms[0];
        assert_eq!(message.header.frame_id, "mill_3/base_link");
        assert_eq!(message.child_frame_id, "mill_3/c_rotary");
        let stamp = &message.header.stamp;
        assert_eq!((stamp.sec, stamp.nanosec), (1, 500_000_000));
        let place = &message.transform.translation;
        let place = Vector3::new(place.x, place.y, place.z);
        assert!((place - Vector3::new(0.001, -0.02, 0.3)).norm() < 1e-15);
        let turn = &message.transform.rotation;
        assert!((turn.z - FRAC_1_SQRT_2).abs() + (turn.w - FRAC_1_SQRT_2).abs() < 1e-15);
        assert!(turn.x.abs() + turn.y.abs() < 1e-15);
    }
}
