//! Where the axes were at the instant of a reading, from the positions of the servo ticks around it.
//!
//! Between two ticks positions are straight lines: at 1 kHz and 1 m/s² the bend between ticks is 0.1 µm.
//! Readings carry the host's time alone, so positions are taken by the host's receive stamp; the constant
//! part of the time between both is an unknown of the fit (`unknown`, τ).

use std::collections::VecDeque;

use metrology::sample::{AxisState, GridSample};
use metrology::{Axis, Host, PerAxis, Stamp};
use nalgebra::Vector3;

use crate::config::PositionSource;
use crate::recording::Pair;

/// Commanded step below which an axis counts as not moved, mm: a tenth of what controls resolve.
const NO_MOTION_MM: f64 = 1e-5;

#[derive(Clone, Copy, Debug)]
struct Tick {
    at: Stamp<Host>,
    commanded: PerAxis<f64>,
    positions: PerAxis<f64>,
    sense: Vector3<f64>,
}

/// Recent positions in the order of time.
#[derive(Clone, Debug)]
pub struct AxisLog {
    ticks: VecDeque<Tick>,
    capacity: usize,
    source: PositionSource,
}

impl AxisLog {
    /// An empty log for `capacity` positions.
    #[must_use]
    pub fn new(capacity: usize, source: PositionSource) -> Self {
        Self {
            ticks: VecDeque::with_capacity(capacity),
            capacity,
            source,
        }
    }

    /// Adds positions; false and empty if they are older than the newest.
    pub fn push(&mut self, state: &AxisState) -> bool {
        let at = state.received_at;
        let in_order = match self.newest() {
            Some(newest) if at == newest => return true,
            Some(newest) => at > newest,
            None => true,
        };
        if !in_order {
            self.ticks.clear();
        }
        if self.ticks.len() == self.capacity {
            self.ticks.pop_front();
        }
        let sense = self.ticks.back().map_or_else(Vector3::zeros, |last| {
            Vector3::from_fn(|i, _| {
                let step = state.commanded[Axis::LINEAR[i]] - last.commanded[Axis::LINEAR[i]];
                if step.abs() > NO_MOTION_MM {
                    step.signum()
                } else {
                    last.sense[i]
                }
            })
        });
        self.ticks.push_back(Tick {
            at,
            commanded: state.commanded,
            positions: match self.source {
                PositionSource::Motor => state.motor,
                PositionSource::Commanded => state.commanded,
            },
            sense,
        });
        in_order
    }

    /// Stamp of the newest positions.
    #[must_use]
    pub fn newest(&self) -> Option<Stamp<Host>> {
        self.ticks.back().map(|tick| tick.at)
    }

    /// A reading with the positions at its stamp; `None` where the log does not hold both sides of it.
    #[must_use]
    pub fn pair(&self, sample: &GridSample) -> Option<Pair> {
        let after_idx = self.ticks.partition_point(|tick| tick.at < sample.at);
        let after = self.ticks.get(after_idx)?;
        let before = self.ticks.get(after_idx.checked_sub(1)?)?;
        let step_s = (after.at - before.at).as_secs_f64();
        let share = (sample.at - before.at).as_secs_f64() / step_s;
        let between = |a: &PerAxis<f64>, b: &PerAxis<f64>| {
            PerAxis::from_fn(|axis| a[axis] + share * (b[axis] - a[axis]))
        };
        let rate = |a: &PerAxis<f64>, b: &PerAxis<f64>| (b.xyz() - a.xyz()) / step_s;
        Some(Pair {
            at: sample.at,
            reading_mm: [sample.u_mm, sample.v_mm],
            commanded: between(&before.commanded, &after.commanded),
            positions: between(&before.positions, &after.positions),
            commanded_speed_mm_s: rate(&before.commanded, &after.commanded).norm(),
            velocity_mm_s: rate(&before.positions, &after.positions),
            sense: after.sense,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::AxisSet;
    use metrology::sample::TestPlane;

    fn state(ms: i64, x: f64) -> AxisState {
        let mut commanded = PerAxis::default();
        commanded[Axis::X] = x;
        let mut motor = commanded;
        motor[Axis::X] = x - 0.5;
        AxisState {
            received_at: Stamp::from_nanos(ms * 1_000_000),
            controller_at: Stamp::from_nanos(ms * 1_000_000),
            axes: AxisSet::XYZ,
            commanded,
            motor,
            scale: PerAxis::default(),
            velocity: PerAxis::default(),
        }
    }

    fn sample(us: i64) -> GridSample {
        GridSample {
            at: Stamp::from_nanos(us * 1000),
            plane: TestPlane::Xy,
            u_mm: 1.0,
            v_mm: 2.0,
            zero_id: 1,
        }
    }

    #[test]
    fn positions_between_two_ticks_are_on_the_line() {
        let mut log = AxisLog::new(8, PositionSource::Motor);
        for (ms, x) in [(0, 0.0), (1, 0.1), (2, 0.2), (3, 0.2), (4, 0.1)] {
            assert!(log.push(&state(ms, x)));
        }
        let pair = log.pair(&sample(1250)).unwrap();
        assert!((pair.commanded[Axis::X] - 0.125).abs() < 1e-12);
        assert!((pair.positions[Axis::X] + 0.375).abs() < 1e-12);
        assert!((pair.commanded_speed_mm_s - 100.0).abs() < 1e-9);
        assert!((pair.sense.x - 1.0).abs() < 1e-12);
        assert!((log.pair(&sample(3500)).unwrap().sense.x + 1.0).abs() < 1e-12);
        assert!(log.pair(&sample(2500)).unwrap().is_standing(0.01));
        assert!(log.pair(&sample(4500)).is_none());
    }

    #[test]
    fn a_clock_that_goes_back_empties_the_log() {
        let mut log = AxisLog::new(8, PositionSource::Commanded);
        assert!(log.push(&state(5, 0.0)) && log.push(&state(6, 0.0)));
        assert!(!log.push(&state(2, 0.0)));
        assert!(log.pair(&sample(5500)).is_none());
    }
}
