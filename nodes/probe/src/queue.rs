//! The coordinate queue: where the axes were at any recent instant of the controller's clock.
//!
//! # Model
//!
//! ```text
//!   p(t) = p_k + (p_{k+1} − p_k)(t − t_k)/(t_{k+1} − t_k),   t_k ≤ t ≤ t_{k+1}        (1)
//! ```
//!
//! p are motor positions (encoder times lead, mm, rad), t the controller's stamps. The error of (1)
//! is at most a Δt²/8: 0.4 µm at 3 m/s² and 1 ms, and nothing at constant feed.
//!
//! # Holds when
//! An answer is interpolated or refused, never held or extrapolated: before the oldest position,
//! after the newest, across a gap and beside a position that is no number, [`QueueMiss`] says which.
//! When stamps run backwards the queue starts anew, since older positions are on another time line.
//! The ring is allocated once.

use metrology::number::number;
use metrology::sample::AxisState;
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, Machine, PerAxis, Stamp};

/// Recent positions by the controller's stamp.
#[derive(Clone, Debug)]
pub struct CoordinateQueue {
    ring: Vec<Entry>,
    capacity: usize,
    /// Place of the oldest entry.
    first: usize,
    longest_gap: Span,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    at: Stamp<Machine>,
    motor: PerAxis<f64>,
    is_finite: bool,
}

/// What became of a position that was put into the queue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stored {
    /// It is in the queue.
    InOrder,
    /// It has the stamp of the newest one and was left out.
    Repeated,
    /// It is older than the newest one: the queue was emptied and begins with it.
    WentBack {
        /// Newest stamp before.
        from: Stamp<Machine>,
    },
    /// It is kept as a hole: this axis' position is no finite number.
    NotFinite {
        /// The axis.
        axis: Axis,
    },
}

/// Why the queue has no position at an instant.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum QueueMiss {
    /// Nothing is queued.
    #[error("nothing is queued")]
    Empty,
    /// The instant is before the oldest position.
    #[error("{early_s} s before the oldest queued position", early_s = number(*early_s))]
    BeforeOldest {
        /// By how much, s.
        early_s: f64,
    },
    /// The instant is after the newest position.
    #[error("{late_s} s after the newest queued position", late_s = number(*late_s))]
    AfterNewest {
        /// By how much, s.
        late_s: f64,
    },
    /// The positions around the instant are too far apart.
    #[error("in a gap of {gap_s} s, longest allowed {limit_s} s", gap_s = number(*gap_s), limit_s = number(*limit_s))]
    Gap {
        /// Time between the positions, s.
        gap_s: f64,
        /// Longest time that is interpolated, s.
        limit_s: f64,
    },
    /// A position beside the instant is no finite number.
    #[error("beside a position that is not finite")]
    NotFinite,
}

impl CoordinateQueue {
    /// An empty queue for `capacity` positions (two at least).
    #[must_use]
    pub fn new(capacity: usize, longest_gap: Span) -> Self {
        let capacity = capacity.max(2);
        Self {
            ring: Vec::with_capacity(capacity),
            capacity,
            first: 0,
            longest_gap,
        }
    }

    /// Number of positions in the queue.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.ring.len()
    }

    /// Whether nothing waits.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// Puts the motor positions of `axes` into the queue.
    pub fn push(&mut self, state: &AxisState, axes: AxisSet) -> Stored {
        let bad_axis = axes.iter().find(|&axis| !state.motor[axis].is_finite());
        let entry = Entry {
            at: state.controller_at,
            motor: state.motor,
            is_finite: bad_axis.is_none(),
        };
        let mut stored = bad_axis.map_or(Stored::InOrder, |axis| Stored::NotFinite { axis });
        if let Some(newest) = self.newest() {
            if entry.at == newest.at {
                return Stored::Repeated;
            }
            if entry.at < newest.at {
                stored = Stored::WentBack { from: newest.at };
                self.ring.clear();
                self.first = 0;
            }
        }
        if self.ring.len() < self.capacity {
            self.ring.push(entry);
        } else {
            self.ring[self.first] = entry;
            self.first = (self.first + 1) % self.capacity;
        }
        stored
    }

    /// Positions at an instant, equation (1).
    ///
    /// # Errors
    /// Where the queue has no answer.
    pub fn at(&self, instant: Stamp<Machine>) -> Result<PerAxis<f64>, QueueMiss> {
        let (Some(oldest), Some(newest)) = (self.ring.get(self.first), self.newest()) else {
            return Err(QueueMiss::Empty);
        };
        if instant < oldest.at {
            let early_s = (oldest.at - instant).as_secs_f64();
            return Err(QueueMiss::BeforeOldest { early_s });
        }
        if instant > newest.at {
            let late_s = (instant - newest.at).as_secs_f64();
            return Err(QueueMiss::AfterNewest { late_s });
        }
        let later_place = self.first_not_before(instant);
        let later = self.entry(later_place);
        if later.at == instant {
            return if later.is_finite {
                Ok(later.motor)
            } else {
                Err(QueueMiss::NotFinite)
            };
        }
        // The oldest is before the instant, so something stands before `later`.
        let earlier = self.entry(later_place - 1);
        self.between(earlier, later, instant)
    }

    fn between(
        &self,
        earlier: &Entry,
        later: &Entry,
        instant: Stamp<Machine>,
    ) -> Result<PerAxis<f64>, QueueMiss> {
        let gap = later.at - earlier.at;
        if gap > self.longest_gap {
            return Err(QueueMiss::Gap {
                gap_s: gap.as_secs_f64(),
                limit_s: self.longest_gap.as_secs_f64(),
            });
        }
        if !(earlier.is_finite && later.is_finite) {
            return Err(QueueMiss::NotFinite);
        }
        let share = (instant - earlier.at).nanos() as f64 / gap.nanos() as f64;
        Ok(PerAxis::from_fn(|axis| {
            let (from, to) = (earlier.motor[axis], later.motor[axis]);
            from + (to - from) * share // (1)
        }))
    }

    /// Place, counted from the oldest, of the first entry at or after the instant.
    fn first_not_before(&self, instant: Stamp<Machine>) -> usize {
        let (mut low, mut high) = (0, self.ring.len() - 1);
        while low < high {
            let middle = usize::midpoint(low, high);
            if self.entry(middle).at < instant {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        low
    }

    fn entry(&self, place: usize) -> &Entry {
        &self.ring[(self.first + place) % self.ring.len()]
    }

    fn newest(&self) -> Option<&Entry> {
        let last = self.ring.len().checked_sub(1)?;
        Some(self.entry(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(ms: f64, x_mm: f64) -> AxisState {
        let mut motor = PerAxis::default();
        motor[Axis::X] = x_mm;
        AxisState {
            scale: motor,
            ..AxisState::standing(Stamp::from_nanos(0), instant(ms), AxisSet::XYZ, motor)
        }
    }

    fn instant(ms: f64) -> Stamp<Machine> {
        Stamp::from_nanos(0) + Span::from_secs_f64(ms / 1e3)
    }

    fn filled(capacity: usize, n: u32) -> CoordinateQueue {
        let mut queue = CoordinateQueue::new(capacity, Span::from_secs_f64(0.0025));
        for k in 0..n {
            let stored = queue.push(&state(f64::from(k), 10.0 * f64::from(k)), AxisSet::XYZ);
            assert_eq!(stored, Stored::InOrder);
        }
        queue
    }

    #[test]
    fn eq1_interpolates_between_and_meets_the_samples() {
        let queue = filled(8, 8);
        assert!((queue.at(instant(3.25)).unwrap()[Axis::X] - 32.5).abs() < 1e-12);
        for k in 0..8 {
            let found = queue.at(instant(f64::from(k))).unwrap()[Axis::X];
            assert!((found - 10.0 * f64::from(k)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_full_ring_forgets_the_oldest_only_and_allocates_nothing() {
        let queue = filled(8, 1000);
        assert_eq!((queue.len(), queue.ring.capacity()), (8, 8));
        assert!((queue.at(instant(992.5)).unwrap()[Axis::X] - 9925.0).abs() < 1e-9);
        assert!((queue.at(instant(998.9)).unwrap()[Axis::X] - 9989.0).abs() < 1e-9);
        assert_eq!(
            queue.at(instant(991.0)),
            Err(QueueMiss::BeforeOldest { early_s: 0.001 })
        );
        assert_eq!(
            queue.at(instant(1000.0)),
            Err(QueueMiss::AfterNewest { late_s: 0.001 })
        );
    }

    #[test]
    fn a_gap_is_not_bridged_but_its_ends_are_known() {
        let mut queue = filled(16, 3);
        queue.push(&state(7.0, 70.0), AxisSet::XYZ);
        assert_eq!(
            queue.at(instant(4.0)),
            Err(QueueMiss::Gap {
                gap_s: 0.005,
                limit_s: 0.0025
            })
        );
        assert!((queue.at(instant(7.0)).unwrap()[Axis::X] - 70.0).abs() < 1e-12);
        assert!((queue.at(instant(2.0)).unwrap()[Axis::X] - 20.0).abs() < 1e-12);
    }

    #[test]
    fn a_position_that_is_no_number_leaves_a_hole() {
        let mut queue = filled(16, 3);
        let stored = queue.push(&state(3.0, f64::NAN), AxisSet::XYZ);
        assert_eq!(stored, Stored::NotFinite { axis: Axis::X });
        queue.push(&state(4.0, 40.0), AxisSet::XYZ);
        queue.push(&state(5.0, 50.0), AxisSet::XYZ);
        for ms in [2.5, 3.0, 3.5] {
            assert_eq!(queue.at(instant(ms)), Err(QueueMiss::NotFinite));
        }
        assert!((queue.at(instant(4.5)).unwrap()[Axis::X] - 45.0).abs() < 1e-12);
    }

    #[test]
    fn an_axis_that_the_machine_lacks_may_be_anything() {
        let mut queue = filled(16, 3);
        let mut other = state(3.0, 30.0);
        other.motor[Axis::B] = f64::NAN;
        assert_eq!(queue.push(&other, AxisSet::XYZ), Stored::InOrder);
    }

    #[test]
    fn time_that_goes_back_empties_the_queue() {
        let mut queue = filled(4, 9);
        let stored = queue.push(&state(1.0, -1.0), AxisSet::XYZ);
        assert_eq!(stored, Stored::WentBack { from: instant(8.0) });
        assert_eq!(queue.len(), 1);
        assert!(matches!(
            queue.at(instant(8.0)),
            Err(QueueMiss::AfterNewest { .. })
        ));
        queue.push(&state(2.0, -2.0), AxisSet::XYZ);
        assert!((queue.at(instant(1.5)).unwrap()[Axis::X] + 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_repeated_stamp_changes_nothing_and_an_empty_queue_says_so() {
        let mut queue = filled(4, 2);
        assert_eq!(
            queue.push(&state(1.0, 99.0), AxisSet::XYZ),
            Stored::Repeated
        );
        assert!((queue.at(instant(1.0)).unwrap()[Axis::X] - 10.0).abs() < 1e-12);
        let empty = CoordinateQueue::new(4, Span::from_nanos(1));
        assert_eq!(empty.at(instant(0.0)), Err(QueueMiss::Empty));
    }
}
