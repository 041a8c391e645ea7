//! Instants since 1970 as files and messages have them: their range, and the unit that a wrong one was written in.
//!
//! The range is that of the wire, where seconds are the bits of an unsigned 32-bit number: 1970-01-01T00:00:00Z to
//! 2106-02-07T06:28:15.999999999Z. Every place at which a time comes in asks here.

use crate::number::number;
use crate::stamp::{Clock, NANOS_PER_S, Stamp};

/// First second that no message can carry: 2106-02-07T06:28:16Z.
pub const END_S: i64 = 1 << 32;
/// The same in nanoseconds.
pub const END_NANOS: i64 = END_S * NANOS_PER_S;

/// Begin of the years in which a time in another unit is looked for, s: 1990-01-01.
const LIKELY_FROM_S: f64 = 631_152_000.0;

/// An instant as a date and a time of the day in UTC, whole seconds: `2026-01-05 08:15:00 UTC`.
#[must_use]
pub fn utc<C: Clock>(at: Stamp<C>) -> String {
    utc_of_nanos(at.nanos(), 0)
}

/// An instant in ns since 1970 as a date and a time of the day in UTC with so many decimals of the second, nine at most:
/// `2026-01-05 08:15:00.250 UTC`. What lies behind the last decimal is left out.
///
/// Days become dates by the eras of 400 years of the Gregorian calendar, counted from 1 March so that the leap day is the last.
#[must_use]
pub fn utc_of_nanos(nanos: impl Into<i128>, decimals: usize) -> String {
    let (nanos, per_s) = (nanos.into(), i128::from(NANOS_PER_S));
    let bound = i128::from(i64::MAX);
    let seconds = nanos.div_euclid(per_s).clamp(-bound / 2, bound / 2) as i64;
    let fraction = format!("{:09}", nanos.rem_euclid(per_s));
    let fraction = match fraction.get(..decimals) {
        None | Some("") => String::new(),
        Some(digits) => format!(".{digits}"),
    };
    let (days, of_day) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    // 719 468 days lie between 0000-03-01 and 1970-01-01; an era has 146 097.
    let since = days + 719_468;
    let (era, day) = (since.div_euclid(146_097), since.rem_euclid(146_097));
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    // Months from March on have 153 days in five.
    let from_march = (5 * of_year + 2) / 153;
    let date = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 {
        from_march + 3
    } else {
        from_march - 9
    };
    let year = year + 400 * era + i64::from(month <= 2);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year:04}-{month:02}-{date:02} {hour:02}:{minute:02}:{second:02}{fraction} UTC")
}

/// A number of seconds with every digit of a whole one, as it stands in the file.
fn written(value: f64) -> String {
    if value.fract().abs() > 0.0 || value.abs() >= 1e19 {
        return number(value);
    }
    format!("{value:.0}")
}

/// A number that is no time between 1970 and 2106.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{value}: must be from {least} to {greatest} s since 1970 (to {end}){}", remedy(*value, *greatest), value = written(*value))]
pub struct NoEpochTime {
    /// What was written.
    pub value: f64,
    /// Least value that is allowed, s.
    pub least: i64,
    /// Greatest value that is allowed, s.
    pub greatest: i64,
    /// The greatest value in words, for the message: "2106-02-07", or what it is less by.
    pub end: &'static str,
}

/// The unit that a number which is no time in seconds since 1970 is likely to be in, with how many make a second.
#[must_use]
pub fn likely_unit(value: f64) -> Option<(&'static str, f64)> {
    let units = [
        ("milliseconds", 1e3),
        ("microseconds", 1e6),
        ("nanoseconds", 1e9),
    ];
    let fits = |scale: f64| (LIKELY_FROM_S..END_S as f64).contains(&(value / scale));
    units.into_iter().find(|(_, scale)| fits(*scale))
}

fn remedy(value: f64, greatest: i64) -> String {
    match likely_unit(value) {
        // What is proposed must be taken.
        Some((unit, scale)) if (value / scale).floor() <= greatest as f64 => {
            let seconds_s = (value / scale).floor();
            format!("; it looks like {unit}: write {seconds_s}")
        }
        _ => String::new(),
    }
}

/// Whether an instant has a place in a message.
#[must_use]
pub const fn holds<C: Clock>(stamp: Stamp<C>) -> bool {
    0 <= stamp.nanos() && stamp.nanos() < END_NANOS
}

/// The instant `seconds_s` after 1970, from which `room_s` more must fit before the range ends.
///
/// # Errors
/// When it is not in the range, with value, range and the unit that it looks like.
pub fn whole_seconds<C: Clock>(seconds_s: i64, room_s: i64) -> Result<Stamp<C>, NoEpochTime> {
    let greatest = END_S.saturating_sub(room_s.max(0)).saturating_sub(1);
    if (0..=greatest).contains(&seconds_s) {
        return Ok(Stamp::from_nanos(seconds_s * NANOS_PER_S));
    }
    Err(NoEpochTime {
        value: seconds_s as f64,
        least: 0,
        greatest,
        end: if room_s > 0 {
            "2106, less what follows"
        } else {
            "2106-02-07"
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Host;

    fn said(seconds_s: i64) -> String {
        whole_seconds::<Host>(seconds_s, 0).unwrap_err().to_string()
    }

    /// Dates by `date -u -d @951782400`.
    #[test]
    fn val_instants_are_dates_of_utc() {
        for (seconds_s, wanted) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (-1, "1969-12-31 23:59:59 UTC"),
            (68_169_600, "1972-02-29 00:00:00 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (951_868_800, "2000-03-01 00:00:00 UTC"),
            (1_767_600_000, "2026-01-05 08:00:00 UTC"),
            (4_107_542_399, "2100-02-28 23:59:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
            (4_294_967_295, "2106-02-07 06:28:15 UTC"),
        ] {
            let at = Stamp::<Host>::from_nanos(seconds_s * NANOS_PER_S);
            assert_eq!(utc(at), wanted);
        }
        // Parts of a second are left out, and no instant of 64 bits overflows.
        assert_eq!(
            utc(Stamp::<Host>::from_nanos(999_999_999)),
            "1970-01-01 00:00:00 UTC"
        );
        assert_eq!(
            utc(Stamp::<Host>::from_nanos(i64::MAX)),
            "2262-04-11 23:47:16 UTC"
        );
        assert_eq!(
            utc(Stamp::<Host>::from_nanos(i64::MIN)),
            "1677-09-21 00:12:43 UTC"
        );
    }

    /// Dates by `date -u -d @1700003585.25` and, of the last log time that a bag can hold, `date -u -d @18446744073`.
    #[test]
    fn val_decimals_of_a_second_are_as_many_as_wanted() {
        for (nanos, decimals, wanted) in [
            (
                1_700_003_585_250_000_000_u64,
                3,
                "2023-11-14 23:13:05.250 UTC",
            ),
            (1_700_003_585_250_999_999, 3, "2023-11-14 23:13:05.250 UTC"),
            (
                1_700_003_585_000_000_007,
                9,
                "2023-11-14 23:13:05.000000007 UTC",
            ),
            (1_700_003_585_250_000_000, 0, "2023-11-14 23:13:05 UTC"),
            (0, 3, "1970-01-01 00:00:00.000 UTC"),
            (u64::MAX, 0, "2554-07-21 23:34:33 UTC"),
        ] {
            assert_eq!(utc_of_nanos(nanos, decimals), wanted);
        }
        assert_eq!(utc_of_nanos(-250_000_000, 3), "1969-12-31 23:59:59.750 UTC");
        for extreme in [i128::MAX, i128::MIN] {
            assert!(utc_of_nanos(extreme, 3).ends_with(" UTC"));
        }
    }

    /// Dates by `date -u -d @4294967295`.
    #[test]
    fn val_the_range_ends_where_unsigned_seconds_do() {
        for seconds_s in [0, 1_767_600_000, 2_147_483_648, 4_294_967_295] {
            let stamp = whole_seconds::<Host>(seconds_s, 0).unwrap();
            assert_eq!(stamp.nanos(), seconds_s * NANOS_PER_S);
            assert!(holds(stamp));
        }
        assert!(!holds(Stamp::<Host>::from_nanos(-1)));
        assert!(!holds(Stamp::<Host>::from_nanos(END_NANOS)));
        assert!(whole_seconds::<Host>(4_294_967_290, 10).is_err());
    }

    #[test]
    fn a_time_in_another_unit_is_refused_with_the_unit_and_the_remedy() {
        let range = "must be from 0 to 4294967295 s since 1970 (to 2106-02-07)";
        for (seconds_s, remedy) in [
            (
                1_767_600_000_123,
                "; it looks like milliseconds: write 1767600000",
            ),
            (
                1_767_600_000_000_000,
                "; it looks like microseconds: write 1767600000",
            ),
            (
                1_767_600_000_000_000_000,
                "; it looks like nanoseconds: write 1767600000",
            ),
            (-1, ""),
            (END_S, ""),
            (i64::MIN, ""),
        ] {
            assert_eq!(
                said(seconds_s),
                format!("{}: {range}{remedy}", written(seconds_s as f64))
            );
        }
    }
}
