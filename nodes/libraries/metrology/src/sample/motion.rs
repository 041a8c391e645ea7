//! Positions of the axes at one servo tick.

use crate::axis::{AxisSet, PerAxis};
use crate::stamp::{Host, Machine, Stamp};

/// Positions of all axes at one servo tick; mm for linear, rad for rotary axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisState {
    /// When the host received it.
    pub received_at: Stamp<Host>,
    /// The controller's own stamp of the tick.
    pub controller_at: Stamp<Machine>,
    /// The axes that the machine has; values of others are meaningless.
    pub axes: AxisSet,
    /// Commanded by the program, compensation not included.
    pub commanded: PerAxis<f64>,
    /// Motor encoder times lead, compensation included (it is where the motor is).
    pub motor: PerAxis<f64>,
    /// Linear scale, NaN where there is none.
    pub scale: PerAxis<f64>,
    /// Velocity of the motor, per second.
    pub velocity: PerAxis<f64>,
}

impl AxisState {
    /// Axes that stand at `position` (mm, rad), motor and command alike, on a machine without linear scales.
    #[must_use]
    pub fn standing(
        received_at: Stamp<Host>,
        controller_at: Stamp<Machine>,
        axes: AxisSet,
        position: PerAxis<f64>,
    ) -> Self {
        Self {
            received_at,
            controller_at,
            axes,
            commanded: position,
            motor: position,
            scale: PerAxis([f64::NAN; 6]),
            velocity: PerAxis::default(),
        }
    }
}
