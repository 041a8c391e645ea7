//! Leaps of the log times of a bag: gaps in which nothing was recorded, and steps back.
//!
//! A clock that was set, a message with a wrong time, or two recordings in one bag leap. A replay does not run its timers
//! through a leap, so that its cost depends on the messages and not on their times.

use std::collections::BTreeSet;
use std::fmt;

use metrology::epoch::{self, END_NANOS, utc_of_nanos};
use metrology::stamp::{Host, NANOS_PER_S, Span, Stamp};
use recorder::{Bag, Event, Order};
use serde::Serialize;

use crate::pause::{TOLD, duration};

/// A longer time between two messages is a leap: a player announces the same pauses.
pub const LEAST: Span = TOLD;
const LEAST_NANOS: u64 = LEAST.nanos().unsigned_abs();

/// Two successive log times that are far apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Leap {
    /// Log time before the leap, ns.
    pub from_nanos: u64,
    /// Log time after the leap, ns.
    pub to_nanos: u64,
}

/// The leaps of a bag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Leaps {
    /// How many leaps there are.
    pub count: u64,
    /// The longest of them.
    pub longest: Option<Leap>,
}

impl Leap {
    const fn length_nanos(self) -> u64 {
        self.from_nanos.abs_diff(self.to_nanos)
    }
}

impl fmt::Display for Leap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let way = if self.to_nanos < self.from_nanos {
            " back"
        } else {
            ""
        };
        let length = duration(self.length_nanos() as f64 / NANOS_PER_S as f64);
        let [from, to] = [self.from_nanos, self.to_nanos].map(|nanos| utc_of_nanos(nanos, 3));
        write!(f, "{length}{way}, from {from} to {to}")
    }
}

impl Leaps {
    /// Counts the step between two successive log times where it is a leap.
    pub fn pass(&mut self, from_nanos: u64, to_nanos: u64) {
        let leap = Leap {
            from_nanos,
            to_nanos,
        };
        if leap.length_nanos() <= LEAST_NANOS {
            return;
        }
        self.count += 1;
        let is_longest = |known: Leap| leap.length_nanos() > known.length_nanos();
        if self.longest.is_none_or(is_longest) {
            self.longest = Some(leap);
        }
    }

    /// Whether no leap was counted.
    #[must_use]
    pub const fn is_none(&self) -> bool {
        self.count == 0
    }

    /// One line of text: how many leaps, and the longest; `None` when there are none.
    #[must_use]
    pub fn line(&self) -> Option<String> {
        let longest = self.longest?;
        let count = match self.count {
            1 => "1 leap".to_owned(),
            n => format!("{n} leaps"),
        };
        let least = duration(LEAST.as_secs_f64());
        Some(format!(
            "log times: {count} of more than {least}; the longest is {longest}"
        ))
    }
}

/// Numbers, from 0, of the messages whose log time alone is wrong: it leaps forward and the next message is back before the
/// leap, the bag ends there, it leaps back, or no clock of Abbe shows it. Numbers count in `order`.
#[must_use]
pub fn strays(bag: &Bag, order: Order, start: Stamp<Host>) -> BTreeSet<u64> {
    let mut messages = bag.messages(order);
    let times = std::iter::from_fn(|| {
        loop {
            match messages.next_event()? {
                Event::Message(message) => break Some(message.log_time_nanos),
                Event::Loss(_) => {}
            }
        }
    });
    strays_of(times, u64::try_from(start.nanos()).unwrap_or(0))
}

/// The same, from the log times in the order of the file.
pub(crate) fn strays_of(times: impl Iterator<Item = u64>, start_nanos: u64) -> BTreeSet<u64> {
    let mut strays = BTreeSet::new();
    let mut last = start_nanos;
    let mut leaped: Option<(u64, u64)> = None;
    for (number, at) in (0_u64..).zip(times) {
        if let Some((place, to)) = leaped.take() {
            if at.saturating_add(LEAST_NANOS) < to {
                strays.insert(place);
            } else {
                last = to;
            }
        }
        let is_back = at.saturating_add(LEAST_NANOS) < last;
        if is_back || at >= END_NANOS.unsigned_abs() {
            strays.insert(number);
        } else if at > last.saturating_add(LEAST_NANOS) {
            leaped = Some((number, at));
        } else {
            last = last.max(at);
        }
    }
    strays.extend(leaped.map(|(place, _)| place));
    strays
}

/// Whether a run can begin at this time, ns since 1970.
#[must_use]
pub fn is_start(start_nanos: u64) -> bool {
    i64::try_from(start_nanos).is_ok_and(|nanos| epoch::holds(Stamp::<Host>::from_nanos(nanos)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;
    const HOUR: u64 = 3_600 * S;
    const DAY: u64 = 24 * HOUR;

    #[test]
    fn a_leap_is_longer_than_an_hour_and_the_longest_is_named() {
        for (from, to, line) in [
            (0, 0, None),
            (5 * S, 5 * S + HOUR, None),
            (5 * S + HOUR, 5 * S, None),
            (
                0,
                HOUR + 1,
                Some(
                    "1 leap of more than 60 min; the longest is 60 min, from 1970-01-01 00:00:00.000 UTC to 1970-01-01 01:00:00.000 UTC",
                ),
            ),
            (
                0,
                DAY,
                Some(
                    "the longest is 24.0 h, from 1970-01-01 00:00:00.000 UTC to 1970-01-02 00:00:00.000 UTC",
                ),
            ),
            (
                DAY,
                0,
                Some(
                    "the longest is 24.0 h back, from 1970-01-02 00:00:00.000 UTC to 1970-01-01 00:00:00.000 UTC",
                ),
            ),
            (
                1_700_003_585 * S,
                1_700_020_000 * S,
                Some("from 2023-11-14 23:13:05.000 UTC to 2023-11-15 03:46:40.000 UTC"),
            ),
            (0, u64::MAX, Some("the longest is 584.5 years")),
        ] {
            let mut leaps = Leaps::default();
            leaps.pass(from, to);
            match line {
                None => assert!(leaps.is_none() && leaps.line().is_none(), "{from} {to}"),
                Some(words) => {
                    let line = leaps.line().unwrap();
                    assert!(line.contains(words), "{words}: {line}");
                }
            }
        }
        let mut leaps = Leaps::default();
        leaps.pass(0, DAY);
        leaps.pass(DAY, 3 * DAY);
        leaps.pass(3 * DAY, 4 * DAY);
        let line = leaps.line().unwrap();
        assert!(
            line.contains("3 leaps") && line.contains("2.0 days"),
            "{line}"
        );
    }

    #[test]
    fn a_message_whose_time_alone_leaps_is_a_stray_and_a_clock_that_leaps_is_none() {
        let start = 1_700_000_000 * S;
        let at = |offsets: &[u64]| offsets.iter().map(|o| start + o).collect::<Vec<_>>();
        for (name, times, wanted) in [
            ("steady", at(&[0, S, 2 * S]), vec![]),
            ("one ahead", at(&[0, DAY, 2 * S]), vec![1]),
            (
                "one at the end of time",
                vec![start, u64::MAX, start + S],
                vec![1],
            ),
            ("the last one", at(&[0, S, 400 * DAY]), vec![2]),
            ("the clock", at(&[0, S, DAY, DAY + S]), vec![]),
            (
                "two clocks",
                at(&[0, DAY, DAY + S, 9 * DAY, 9 * DAY + S]),
                vec![],
            ),
            ("the first one", at(&[DAY, 0, S]), vec![0]),
            ("all behind the start", at(&[DAY, DAY + S]), vec![]),
            ("back", at(&[DAY, DAY + S, 0]), vec![2]),
            ("two of them", at(&[0, DAY, S, 2 * DAY, 2 * S]), vec![1, 3]),
            ("all at the end of time", vec![u64::MAX; 3], vec![0, 1, 2]),
        ] {
            let found: Vec<u64> = strays_of(times.into_iter(), start).into_iter().collect();
            assert_eq!(found, wanted, "{name}");
        }
    }

    #[test]
    fn a_run_begins_within_the_years_of_the_wire() {
        for (nanos, holds) in [
            (0, true),
            (1_700_000_000 * S, true),
            (END_NANOS.unsigned_abs() - 1, true),
            (END_NANOS.unsigned_abs(), false),
            (i64::MAX.unsigned_abs(), false),
            (u64::MAX, false),
        ] {
            assert_eq!(is_start(nanos), holds, "{nanos}");
        }
    }
}
