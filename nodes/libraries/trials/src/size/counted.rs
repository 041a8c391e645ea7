//! Which readings a test is made of: those that an evaluation looks at.
//!
//! | test | counted |
//! |---|---|
//! | circle | the command is on it at its feed |
//! | straight line in motion | the axes are at its feed, [`HOLDS_FEED_S`] after they came to it |
//! | stops | the axes stand, [`SETTLES_S`] after they came to rest |
//! | any other over a plate | everything |
//!
//! While an axis runs in, an effect of the drive may be ten times what it is at the feed, and no evaluation looks there.

use metrology::PerAxis;
use metrology::sample::{AxisState, TestKind, TestSegment};
use metrology::stamp::{Host, Stamp};
use nalgebra::Vector3;

use crate::measurement::plane_axes;

/// Least time between two states, s.
const LEAST_PERIOD_S: f64 = 1e-4;
/// An axis that moved by less than this since the reading before stands, mm.
const STANDS_MM: f64 = 1e-6;
/// How long it stands before its position counts, s.
const SETTLES_S: f64 = 0.3;
/// How long a line is run at its feed before it counts, s.
const HOLDS_FEED_S: f64 = 0.05;
/// The command is on the circle when it is this close to it, mm.
const ON_CIRCLE_MM: f64 = 2e-3;
/// Share of the feed below which it is still running in.
const AT_FEED: f64 = 0.98;

/// Where the command is, and what it runs.
#[derive(Clone, Debug, Default)]
pub(super) struct Counted {
    segment: Option<TestSegment>,
    commanded: PerAxis<f64>,
    commanded_at: Stamp<Host>,
    velocity_mm_s: Vector3<f64>,
    stands_since: Option<Stamp<Host>>,
    at_feed_since: Option<Stamp<Host>>,
}

impl Counted {
    pub(super) fn begin(&mut self, segment: &TestSegment) {
        let is_test = segment.begin && segment.kind != TestKind::Production;
        self.segment = is_test.then(|| segment.clone());
        self.at_feed_since = None;
    }

    pub(super) fn stand(&mut self, state: &AxisState) {
        let moved = state.commanded.xyz() - self.commanded.xyz();
        let at = state.received_at;
        self.stands_since = (moved.norm() < STANDS_MM).then(|| self.stands_since.unwrap_or(at));
        let since_s = (at - self.commanded_at).as_secs_f64();
        self.velocity_mm_s = moved / since_s.max(LEAST_PERIOD_S);
        self.commanded_at = at;
        self.commanded = state.commanded;
        let feed_mm_s = self
            .segment
            .as_ref()
            .map_or(0.0, |segment| segment.feed_mm_s);
        let off_mm_s = (self.velocity_mm_s.norm() - feed_mm_s).abs();
        let is_at_feed = off_mm_s < (1.0 - AT_FEED) * feed_mm_s;
        self.at_feed_since = is_at_feed.then(|| self.at_feed_since.unwrap_or(at));
    }

    pub(super) const fn segment(&self) -> Option<&TestSegment> {
        self.segment.as_ref()
    }

    pub(super) fn commanded_mm(&self) -> Vector3<f64> {
        self.commanded.xyz()
    }

    pub(super) const fn velocity_mm_s(&self) -> Vector3<f64> {
        self.velocity_mm_s
    }

    pub(super) const fn stands_since(&self) -> Option<Stamp<Host>> {
        self.stands_since
    }

    /// Whether a reading of the grid encoder counts.
    pub(super) fn has_grid(&self, at: Stamp<Host>) -> bool {
        let Some(segment) = &self.segment else {
            return false;
        };
        match segment.kind {
            TestKind::Circle => self.is_on_circle(segment),
            _ if segment.stations > 0 => self.has_settled(at),
            TestKind::Line | TestKind::Spike => self.is_at_feed(at),
            _ => true,
        }
    }

    /// Whether a reading of the length reference counts.
    pub(super) fn has_length(&self, at: Stamp<Host>) -> bool {
        let is_scan =
            |segment: &TestSegment| segment.kind == TestKind::Line && segment.stations == 0;
        if self.segment.as_ref().is_some_and(is_scan) {
            self.is_at_feed(at)
        } else {
            self.has_settled(at)
        }
    }

    fn has_settled(&self, at: Stamp<Host>) -> bool {
        lasts(self.stands_since, at, SETTLES_S)
    }

    fn is_at_feed(&self, at: Stamp<Host>) -> bool {
        lasts(self.at_feed_since, at, HOLDS_FEED_S)
    }

    fn is_on_circle(&self, segment: &TestSegment) -> bool {
        let [u, v] = plane_axes(segment.plane);
        let from_centre = self.commanded.xyz() - segment.centre_mm;
        let off_mm = from_centre[u].hypot(from_centre[v]) - segment.radius_mm;
        let speed_mm_s = self.velocity_mm_s[u].hypot(self.velocity_mm_s[v]);
        off_mm.abs() <= ON_CIRCLE_MM && speed_mm_s >= AT_FEED * segment.feed_mm_s
    }
}

/// Whether something holds for so long.
fn lasts(since: Option<Stamp<Host>>, at: Stamp<Host>, least_s: f64) -> bool {
    since.is_some_and(|since| (at - since).as_secs_f64() >= least_s)
}

#[cfg(test)]
mod tests {
    use metrology::{Axis, AxisSet};

    use super::*;

    fn at(ms: i64) -> Stamp<Host> {
        Stamp::from_nanos(1_000_000 * ms)
    }

    fn run(counted: &mut Counted, ms: i64, x_mm: f64) {
        let mut commanded = PerAxis::default();
        commanded[Axis::X] = x_mm;
        counted.stand(&AxisState {
            received_at: at(ms),
            controller_at: Stamp::from_nanos(0),
            axes: AxisSet::XYZ,
            commanded,
            motor: commanded,
            scale: PerAxis([f64::NAN; 6]),
            velocity: PerAxis::default(),
        });
    }

    /// A scan at 10 mm/s: 200 ms to come to it at half the feed, 400 ms at it, 400 ms of rest.
    #[test]
    fn a_line_counts_at_its_feed_and_a_stop_once_it_has_settled() {
        let place = |ms: i64| {
            let t = |from: i64, most: i64| (ms - from).clamp(0, most) as f64 * 1e-3;
            5.0 * t(0, 200) + 10.0 * t(200, 400)
        };
        let seen = |kind: TestKind, stations: u32| {
            let mut counted = Counted::default();
            let segment = TestSegment {
                feed_mm_s: 10.0,
                stations,
                ..TestSegment::of_kind(kind, 1, at(0))
            };
            counted.begin(&segment);
            let mut seen = [vec![], vec![]];
            for ms in (0..=1000).step_by(4) {
                run(&mut counted, ms, place(ms));
                let counts = [counted.has_length(at(ms)), counted.has_grid(at(ms))];
                for (seen, counts) in seen.iter_mut().zip(counts) {
                    seen.extend(counts.then_some(ms));
                }
            }
            seen.map(|all: Vec<i64>| (all.first().copied(), all.last().copied()))
        };
        let line = (Some(256), Some(600));
        let stop = (Some(904), Some(1000));
        assert_eq!(seen(TestKind::Line, 0), [line, line]);
        assert_eq!(seen(TestKind::Spike, 0), [stop, line]);
        assert_eq!(seen(TestKind::Positioning, 3), [stop, stop]);
        assert_eq!(seen(TestKind::Spike, 40), [stop, stop]);
    }
}
