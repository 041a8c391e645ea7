//! Positions of the axes, put together from values that come one by one.
//!
//! Values with one stamp belong together: they give one state, once another stamp comes, another value of the same axis, or
//! nothing has come for [`SETTLE`]. A clock of whole seconds stamps many positions alike: each is a state of its own. An axis that is absent is not in the state. After a start and after a break of the connection, the
//! axes come one by one: no state is given until each axis of the mapping has come or is absent, at most for
//! [`GATHER`]. The velocity is that between two stamps,
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

/// States wait at most so long for an axis that has not come yet.
pub const GATHER: Span = Span::from_nanos(5_000_000_000);

#[derive(Clone, Copy, Debug)]
struct Open {
    machine_at: Stamp<Machine>,
    received_at: Stamp<Host>,
    /// Axes whose position is in it, and those whose command is.
    heard: [AxisSet; 2],
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
    /// Axes of the mapping that have neither come nor are known to be absent.
    awaited: AxisSet,
    first_at: Option<Stamp<Host>>,
}

impl Positions {
    /// Of a machine with these axes, before the first position of any of them.
    #[must_use]
    pub fn awaiting(axes: AxisSet) -> Self {
        Self {
            awaited: axes,
            ..Self::default()
        }
    }

    /// Forgets all positions, after a break.
    pub fn forget(&mut self, axes: AxisSet) {
        *self = Self::awaiting(axes);
    }

    fn no_longer_await(&mut self, axis: Axis) {
        self.awaited = self.awaited.iter().filter(|one| *one != axis).collect();
    }

    /// Takes the position of an axis, mm or rad; returns the state before it where that is whole by now.
    pub fn hear(
        &mut self,
        axis: Axis,
        commanded: bool,
        position: f64,
        machine_at: Stamp<Machine>,
        received_at: Stamp<Host>,
    ) -> Option<AxisState> {
        let is_other = |open: Open| {
            open.machine_at != machine_at || open.heard[usize::from(commanded)].contains(axis)
        };
        let whole = if self.open.is_some_and(is_other) {
            self.take()
        } else {
            None
        };
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
            self.no_longer_await(axis);
            self.actual[axis] = position;
            self.told_at[axis] = machine_at;
        }
        let mut heard = self.open.map_or([AxisSet::EMPTY; 2], |open| open.heard);
        heard[usize::from(commanded)] = heard[usize::from(commanded)].with(axis);
        self.open = Some(Open {
            machine_at,
            received_at,
            heard,
        });
        self.first_at.get_or_insert(received_at);
        whole
    }

    /// An axis is not known any more; returns the state before that.
    pub fn absent(&mut self, axis: Axis, commanded: bool) -> Option<AxisState> {
        let whole = self.take();
        self.commanded[axis] = None;
        if !commanded {
            self.axes = self.axes.iter().filter(|other| *other != axis).collect();
            self.no_longer_await(axis);
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
        let waited = self.first_at.map(|first_at| open.received_at - first_at);
        let is_gathering = !self.awaited.is_empty() && waited.is_some_and(|waited| waited < GATHER);
        if self.axes.is_empty() || is_gathering {
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
    fn each_of_many_positions_with_one_stamp_is_a_state() {
        let mut positions = Positions::default();
        let mut told = vec![];
        for k in 0..10_u8 {
            told.extend(positions.hear(Axis::X, false, f64::from(k), at(1.0), host(9.0)));
        }
        told.extend(positions.settled(host(9.2)));
        let places: Vec<f64> = told.iter().map(|state| state.motor[Axis::X]).collect();
        assert_eq!(places, (0..10_u8).map(f64::from).collect::<Vec<_>>());
        // Another axis and the command of this one are of the same state.
        positions.hear(Axis::X, false, 1.0, at(2.0), host(10.0));
        assert!(
            positions
                .hear(Axis::X, true, 1.5, at(2.0), host(10.0))
                .is_none()
        );
        assert!(
            positions
                .hear(Axis::Y, false, 3.0, at(2.0), host(10.0))
                .is_none()
        );
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
    fn no_state_is_given_before_each_axis_has_come_or_is_absent() {
        let axes = [Axis::X, Axis::Y, Axis::Z].into_iter().collect();
        let mut positions = Positions::awaiting(axes);
        positions.hear(Axis::X, false, 1.0, at(1.0), host(1.0));
        assert!(
            positions
                .hear(Axis::Y, false, 2.0, at(1.1), host(1.1))
                .is_none()
        );
        assert!(positions.settled(host(1.3)).is_none());
        assert!(positions.absent(Axis::Z, false).is_none());
        positions.hear(Axis::X, false, 1.5, at(1.4), host(1.4));
        let state = positions.take().unwrap();
        assert_eq!(state.axes.iter().collect::<Vec<_>>(), [Axis::X, Axis::Y]);

        positions.forget(axes);
        positions.hear(Axis::Y, false, 2.0, at(2.0), host(2.0));
        positions.hear(Axis::X, false, 1.0, at(2.0), host(2.0));
        assert!(positions.take().is_none());
        positions.hear(Axis::X, false, 1.0, at(7.1), host(7.1));
        assert_eq!(positions.take().unwrap().axes.len(), 2);
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
