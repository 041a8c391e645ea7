//! Positions of the axes as everybody's tools get them.

use crate::axis::{AxisSet, PerAxis};
use crate::stamp::{Host, Stamp};

/// Positions of some axes at one instant; mm for linear, rad for rotary axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSample {
    /// When the host received them.
    pub at: Stamp<Host>,
    /// The axes that are told; values of others are meaningless.
    pub axes: AxisSet,
    /// Position of each.
    pub position: PerAxis<f64>,
    /// Velocity of each, per second, where it is told.
    pub velocity: Option<PerAxis<f64>>,
}
