//! Positions of the axes.

use metrology::sample::{AxisState as Inner, JointSample};

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

impl Wire for JointState {
    type Inner = JointSample;

    fn set_from_inner(&mut self, inner: &JointSample) {
        self.header.stamp = time(inner.at);
        set_letters(&mut self.name, inner.axes);
        set_positions(&mut self.position, inner.axes, &inner.position);
        match &inner.velocity {
            Some(velocity) => set_positions(&mut self.velocity, inner.axes, velocity),
            None => self.velocity.clear(),
        }
    }

    fn to_inner(&self) -> Result<JointSample, WireError> {
        let read = Reader::of::<Self>();
        let letters = read.letters("name", &self.name)?;
        let finite = |field, values| read.positions(field, &letters, values, 0.0, Allowed::Finite);
        // As the message's own comment says, an array that means nothing is left empty.
        let velocity = if self.velocity.is_empty() {
            None
        } else {
            Some(finite("velocity", &self.velocity)?)
        };
        Ok(JointSample {
            at: read.stamp("header.stamp", Place::Whole, &self.header.stamp)?,
            axes: letters.set(),
            position: finite("position", &self.position)?,
            velocity,
        })
    }
}

/// The same positions for everybody's tools: motor positions under the axes' letters, effort unknown.
#[must_use]
pub fn joint_state(state: &Inner) -> JointState {
    JointState::from_inner(&JointSample {
        at: state.received_at,
        axes: state.axes,
        position: state.motor,
        velocity: Some(state.velocity),
    })
}

#[cfg(test)]
mod tests {
    use metrology::{Axis, PerAxis, Stamp};

    use super::*;

    fn sample() -> JointSample {
        JointSample {
            at: Stamp::from_nanos(1_500_000_000),
            axes: [Axis::X, Axis::C].into_iter().collect(),
            position: PerAxis([250.0, 0.0, 0.0, 0.0, 0.0, -1.5]),
            velocity: Some(PerAxis([-125.0, 0.0, 0.0, 0.0, 0.0, 0.5])),
        }
    }

    #[test]
    fn joints_are_metres_and_radians_on_the_wire_and_come_back() {
        let told = sample();
        let message = JointState::from_inner(&told);
        assert_eq!(message.name, ["X", "C"]);
        assert_eq!(message.position, [0.25, -1.5]);
        assert_eq!(message.velocity, [-0.125, 0.5]);
        assert_eq!(message.to_inner().unwrap(), told);
        let untold = JointSample {
            velocity: None,
            ..told
        };
        assert_eq!(JointState::as_received(&untold).unwrap(), untold);
    }

    #[test]
    fn joints_of_another_robot_are_refused_by_name() {
        let mut message = JointState::from_inner(&sample());
        message.name[1] = "shoulder_pan".to_owned();
        let words = message.to_inner().unwrap_err().to_string();
        assert!(words.contains("name[1]: axis \"shoulder_pan\""), "{words}");
        message.name.pop();
        let words = message.to_inner().unwrap_err().to_string();
        assert!(words.contains("2 entries for 1 axes"), "{words}");
        let mut message = JointState::from_inner(&sample());
        message.position[0] = f64::NAN;
        let words = message.to_inner().unwrap_err().to_string();
        assert!(words.contains("position[X]: NaN"), "{words}");
    }
}
