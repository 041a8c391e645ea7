//! Axis states and readings in the order in which they were made, where they were recorded in another.
//!
//! A recorder writes a message when it comes, each a little earlier or later. What an instrument read belongs to where the axes
//! were when it was read, and the stamps of a topic say in which order and how far apart its messages were made. They do not
//! say it on the recorder's clock: clocks of hosts differ. So the least lateness of a topic is taken for the distance of its
//! clock, and only what a message was later than that is taken away. With stamp `s` and log time `l`:
//!
//! ```text
//!   o = max(s - l)        of a topic                                        (1)
//!   k = s - o             axis states and readings: never later than l      (2)
//!   k = l                 all others, and topics whose s - l differ by more than T  (3)
//!   k = s - o(axes)       begins and ends of runs, where they are asked for by stamp, and then also
//!                         readings whose o is at most T from o(axes)           (4)
//! ```
//!
//! A message is handed on when none that is still to come can be before it: when one was recorded later than `k + T`, with (4)
//! later than `k + T` and the greatest lateness of a begin or end.
//!
//! # Holds when
//! One message of a topic came as fast as those of the others: a topic that was late throughout stays so much behind. By (4) it does
//! not, but where the clocks of hosts differ (4) moves it: who reads by (4) has to see which of both gives more.

use std::collections::BTreeMap;

use abbe_msgs::from_cdr;
use abbe_msgs::msg::TestSegment;
use abbe_msgs::topics::{self, Entry};
use recorder::MessageRef;

use crate::reading::stamp_of;
use crate::stamps::{TOLERANCE_NANOS, nanos_of};
use crate::turned::Held;

/// Begins, ends and readings whose stamps are farther from those of the axis states than this by their log times were late, ns.
const LATE_NANOS: i64 = 250_000_000;
/// Most messages that wait: of one instant there may be a whole bag.
const MOST_HELD: usize = 1_000_000;

/// Topics of instruments.
pub(crate) const READINGS: [&str; 3] = [
    topics::LENGTH_POSITION.name,
    topics::GRID_POSITION.name,
    topics::ANGLE_POSITION.name,
];

/// What comes first of one instant: a run begins, the axes are somewhere, then all else as it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Begin,
    Axes,
    Other,
}

/// Messages that wait for earlier ones.
pub(crate) struct ByStamp {
    /// (1) by topic, ns; none of topics that are read by log time.
    offsets_nanos: BTreeMap<usize, i64>,
    /// By (2) and (3), of equal ones by [`Rank`], then as they came.
    held: BTreeMap<(i64, Rank, u64), Held>,
    n_taken: u64,
    /// Of the last begin or end.
    segment_nanos: Option<i64>,
    /// o of (4); none: begins and ends are read by log time.
    segments_by_nanos: Option<i64>,
    /// Topics of readings by (4).
    by_axes: Vec<usize>,
    /// How much later than k a message may have been recorded, ns.
    wait_nanos: i64,
}

/// How the stamps of begins, ends and readings lie to those of the axis states.
#[derive(Clone, Debug)]
pub(crate) struct AxesClock {
    /// o of (4), ns.
    axes_nanos: i64,
    /// Whether begins and ends are off by more than they may.
    pub(crate) are_segments_off: bool,
    /// Topics of readings that are off by more than they may, and by T at most.
    readings: Vec<usize>,
    /// The greatest lateness of all of these, ns.
    late_nanos: i64,
}

impl AxesClock {
    /// Whether readings are off by more than they may.
    pub(crate) fn are_readings_off(&self) -> bool {
        !self.readings.is_empty()
    }

    /// Of the topics with these numbers; `None`: all agree, or axes or segments have no clock.
    pub(crate) fn of(
        offsets_nanos: &BTreeMap<usize, (i64, i64)>,
        (axes, segments): (usize, usize),
        readings: &[usize],
    ) -> Option<Self> {
        let (_, axes_nanos) = *offsets_nanos.get(&axes)?;
        let (least, greatest) = *offsets_nanos.get(&segments)?;
        let off = |nanos: i64| nanos.saturating_sub(axes_nanos);
        let is_late = |nanos: i64| off(nanos).saturating_abs() > LATE_NANOS;
        let is_off = |topic: &usize| {
            let greatest = offsets_nanos.get(topic).map(|(_, greatest)| *greatest);
            greatest.is_some_and(|it| is_late(it) && off(it).saturating_abs() <= TOLERANCE_NANOS)
        };
        let readings: Vec<usize> = readings.iter().copied().filter(is_off).collect();
        let of_readings = readings.iter().filter_map(|topic| offsets_nanos.get(topic));
        let leasts = of_readings.map(|(least, _)| *least).chain([least]);
        let late_nanos = leasts.map(|it| off(it).saturating_neg()).max().unwrap_or(0);
        let are_segments_off = is_late(least) || is_late(greatest);
        (are_segments_off || !readings.is_empty()).then_some(Self {
            axes_nanos,
            are_segments_off,
            readings,
            late_nanos: late_nanos.max(0),
        })
    }
}

impl ByStamp {
    /// With least and greatest `s - l` of each topic, ns.
    pub(crate) fn new(offsets_nanos: &BTreeMap<usize, (i64, i64)>) -> Self {
        let steady = offsets_nanos
            .iter()
            .filter_map(|(topic, (least, greatest))| {
                (greatest.saturating_sub(*least) <= TOLERANCE_NANOS).then_some((*topic, *greatest))
            });
        Self {
            offsets_nanos: steady.collect(),
            held: BTreeMap::new(),
            n_taken: 0,
            segment_nanos: None,
            segments_by_nanos: None,
            by_axes: Vec::new(),
            wait_nanos: TOLERANCE_NANOS,
        }
    }

    /// With begins, ends and readings by (4).
    pub(crate) fn by_axes(mut self, clock: AxesClock) -> Self {
        self.segments_by_nanos = Some(clock.axes_nanos);
        for topic in &clock.readings {
            if let Some(offset) = self.offsets_nanos.get_mut(topic) {
                *offset = clock.axes_nanos;
            }
        }
        self.by_axes = clock.readings;
        self.wait_nanos = TOLERANCE_NANOS.saturating_add(clock.late_nanos);
        self
    }

    /// Takes a message.
    pub(crate) fn take(&mut self, held: Held) {
        let (key, rank) = self.key(&held.message(), held.entry);
        self.held.insert((key, rank, self.n_taken), held);
        self.n_taken += 1;
    }

    /// The next message that none can be before, where the last one was recorded at this log time.
    pub(crate) fn due(&mut self, log_time_nanos: u64) -> Option<Held> {
        let log = i64::try_from(log_time_nanos).unwrap_or(i64::MAX);
        let is_full = self.held.len() > MOST_HELD;
        let first = self.held.first_entry()?;
        let is_due = first.key().0 < log.saturating_sub(self.wait_nanos);
        (is_due || is_full).then(|| first.remove())
    }

    /// The next of those that are left.
    pub(crate) fn rest(&mut self) -> Option<Held> {
        self.held.pop_first().map(|(_, held)| held)
    }

    fn key(&mut self, message: &MessageRef<'_>, entry: &Entry) -> (i64, Rank) {
        let log = i64::try_from(message.log_time_nanos).unwrap_or(i64::MAX);
        if entry.name == topics::TEST_SEGMENT.name {
            let stamp = || stamp_of(entry.description.type_name, message.data).map(nanos_of);
            let by_stamp = self.segments_by_nanos.zip(stamp());
            let log = by_stamp.map_or(log, |(offset, stamp)| stamp.saturating_sub(offset));
            let follows = self.segment_nanos.replace(log) == Some(log);
            let begins = from_cdr::<TestSegment>(message.data).is_ok_and(|segment| segment.begin);
            // A begin at the instant of the end before it is behind that.
            let is_first = begins && !follows;
            return (log, if is_first { Rank::Begin } else { Rank::Other });
        }
        let made = || {
            let offset = self.offsets_nanos.get(&message.topic.index())?;
            let stamp = stamp_of(entry.description.type_name, message.data).map(nanos_of)?;
            let late = log.saturating_sub(stamp.saturating_sub(*offset));
            // The few soonest of (1) come when they came.
            let is_by_axes = self.by_axes.contains(&message.topic.index());
            let away = if is_by_axes { late } else { late.max(0) };
            (late <= self.wait_nanos).then(|| log.saturating_sub(away))
        };
        if entry.name == topics::AXES_STATE.name {
            (made().unwrap_or(log), Rank::Axes)
        } else if READINGS.contains(&entry.name) {
            (made().unwrap_or(log), Rank::Other)
        } else {
            (log, Rank::Other)
        }
    }
}
