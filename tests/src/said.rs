//! Messages that several tests say.

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::AxisCompensation;

/// Offsets of X; the other linear axes have none.
#[must_use]
pub fn compensation(at: &Time, x_m: f64) -> AxisCompensation {
    let mut message = AxisCompensation::default();
    message.header.stamp = at.clone();
    message.axis = ["X", "Y", "Z"].map(str::to_owned).into();
    message.total = vec![x_m, 0.0, 0.0];
    message.thermal = vec![x_m, 0.0, 0.0];
    message.geometric = vec![0.0; 3];
    message.positioning = vec![0.0; 3];
    // Of whatever pulse equivalent the machine is.
    message.pulses = vec![0; 3];
    message.remainder = vec![x_m, 0.0, 0.0];
    message.state = vec![AxisCompensation::STATE_ACTIVE; 3];
    message
}
