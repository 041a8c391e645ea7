//! What is added to the command of each axis.

use crate::axis::{AxisSet, PerAxis};
use crate::stamp::{Host, Stamp};

/// What the compensation of one axis is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CompensationState {
    /// Nothing is added.
    #[default]
    Off,
    /// Following its model.
    Active,
    /// The model is stale or refused; the last good value is held.
    Holding,
    /// Going to zero.
    Fading,
    /// Following, but a limit of size, rate or acceleration binds.
    Limited,
}

/// Offsets added to the commands at one servo tick; mm for linear, rad for rotary axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCompensation {
    /// When it was computed.
    pub at: Stamp<Host>,
    /// The axes that are compensated.
    pub axes: AxisSet,
    /// What the controller adds to the command, after every limit.
    pub total: PerAxis<f64>,
    /// Thermal part before limits.
    pub thermal: PerAxis<f64>,
    /// Geometric part before limits.
    pub geometric: PerAxis<f64>,
    /// Positioning part before limits.
    pub positioning: PerAxis<f64>,
    /// Whole pulses of the controller's pulse equivalent.
    pub pulses: PerAxis<i64>,
    /// What is left below one pulse.
    pub remainder: PerAxis<f64>,
    /// State per axis.
    pub state: PerAxis<CompensationState>,
}
