//! What a machine told, whichever way it came.
//!
//! ```text
//!   t_machine = t_sent                              stamp with a date                       (1)
//!   t_machine = t_host(first) + (r - r(first))      r: milliseconds since the adapter began (2)
//!   t_machine = t_host                              no stamp                                (3)
//! ```
//!
//! A counter of milliseconds that leaps by more than a year has begun anew: (2) begins with it.
//!
//! # References
//! \[1\] MTConnect information model, version 2.4, ObservationInformationModel (`UNAVAILABLE`, levels of a
//! condition), and there Representations/TimeSeries: the stamp is that of the last value.

use chrono::{DateTime, NaiveDateTime};
use metrology::epoch;
use metrology::stamp::{Host, Machine, Span, Stamp};

/// Milliseconds that leap by more have been counted anew: a year.
const LONGEST_COUNT: Span = Span::from_nanos(31_557_600_000_000_000);

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

/// How the fields behind a key are read where values come as lines of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One field: a value.
    Value,
    /// Five fields: level, code, severity, qualifier, text.
    Condition,
    /// Two fields: code and text.
    Message,
    /// Three fields: count, rate, values.
    Series,
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
                let (origin, first_ms) = *self.origin.get_or_insert((received_at, at_ms));
                let since = Span::from_secs_f64((at_ms - first_ms) * 1e-3);
                let at = Stamp::from_nanos((origin + since).nanos());
                if since.nanos().saturating_abs() <= LONGEST_COUNT.nanos() && epoch::holds(at) {
                    return at;
                }
                self.origin = Some((received_at, at_ms));
                Stamp::from_nanos(received_at.nanos())
            }
        }
    }

    /// The adapter may have begun anew.
    pub fn forget(&mut self) {
        self.origin = None;
    }
}

/// Reads a stamp: `2016-11-29T09:28:49.444Z`, with another offset (`+01:00`, `+0100`), or without any (then UTC).
///
/// Any number of digits of the second is read, after a point or a comma; a leap second (`:60`) is the second behind it.
/// Stamps before 1970 or from 2106-02-07T06:28:16Z on have no place in a message; they give `None`.
#[must_use]
pub fn read_stamp(text: &str) -> Option<Stamp<Machine>> {
    let text = text.replacen(',', ".", 1);
    let with_offset = || DateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f%z").ok();
    let instant = match DateTime::parse_from_rfc3339(&text)
        .ok()
        .or_else(with_offset)
    {
        Some(instant) => instant.to_utc(),
        None => NaiveDateTime::parse_from_str(&text, "%Y-%m-%dT%H:%M:%S%.f")
            .ok()?
            .and_utc(),
    };
    let stamp = Stamp::from_nanos(instant.timestamp_nanos_opt()?);
    epoch::holds(stamp).then_some(stamp)
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
        for (text, seconds) in [
            ("2016-11-29T10:28:49+0100", 1_480_411_729),
            ("2016-11-29T04:28:49-05:00", 1_480_411_729),
            ("2016-11-29t09:28:49z", 1_480_411_729),
            ("1970-01-01T00:00:00Z", 0),
            ("2038-01-19T03:14:08Z", 2_147_483_648),
            ("2106-02-07T06:28:15Z", 4_294_967_295),
            // A leap second is the one behind it, as POSIX counts.
            ("2016-12-31T23:59:60Z", 1_483_228_800),
            ("2017-01-01T00:59:60+01:00", 1_483_228_800),
        ] {
            assert_eq!(nanos(text), Some(seconds * 1_000_000_000), "{text}");
        }
        let fraction = |digits: &str| nanos(&format!("2016-11-29T09:28:49{digits}Z"));
        for (digits, part) in [
            (".4", 400_000_000),
            (",25", 250_000_000),
            (".123456789", 123_456_789),
            (".123456789123", 123_456_789),
        ] {
            assert_eq!(
                fraction(digits),
                Some(1_480_411_729_000_000_000 + part),
                "{digits}"
            );
        }
    }

    #[test]
    fn what_is_no_stamp_or_fits_no_message_is_none() {
        for text in [
            "",
            "09:28:49",
            "2016-13-29T09:28:49Z",
            "1969-12-31T23:59:59Z",
            "2106-02-07T06:28:16Z",
            "2262-04-11T23:47:17Z",
            "9999-12-31T23:59:59Z",
            "9999999-01-01T00:00:00Z",
            "2016-11-29T25:00:00Z",
            "2016-11-29T09:28:61Z",
            "2016-02-30T09:28:49Z",
            "NaN",
            "1767600000000",
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
        // Milliseconds since 1970 are counted from the first as well, and a leap of years begins anew.
        let leapt = clock.stamp(MachineTime::Relative(1.7676e12), host(140));
        assert_eq!(leapt.nanos(), 140_000_000_000);
        let on = clock.stamp(MachineTime::Relative(1.7676e12 + 1500.0), host(150));
        assert_eq!(on.nanos(), 141_500_000_000);
    }
}
