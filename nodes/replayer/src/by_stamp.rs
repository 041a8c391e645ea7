//! Messages in the order of what they say, where they came in another.
//!
//! A recorder writes a message when it comes: one topic may come a second after another, and each a little earlier or later.
//! What instruments read belongs to where the axes were when it was read, which the stamps say. So axis states and readings
//! are handed on in the order of their stamps `s`; begins and ends of runs in their own order, none later than it came; and
//! everything else when it came, at the log time `l`:
//!
//! ```text
//!   k = s                          axis states and readings, where |s - l| <= T    (1)
//!   k_j = max(k_(j-1), min(s, l))  begins and ends                                 (2)
//!   k = l                          others, and where |s - l| > T                   (3)
//! ```
//!
//! A message is handed on when none that is still to come can be before it: when one was recorded later than `k + T`.

use std::collections::BTreeMap;

use abbe_msgs::from_cdr;
use abbe_msgs::msg::TestSegment;
use abbe_msgs::topics::{self, Entry};
use recorder::MessageRef;

use crate::reading::stamp_of;
use crate::stamps::{TOLERANCE_NANOS, nanos_of};
use crate::turned::Held;

/// What comes first of one instant: a run begins, the axes are somewhere, there is a reading, the run ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Begin,
    Axes,
    Reading,
    End,
}

/// Messages that wait for earlier ones.
#[derive(Default)]
pub(crate) struct ByStamp {
    /// By (1) to (3); of equal ones by [`Rank`], then as they came.
    held: BTreeMap<(i64, Rank, u64), Held>,
    n_taken: u64,
    /// Of the last begin or end.
    segment_nanos: Option<i64>,
}

impl ByStamp {
    /// Takes a message.
    pub(crate) fn take(&mut self, held: Held) {
        let (key, rank) = self.key(&held.message(), held.entry);
        self.held.insert((key, rank, self.n_taken), held);
        self.n_taken += 1;
    }

    /// The next message that none can be before, where the last one was recorded at this log time.
    pub(crate) fn due(&mut self, log_time_nanos: u64) -> Option<Held> {
        let log = i64::try_from(log_time_nanos).unwrap_or(i64::MAX);
        let first = self.held.first_entry()?;
        (first.key().0 < log.saturating_sub(TOLERANCE_NANOS)).then(|| first.remove())
    }

    /// The next of those that are left.
    pub(crate) fn rest(&mut self) -> Option<Held> {
        self.held.pop_first().map(|(_, held)| held)
    }

    fn key(&mut self, message: &MessageRef<'_>, entry: &Entry) -> (i64, Rank) {
        let log = i64::try_from(message.log_time_nanos).unwrap_or(i64::MAX);
        let stamp = stamp_of(entry.description.type_name, message.data).map(nanos_of);
        let near = stamp.filter(|stamp| {
            stamp.saturating_sub(log).unsigned_abs() <= TOLERANCE_NANOS.unsigned_abs()
        });
        if entry.name == topics::TEST_SEGMENT.name {
            let own = near.map_or(log, |stamp| stamp.min(log));
            let before = self
                .segment_nanos
                .replace(own)
                .filter(|before| *before >= own);
            let key = before.unwrap_or(own);
            self.segment_nanos = Some(key);
            let begins = from_cdr::<TestSegment>(message.data).is_ok_and(|segment| segment.begin);
            // A begin at the instant of the end before it is behind that.
            let is_first = begins && before.is_none();
            return (key, if is_first { Rank::Begin } else { Rank::End });
        }
        let read = [
            topics::LENGTH_POSITION.name,
            topics::GRID_POSITION.name,
            topics::ANGLE_POSITION.name,
        ];
        if entry.name == topics::AXES_STATE.name {
            (near.unwrap_or(log), Rank::Axes)
        } else if read.contains(&entry.name) {
            (near.unwrap_or(log), Rank::Reading)
        } else {
            (log, Rank::Reading)
        }
    }
}
