//! Which run of a simulator is the same test as one of a recording.
//!
//! The k-th run of a test in the recording is matched with the k-th of the same test in the simulator, whatever numbers
//! they have and in whatever order the tests were made. Where the simulator has fewer repeats, its last stands in.

use std::collections::BTreeSet;

use metrology::sample::{Sense, TestKind, TestPlane};
use metrology::{Axis, AxisSet, PerAxis};
use twin::{Channel, Run, Session};

use super::Reason;
use super::places::at;

/// An axis that covers less does not move, mm or rad.
const MOVES: f64 = 1e-2;
/// Axes that stand within it are at one place, mm.
const SAME_PLACE_MM: f64 = 1.0;
/// The same of rotary axes, rad.
const SAME_PLACE_RAD: f64 = 1e-2;
/// Radii within it are one, mm.
const SAME_RADIUS_MM: f64 = 0.05;
/// Feeds within this share of the recording's are one.
const SAME_FEED: f64 = 0.01;

/// The simulator's part of a pair of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pair {
    /// Place in the simulator's session.
    pub run: usize,
    /// Whether the simulator has no repeat of its own for this run.
    pub stands_in: bool,
    /// Axes that move while the run is read.
    pub moving: AxisSet,
}

/// The simulator's run of each of the recording's, or what the nearest one lacks.
pub(super) fn pairs(real: &Session, simulated: &Session) -> Vec<Result<Pair, Reason>> {
    let real: Vec<Test<'_>> = real.runs.iter().map(Test::of).collect();
    let simulated: Vec<Test<'_>> = simulated.runs.iter().map(Test::of).collect();
    let pair = |(index, test): (usize, &Test<'_>)| -> Result<Pair, Reason> {
        let mut same = vec![];
        let mut nearest = Reason::Kind;
        for (place, other) in simulated.iter().enumerate() {
            match test.apart(other) {
                None => same.push(place),
                Some(reason) => nearest = nearest.max(reason),
            }
        }
        let before = real[..index].iter();
        let repeat = before.filter(|one| test.apart(one).is_none()).count();
        let last = same.last().ok_or(nearest)?;
        Ok(Pair {
            run: *same.get(repeat).unwrap_or(last),
            stands_in: repeat >= same.len(),
            moving: test.moving,
        })
    };
    real.iter().enumerate().map(pair).collect()
}

/// Axes of a run that move while it is read.
pub(super) fn moving(run: &Run) -> AxisSet {
    moving_in(run, &extents(run))
}

fn moving_in(run: &Run, extents: &PerAxis<[f64; 2]>) -> AxisSet {
    let moves = |axis: &Axis| extents[*axis][1] - extents[*axis][0] > MOVES;
    run.motion.axes.iter().filter(moves).collect()
}

/// Least and greatest position of each axis over the readings of a run, touches left out; +∞ and -∞ without readings.
fn extents(run: &Run) -> PerAxis<[f64; 2]> {
    let mut all = PerAxis([[f64::INFINITY, f64::NEG_INFINITY]; 6]);
    let along = run.readings.iter();
    for reading in along.filter(|reading| reading.channel != Channel::Touch) {
        for axis in run.motion.axes.iter() {
            let here = at(run, reading, axis);
            let [low, high] = &mut all[axis];
            (*low, *high) = (low.min(here), high.max(here));
        }
    }
    all
}

/// What a run was, as far as another one must be the same.
struct Test<'a> {
    run: &'a Run,
    extents: PerAxis<[f64; 2]>,
    moving: AxisSet,
    channels: BTreeSet<&'a Channel>,
}

impl<'a> Test<'a> {
    fn of(run: &'a Run) -> Self {
        let extents = extents(run);
        Self {
            run,
            moving: moving_in(run, &extents),
            extents,
            channels: run.readings.iter().map(|one| &one.channel).collect(),
        }
    }

    /// What keeps another run from being this test; none where it is.
    fn apart(&self, other: &Test<'_>) -> Option<Reason> {
        let (a, b) = (&self.run.segment, &other.run.segment);
        let lacks = [
            (
                a.kind == b.kind && a.plane == b.plane && self.moving == other.moving,
                Reason::Kind,
            ),
            (self.is_at(other), Reason::Place),
            (same_feed(a.feed_mm_s, b.feed_mm_s), Reason::Feed),
            (
                a.sense == b.sense || a.sense == Sense::None || b.sense == Sense::None,
                Reason::Sense,
            ),
            (!self.channels.is_disjoint(&other.channels), Reason::Channel),
        ];
        let lacks = lacks.into_iter().find(|(is_same, _)| !is_same);
        lacks.map(|(_, reason)| reason)
    }

    fn is_at(&self, other: &Test<'_>) -> bool {
        let (a, b) = (&self.run.segment, &other.run.segment);
        let is_round = matches!(a.kind, TestKind::Circle | TestKind::Arc);
        let same_circle = (a.radius_mm - b.radius_mm).abs() <= SAME_RADIUS_MM
            && (a.centre_mm - b.centre_mm).norm() <= SAME_PLACE_MM;
        let same_stylus = a.stylus == b.stylus || a.stylus.is_empty() || b.stylus.is_empty();
        let is_round = is_round && a.plane != TestPlane::None;
        let mut axes = self.run.motion.axes.iter();
        same_stylus
            && (same_circle || !is_round)
            && axes.all(|axis| meets(axis, self.extents[axis], other.extents[axis]))
    }
}

/// Whether what two runs cover of an axis has a place in common; also where one of them covers nothing.
fn meets(axis: Axis, a: [f64; 2], b: [f64; 2]) -> bool {
    let slack = if axis.is_linear() {
        SAME_PLACE_MM
    } else {
        SAME_PLACE_RAD
    };
    let is_empty = |[low, high]: [f64; 2]| low > high;
    is_empty(a) || is_empty(b) || (a[0] <= b[1] + slack && b[0] <= a[1] + slack)
}

/// Whether two feeds are one; also where one is not stated.
pub(super) fn same_feed(a_mm_s: f64, b_mm_s: f64) -> bool {
    a_mm_s <= 0.0 || b_mm_s <= 0.0 || (a_mm_s - b_mm_s).abs() <= SAME_FEED * a_mm_s
}
