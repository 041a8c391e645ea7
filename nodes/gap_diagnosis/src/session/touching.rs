//! The motion of touches of which only the latched positions are known.
//!
//! A touch begins at the stand-off and goes along its approach at its feed, so each one is given two ticks:
//!
//! ```text
//!   x(t - s/f) = x_latched - s n,   x(t) = x_latched                      (1)
//! ```
//!
//! Position, direction of motion and way since the reversal follow from them. Velocity and acceleration are not known
//! and zero: what depends on the feed alone has the touch's own.

use machine::MachineFile;
use metrology::{Axis, AxisSet, PerAxis};
use twin::{Motion, Touch, TwinError};

/// Least time between two ticks, s.
const APART_S: f64 = 1e-3;

/// The motion (1) of touches in time, which are told their ticks; a touch that is given no time of its own is
/// moved behind the one before.
pub(super) fn motion(
    machine: &MachineFile,
    axes: AxisSet,
    touches: &mut [(Touch, f64)],
) -> Result<Motion, TwinError> {
    let standoff_mm = machine.probe.standoff_mm;
    let mut time_s: Vec<f64> = vec![];
    let mut position = PerAxis::<Vec<f64>>::default();
    let mut put = |at_s: f64, place: &PerAxis<f64>, time_s: &mut Vec<f64>| {
        time_s.push(at_s);
        for axis in axes.iter() {
            position[axis].push(place[axis]);
        }
    };
    for (touch, _) in touches {
        let feed_mm_s = if touch.feed_mm_s > 0.0 {
            touch.feed_mm_s
        } else {
            machine.probe.feed_mm_min / 60.0
        };
        let last_s = time_s.last().copied().unwrap_or(f64::NEG_INFINITY);
        touch.time_s = touch.time_s.max(last_s + 2.0 * APART_S);
        let wanted_s = touch.time_s - standoff_mm / feed_mm_s;
        let began_s = wanted_s.max(last_s + APART_S).min(touch.time_s - APART_S);
        let mut before = touch.position;
        for axis in Axis::LINEAR.into_iter().filter(|axis| axes.contains(*axis)) {
            before[axis] -= standoff_mm * touch.approach[axis.index()];
        }
        put(began_s, &before, &mut time_s);
        put(touch.time_s, &touch.position, &mut time_s);
        touch.tick = Some(time_s.len() - 1);
    }
    let mut motion = Motion::new(time_s, axes, position)?;
    for axis in axes.iter() {
        motion.velocity[axis].fill(0.0);
        motion.acceleration[axis].fill(0.0);
        motion.driven[axis].fill(0.0);
    }
    Ok(motion)
}
