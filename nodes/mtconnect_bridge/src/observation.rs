//! What a machine told, whichever way it came.
//!
//! ```text
//!   t_machine = t_sent                              stamp with a date                       (1)
//!   t_machine = t_host(first) + (r - r(first))      r: milliseconds since the adapter began (2)
//!   t_machine = t_host                              no stamp                                (3)
//! ```
//!
//! # References
//! \[1\] MTConnect information model, version 2.4, ObservationInformationModel (`UNAVAILABLE`, levels of a
//! condition), and there Representations/TimeSeries: the stamp is that of the last value.

use chrono::{DateTime, NaiveDateTime};
use metrology::stamp::{Host, Machine, Span, Stamp};

/// The word for a value that the machine cannot tell.
pub const UNAVAILABLE: &str = "UNAVAILABLE";

/// When something was, by the machine's word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MachineTime {
    /// A stamp with a date.
    Absolute(Stamp<Machine>),
    /// Milliseconds since an instant that only the adapter knows.
    Relative(f64),
    /// The machine gave none.
    Absent,
}

/// Level of a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlarmLevel {
    /// As it should be.
    Normal,
    /// It may become a fault; the machine goes on.
    Warning,
    /// A person has to act.
    Fault,
    /// It is not known.
    Unavailable,
}

impl AlarmLevel {
    /// The level in the machine's words, in either case of letters.
    #[must_use]
    pub fn read(word: &str) -> Option<Self> {
        let is = |level: &str| word.eq_ignore_ascii_case(level);
        match () {
            () if is("NORMAL") => Some(Self::Normal),
            () if is("WARNING") => Some(Self::Warning),
            () if is("FAULT") => Some(Self::Fault),
            () if is(UNAVAILABLE) => Some(Self::Unavailable),
            () => None,
        }
    }
}

/// A condition as the machine reports it.
#[derive(Clone, Debug, PartialEq)]
pub struct AlarmReport {
    /// Level.
    pub level: AlarmLevel,
    /// The machine's code of it; empty: none.
    pub code: String,
    /// The machine's own grade of it; empty: none.
    pub severity: String,
    /// `HIGH`, `LOW` or empty.
    pub qualifier: String,
    /// The machine's words.
    pub text: String,
}

/// What was told.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// That it cannot be told.
    Unavailable,
    /// A value, as text.
    Value(String),
    /// Values at a fixed rate, the last at the stamp; `None`: the rate of the data item, which is not told.
    Series {
        /// Rate, 1/s.
        rate_hz: Option<f64>,
        /// The values in order.
        values: Vec<f64>,
    },
    /// A condition.
    Alarm(AlarmReport),
}

/// One observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// When, by the machine.
    pub time: MachineTime,
    /// Key in a line, or `dataItemId` in a document.
    pub key: String,
    /// Second name, where there is one.
    pub name: Option<String>,
    /// What.
    pub told: Told,
}

/// Puts the machine's times on one clock, by (1) to (3).
#[derive(Clone, Copy, Debug, Default)]
pub struct MachineClock {
    origin: Option<(Stamp<Host>, f64)>,
}

impl MachineClock {
    /// The stamp of something that was told at `time` and came at `received_at`.
    pub fn stamp(&mut self, time: MachineTime, received_at: Stamp<Host>) -> Stamp<Machine> {
        match time {
            MachineTime::Absolute(stamp) => stamp,
            MachineTime::Absent => Stamp::from_nanos(received_at.nanos()),
            MachineTime::Relative(at_ms) => {
                let origin = *self.origin.get_or_insert((received_at, at_ms));
                let since = Span::from_secs_f64((at_ms - origin.1) * 1e-3);
                Stamp::from_nanos((origin.0 + since).nanos().max(0))
            }
        }
    }

    /// The adapter may have begun anew.
    pub fn forget(&mut self) {
        self.origin = None;
    }
}

/// Reads a stamp: `2016-11-29T09:28:49.444Z`, with another offset, or without any (then UTC).
///
/// Stamps before 1970 or from 2038 on have no place in a message and are none.
#[must_use]
pub fn read_stamp(text: &str) -> Option<Stamp<Machine>> {
    let instant = match DateTime::parse_from_rfc3339(text) {
        Ok(instant) => instant.to_utc(),
        Err(_) => NaiveDateTime::parse_from_str(text, "%Y-%m-%dT%H:%M:%S%.f")
            .ok()?
            .and_utc(),
    };
    let fits = (0..i64::from(i32::MAX)).contains(&instant.timestamp());
    let nanos = instant.timestamp_nanos_opt().filter(|_| fits)?;
    Some(Stamp::from_nanos(nanos))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nanos(text: &str) -> Option<i64> {
        read_stamp(text).map(Stamp::nanos)
    }

    /// Seconds by `date -u -d 2016-11-29T09:28:49 +%s`.
    #[test]
    fn val_eq1_stamps_are_those_of_the_calendar() {
        assert_eq!(
            nanos("2016-11-29T09:28:49.444Z"),
            Some(1_480_411_729_444_000_000)
        );
        assert_eq!(
            nanos("2016-11-29T09:28:49"),
            Some(1_480_411_729_000_000_000)
        );
        assert_eq!(
            nanos("2016-11-29T10:28:49.5+01:00"),
            Some(1_480_411_729_500_000_000)
        );
    }

    #[test]
    fn what_is_no_stamp_or_fits_no_message_is_none() {
        for text in [
            "",
            "09:28:49",
            "2016-13-29T09:28:49Z",
            "1969-12-31T23:59:59Z",
            "2038-01-19T03:14:08Z",
            "9999999-01-01T00:00:00Z",
        ] {
            assert_eq!(nanos(text), None, "{text}");
        }
    }

    #[test]
    fn eq2_relative_stamps_count_from_the_first() {
        let mut clock = MachineClock::default();
        let host = |s: i64| Stamp::<Host>::from_nanos(s * 1_000_000_000);
        let first = clock.stamp(MachineTime::Relative(250.0), host(100));
        let later = clock.stamp(MachineTime::Relative(1750.0), host(120));
        assert_eq!(first.nanos(), 100_000_000_000);
        assert_eq!((later - first).nanos(), 1_500_000_000);
        clock.forget();
        let anew = clock.stamp(MachineTime::Relative(0.0), host(130));
        assert_eq!(anew.nanos(), 130_000_000_000);
    }
}
