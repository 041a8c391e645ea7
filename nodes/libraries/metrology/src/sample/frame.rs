//! Where a frame is in another.

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::stamp::{Host, Stamp};

/// Pose of one frame in its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTransform {
    /// When it was so.
    pub at: Stamp<Host>,
    /// Name of the frame in which the pose is given.
    pub parent: Arc<str>,
    /// Name of the frame whose pose it is.
    pub child: Arc<str>,
    /// The pose: takes coordinates of the child, mm, to those of the parent.
    pub parent_from_child: Isometry3<f64>,
}
