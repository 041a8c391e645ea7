//! Positions of the axes, put together from values that come one by one.
//!
//! Values with one stamp belong together: they give one state, once another stamp comes or nothing has come for
//! [`SETTLE`]. An axis that is absent is not in the state. The velocity is that between two stamps,
//!
//! ```text
//!   v = (p_k − p_{k−1}) / (t_k − t_{k−1})                                                    (1)
//! ```
//!
//! and zero until two positions are known or when the stamps do not go on. A machine tells a position when it
//! has changed: (1) is the mean over the time since the last change that it told.

use metrology::sample::AxisState;
use metrology::stamp::{Host, Machine, Span, Stamp};
use metrology::{Axis, AxisSet, PerAxis};

/// A state is told this long after its last value came.
pub const SETTLE: Span = Span::from_nanos(100_000_000);

#[derive(Clone, Copy, Debug)]
struct Open {
    machine_at: Stamp<Machine>,
    received_at: Stamp<Host>,
}

/// Puts states together.
#[derive(Clone, Debug, Default)]
pub struct Positions {
    axes: AxisSet,
    actual: PerAxis<f64>,
    commanded: PerAxis<Option<f64>>,
    velocity: PerAxis<f64>,
    told_at: PerAxis<Stamp<Machine>>,
    open: Option<Open>,
}

impl Positions {
    /// Takes the position of an axis, mm or rad; returns the state before it where that is whole by now.
    pub fn hear(
        &mut self,
        axis: Axis,
        commanded: bool,
        position: f64,
        machine_at: Stamp<Machine>,
        received_at: Stamp<Host>,
    ) -> Option<AxisState> {
        let is_other = self.open.is_some_and(|open| open.machine_at != machine_at);
        let whole = if is_other { self.take() } else { None };
        if commanded {
            self.commanded[axis] = Some(position);
        } else {
            let passed_s = (machine_at - self.told_at[axis]).as_secs_f64();
            let is_known = self.axes.contains(axis) && passed_s > 0.0;
            self.velocity[axis] = if is_known {
                (position - self.actual[axis]) / passed_s
            } else {
                0.0
            };
            self.axes = self.axes.with(axis);
            self.actual[axis] = position;
            self.told_at[axis] = machine_at;
        }
        self.open = Some(Open {
            machine_at,
            received_at,
        });
        whole
    }

    /// An axis is not known any more; returns the state before that.
    pub fn absent(&mut self, axis: Axis, commanded: bool) -> Option<AxisState> {
        let whole = self.take();
        self.commanded[axis] = None;
        if !commanded {
            self.axes = self.axes.iter().filter(|other| *other != axis).collect();
        }
        whole
    }

    /// The open state where nothing has come for [`SETTLE`].
    pub fn settled(&mut self, now: Stamp<Host>) -> Option<AxisState> {
        let open = self.open?;
        if now - open.received_at < SETTLE {
            return None;
        }
        self.take()
    }

    /// The open state.
    pub fn take(&mut self) -> Option<AxisState> {
        let open = self.open.take()?;
        if self.axes.is_empty() {
            return None;
        }
        Some(AxisState {
            received_at: open.received_at,
            controller_at: open.machine_at,
            axes: self.axes,
            commanded: PerAxis::from_fn(|axis| self.commanded[axis].unwrap_or(self.actual[axis])),
            motor: self.actual,
            scale: PerAxis::from_fn(|_| f64::NAN),
            velocity: self.velocity,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: f64) -> Stamp<Machine> {
        Stamp::from_nanos(Span::from_secs_f64(s).nanos())
    }

    fn host(s: f64) -> Stamp<Host> {
        Stamp::from_nanos(Span::from_secs_f64(s).nanos())
    }

    #[test]
    fn eq1_values_of_one_stamp_give_one_state_with_the_velocity_between_stamps() {
        let mut positions = Positions::default();
        assert!(
            positions
                .hear(Axis::X, false, 1.0, at(1.0), host(9.0))
                .is_none()
        );
        assert!(
            positions
                .hear(Axis::Y, false, 5.0, at(1.0), host(9.0))
                .is_none()
        );
        let first = positions
            .hear(Axis::X, false, 3.0, at(1.5), host(9.5))
            .unwrap();
        assert_eq!((first.axes.len(), first.motor[Axis::X]), (2, 1.0));
        assert!(positions.settled(host(9.55)).is_none());
        let second = positions.settled(host(9.6)).unwrap();
        assert!((second.velocity[Axis::X] - 4.0).abs() < 1e-12);
        assert_eq!(second.controller_at, at(1.5));
        assert!(positions.settled(host(99.0)).is_none());
    }

    #[test]
    fn an_absent_axis_is_not_in_the_state_and_no_axis_is_no_state() {
        let mut positions = Positions::default();
        positions.hear(Axis::X, false, 1.0, at(1.0), host(1.0));
        positions.hear(Axis::C, false, 0.5, at(1.0), host(1.0));
        assert!(positions.absent(Axis::X, false).is_some());
        positions.hear(Axis::C, false, 0.6, at(2.0), host(2.0));
        let state = positions.take().unwrap();
        assert_eq!(state.axes.iter().collect::<Vec<_>>(), [Axis::C]);
        positions.hear(Axis::C, false, 0.7, at(3.0), host(3.0));
        assert!(positions.absent(Axis::C, false).is_some());
        positions.hear(Axis::C, true, 0.7, at(3.0), host(3.0));
        assert!(positions.take().is_none());
    }

    #[test]
    fn commanded_positions_are_told_where_the_machine_tells_them() {
        let mut positions = Positions::default();
        positions.hear(Axis::X, false, 1.0, at(1.0), host(1.0));
        positions.hear(Axis::X, true, 1.25, at(1.0), host(1.0));
        let state = positions.take().unwrap();
        assert!((state.commanded[Axis::X] - 1.25).abs() < 1e-12);
    }
}
