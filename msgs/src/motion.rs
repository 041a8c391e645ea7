//! Positions of the axes.

use metrology::sample::AxisState as Inner;

use crate::msg::AxisState;
use crate::sensor_msgs::msg::JointState;
use crate::wire::{Allowed, Reader, set_letters, set_positions, time};
use crate::{Place, Wire, WireError};

impl Wire for AxisState {
    type Inner = Inner;

    fn set_from_inner(&mut self, inner: &Inner) {
        self.header.stamp = time(inner.received_at);
        self.controller_stamp = time(inner.controller_at);
        set_letters(&mut self.axis, inner.axes);
        set_positions(&mut self.commanded, inner.axes, &inner.commanded);
        set_positions(&mut self.motor, inner.axes, &inner.motor);
        set_positions(&mut self.scale, inner.axes, &inner.scale);
        set_positions(&mut self.velocity, inner.axes, &inner.velocity);
    }

    fn to_inner(&self) -> Result<Inner, WireError> {
        let read = Reader::of::<Self>();
        let letters = read.letters("axis", &self.axis)?;
        let finite = |field, values| read.positions(field, &letters, values, 0.0, Allowed::Finite);
        Ok(Inner {
            received_at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            controller_at: read.stamp("controller_stamp", Place::Whole, &self.controller_stamp)?,
            axes: letters.set(),
            commanded: finite("commanded", &self.commanded)?,
            motor: finite("motor", &self.motor)?,
            scale: read.positions("scale", &letters, &self.scale, f64::NAN, Allowed::OrNan)?,
            velocity: finite("velocity", &self.velocity)?,
        })
    }
}

/// The same positions for everybody's tools: motor positions under the axes' letters, effort unknown.
#[must_use]
pub fn joint_state(state: &Inner) -> JointState {
    let mut message = JointState::default();
    message.header.stamp = time(state.received_at);
    set_letters(&mut message.name, state.axes);
    set_positions(&mut message.position, state.axes, &state.motor);
    set_positions(&mut message.velocity, state.axes, &state.velocity);
    message
}
