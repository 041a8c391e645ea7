//! Times as loggers write them, and whether a column of times can be one of seconds.
//!
//! A cell is a number of seconds (or of the unit that the map states), a time of the day (`08:15:00`), or a date with a
//! time: ISO 8601 with or without offset (then UTC), the same with a blank for the `T`, `05.01.2026 08:15:00` with the day
//! first, and `01/25/2026 08:15 PM` where one of both numbers can be no month. A logger's milliseconds are the commonest mistake, and as seconds they are a log that goes on for months with
//! hours between its rows.

use anyhow::{Context as _, Result, bail};
use metrology::number::number;
use metrology::yaml::shown;
use mtconnect_bridge::observation::read_stamp;

use super::stated;
use super::units::{Kind, Unit};

/// Longest log or session, s: a leap year.
pub const LONGEST_LOG_S: f64 = 366.0 * 86_400.0;
/// Greatest spacing of most of the rows, s: slower, no warm-up is seen.
const SPACING_S: f64 = 6.0 * 3600.0;
/// Least spacing of most of the rows, s: no thermometer or dial is read faster, and rows so close look like another unit.
const LEAST_SPACING_S: f64 = 0.005;
/// Spacings and lengths of most logs of a machine's drift, s: rows every half second to ten minutes, for a quarter of an hour to
/// two weeks.
const USUAL_SPACING_S: [f64; 2] = [0.5, 600.0];
const USUAL_LENGTH_S: [f64; 2] = [900.0, 14.0 * 86_400.0];
const DAY_S: f64 = 86_400.0;
/// A number beyond it counts from 1970 and shows its unit by itself.
const EPOCH_S: f64 = 6e8;
/// The units in which rows are looked for: how many make a second, and what they are called.
const TIME_UNITS: [(f64, &str); 3] = [
    (1e3, "milliseconds"),
    (1e6, "microseconds"),
    (1e9, "nanoseconds"),
];

/// Seconds since 1970, or of the day, of a cell that is no plain number; `None`: it has neither date nor clock.
///
/// # Errors
/// The cell, where it is no time, or where day and month are ambiguous.
pub fn of_text(cell: &str) -> Result<Option<f64>> {
    let has_date = cell.get(1..).is_some_and(|rest| {
        let parts = |separator: char| rest.matches(separator).count() >= 2;
        let is_digits = |letter: char| !letter.is_ascii_alphabetic() || letter == 'T';
        rest.chars().all(is_digits) && (parts('-') || parts('/') || parts('.'))
    });
    if !cell.contains(':') && !has_date {
        return Ok(None);
    }
    let words = || {
        format!(
            "\"{}\": must be a time: seconds, 08:15:00, or 2026-01-05 08:15:00 (the year with four digits, the month as a number, no name of a zone)",
            shown(cell)
        )
    };
    let (date, clock) = match cell.split_once(['T', ' ']) {
        Some((date, clock)) if !date.contains(':') => (Some(date), clock.trim()),
        _ if cell.contains(':') => (None, cell),
        _ => (Some(cell), "00:00:00"),
    };
    // ISO 8601 ends a day with 24:00:00, the begin of the next one.
    let rest = clock.strip_prefix("24:00").filter(|_| date.is_some());
    let is_end_of_day =
        rest.is_some_and(|rest| rest.chars().all(|letter| ":0.,Z".contains(letter)));
    let begin = if is_end_of_day {
        clock.replacen("24", "00", 1)
    } else {
        clock.to_owned()
    };
    let added_s = if is_end_of_day { DAY_S } else { 0.0 };
    let clock = in_24_hours(&begin).with_context(words)?;
    let Some(date) = date else {
        let day = read_stamp(&format!("1970-01-01T{clock}")).with_context(words)?;
        return Ok(Some(seconds(day.nanos())));
    };
    let date = in_order(date)?.with_context(words)?;
    let stamp = read_stamp(&format!("{date}T{clock}"));
    let stamp = stamp.with_context(|| match is_beyond(&date, &clock) {
        true => format!("\"{}\": {OF_NO_CLOCK}", shown(cell)),
        false => words(),
    })?;
    Ok(Some(seconds(stamp.nanos()) + added_s))
}

/// Limits of the instants that a message can carry, and the remedy.
const OF_NO_CLOCK: &str = "must be a time from 1970-01-01T00:00:00Z to 2106-02-07T06:28:15Z: set the clock that wrote it, or write seconds since the first row";

/// Whether a date with a clock is an instant outside the range of the wire: in a leap year within it both are one.
fn is_beyond(date: &str, clock: &str) -> bool {
    let Some((year, day)) = date.split_once('-') else {
        return false;
    };
    let is_outside = year
        .parse()
        .is_ok_and(|year: u32| year <= 1970 || year >= 2106);
    is_outside && read_stamp(&format!("2000-{day}T{clock}")).is_some()
}

fn seconds(nanos: i64) -> f64 {
    nanos as f64 / 1e9
}

/// A time of the day with seconds, in 24 hours; an offset at its end stays.
fn in_24_hours(clock: &str) -> Option<String> {
    let upper = clock.to_uppercase();
    let (clock, added) = match upper.split_once([' ', 'A', 'P']) {
        Some((clock, _)) if upper.ends_with("PM") => (clock, Some(12)),
        Some((clock, _)) if upper.ends_with("AM") => (clock, Some(0)),
        _ => (upper.as_str(), None),
    };
    let (hour, rest) = clock.split_once(':')?;
    let hour: u32 = hour.parse().ok()?;
    let hour = match added {
        Some(added) if (1..=12).contains(&hour) => hour % 12 + added,
        Some(_) => return None,
        None => hour,
    };
    let minutes = rest.get(..2)?;
    let behind = rest.get(2..)?;
    // 08:15 and 08:15+01:00 have no seconds; 0:30.5 has no hours.
    if behind.starts_with(['.', ',']) {
        return None;
    }
    let seconds = if behind.starts_with(':') { "" } else { ":00" };
    Some(format!("{hour:02}:{minutes}{seconds}{behind}"))
}

/// Year, month and day of a date; `None` for any other text.
fn in_order(date: &str) -> Result<Option<String>> {
    let separator = date.chars().find(|letter| !letter.is_ascii_digit());
    let Some(separator) = separator else {
        return Ok(None);
    };
    let parts: Vec<&str> = date.split(separator).collect();
    let numbers: Option<Vec<u32>> = parts.iter().map(|part| part.parse().ok()).collect();
    let (Some([a, b, c]), [first, _, last]) = (numbers.as_deref(), parts.as_slice()) else {
        return Ok(None);
    };
    let iso = |year: &u32, month: &u32, day: &u32| Some(format!("{year:04}-{month:02}-{day:02}"));
    if first.len() == 4 {
        return Ok(iso(a, b, c));
    }
    if last.len() != 4 {
        return Ok(None);
    }
    match (separator, *a > 12, *b > 12) {
        ('.', ..) | (_, true, false) => Ok(iso(c, b, a)),
        (_, false, true) => Ok(iso(c, a, b)),
        _ if a == b => Ok(iso(c, a, b)),
        _ => bail!(
            "\"{}\": day and month are ambiguous: write dates as 2026-01-05",
            shown(date)
        ),
    }
}

/// Refuses times of which most lie too far apart, or the last too far behind the first; rows that go back are refused
/// where they are written, by their row.
///
/// # Errors
/// With the value, its limit, and the unit that it looks like or the row with the leap.
pub fn check(times_s: impl Iterator<Item = f64>) -> Result<()> {
    let times_s: Vec<f64> = times_s.collect();
    let [first_s, .., last_s] = times_s.as_slice() else {
        return Ok(());
    };
    let steps_s: Vec<f64> = times_s.windows(2).map(|two| two[1] - two[0]).collect();
    let mut sorted_s = steps_s.clone();
    sorted_s.sort_by(f64::total_cmp);
    let spacing_s = sorted_s[sorted_s.len() / 2];
    if spacing_s > SPACING_S {
        let unit = unit(spacing_s);
        bail!(
            "times: most rows lie {} s apart: must be at most {SPACING_S} s{unit}",
            number(spacing_s)
        );
    }
    let length_s = last_s - first_s;
    if length_s > LONGEST_LOG_S {
        let leap = (1..times_s.len()).max_by(|a, b| steps_s[a - 1].total_cmp(&steps_s[b - 1]));
        let row = leap.unwrap_or(1);
        bail!(
            "times: {} s from the first row to the last: must be at most {LONGEST_LOG_S} s; the greatest leap is at row {}, from {} to {} s",
            number(length_s),
            row + 1,
            number(times_s[row - 1]),
            number(times_s[row])
        );
    }
    Ok(())
}

/// Median of the steps between rows, and from the first to the last, in the unit of the numbers.
fn spacing(times: &[f64]) -> Option<(f64, f64)> {
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|two| (two[1] - two[0]).abs())
        .collect();
    steps.sort_by(f64::total_cmp);
    let length = times.last()? - times.first()?;
    Some((*steps.get(steps.len() / 2)?, length.abs()))
}

/// Units in which numbers make a log as most are, the second first; none of times from 1970 on.
pub fn usual(times: &[f64]) -> Vec<Unit> {
    let Some((step, length)) = spacing(times).filter(|_| times[0].abs() < EPOCH_S) else {
        return vec![];
    };
    let is_usual = |unit: &Unit| {
        let holds = |[low, high]: [f64; 2], number: f64| {
            let number_s = unit.convert(number, Unit::Second);
            (low..=high).contains(&number_s)
        };
        holds(USUAL_SPACING_S, step) && holds(USUAL_LENGTH_S, length)
    };
    let units = [
        Unit::Second,
        Unit::Min,
        Unit::Hour,
        Unit::Day,
        Unit::Ms,
        Unit::Us,
        Unit::Ns,
    ];
    units.into_iter().filter(is_usual).collect()
}

/// The unit that a column of times without one is likely in, where that is not the second.
pub fn likely(times: &[f64]) -> Option<Unit> {
    let first = usual(times).first().copied();
    first.filter(|unit| *unit != Unit::Second)
}

/// How long a log is, and how far its rows lie apart, where its numbers are in a unit.
pub fn in_words(times: &[f64], unit: Unit) -> String {
    let (step, length) = spacing(times).unwrap_or_default();
    let of = |value: f64| number(unit.convert(value, Unit::Second));
    format!(
        "in {} it lasts {} s with a row every {} s",
        unit.name(),
        of(length),
        of(step)
    )
}

/// The unit of a time that a column's name has: in brackets or as its last word, or as its only one of four letters at least.
pub fn named_unit(name: &str) -> Option<Unit> {
    let letters = |letter: char| !letter.is_alphanumeric() && letter != 'µ' && letter != 'μ';
    let words: Vec<&str> = name
        .split(letters)
        .filter(|word| !word.is_empty())
        .collect();
    let word = match words.as_slice() {
        [only] if only.chars().count() > 3 => only,
        // A time of day is one of a clock.
        [.., before, last] if *before != "of" => last,
        _ => return None,
    };
    Unit::of_word(word).filter(|unit| unit.kind() == Kind::Time)
}

/// What is doubtful about a column of times that are plain numbers, in s as they were read. `is_stated`: the map names
/// their unit, and is believed.
///
/// # Errors
/// With column and remedy, where all rows have one time, where the name of the column has another unit, or where rows lie
/// closer together than anything is read, as those of serial days under a name of seconds.
pub fn of_column(name: &str, times_s: &[f64], is_stated: bool) -> Result<Option<String>> {
    let state = |unit: &str| format!("state `units: {{\"{name}\": {unit}}}` in the map");
    if let [first_s, _, ..] = times_s
        && times_s
            .iter()
            .all(|time_s| time_s.total_cmp(first_s).is_eq())
    {
        bail!(
            "column \"{name}\": all {} rows have the time {} s: a log needs times that differ: is another column the time?",
            times_s.len(),
            number(*first_s)
        );
    }
    let named = named_unit(name);
    match named {
        _ if is_stated => return Ok(None),
        Some(Unit::Second) => {}
        Some(unit) => bail!(
            "column \"{name}\": its name says {unit}, the map s: {}, or `s` where its name is wrong",
            state(unit.name()),
            unit = unit.name()
        ),
        None => stated::check_time(name)?,
    }
    let usual = usual(times_s);
    let other = usual.iter().find(|unit| **unit != Unit::Second);
    let as_seconds = in_words(times_s, Unit::Second);
    let reading = match named {
        Some(unit) => format!("its name says {}", unit.name()),
        None => "no unit in its name, read in s".to_owned(),
    };
    let close = spacing(times_s).filter(|(step_s, _)| *step_s > 0.0 && *step_s < LEAST_SPACING_S);
    if let Some((step_s, _)) = close {
        let (likely, unit) = other.map_or((String::new(), "UNIT"), |unit| {
            (format!("; {}", in_words(times_s, *unit)), unit.name())
        });
        bail!(
            "column \"{name}\": {reading}: most rows lie {} s apart: must be at least {LEAST_SPACING_S} s{likely}: {}, or `s`",
            number(step_s),
            state(unit)
        );
    }
    if named.is_some() {
        return Ok(None);
    }
    Ok(other.map(|unit| {
        let word = if usual.contains(&Unit::Second) {
            "possible"
        } else {
            "likely"
        };
        format!(
            "column \"{name}\": {reading}: {as_seconds}; {} is {word}: {}; {}, or `s`",
            unit.name(),
            in_words(times_s, *unit),
            state(unit.name())
        )
    }))
}

/// Whether rows lie as far apart as the days, weeks, months or years of a calendar.
fn is_of_calendar(spacing_s: f64) -> bool {
    let days = spacing_s / 86_400.0;
    let is_near = |period: f64| (days / period - 1.0).abs() < 0.01;
    [
        1.0, 2.0, 7.0, 14.0, 28.0, 30.0, 30.44, 31.0, 91.0, 182.5, 365.25,
    ]
    .into_iter()
    .any(is_near)
}

fn unit(spacing_s: f64) -> String {
    if is_of_calendar(spacing_s) {
        return "; make a table of its own of the rows of each session".to_owned();
    }
    let unit = TIME_UNITS
        .into_iter()
        .find(|(scale, _)| spacing_s / scale <= SPACING_S);
    unit.map_or_else(String::new, |(scale, unit)| {
        format!("; it looks like {unit}: divide the column by {scale}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(times_s: &[f64]) -> String {
        match check(times_s.iter().copied()) {
            Ok(()) => String::new(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn times_in_another_unit_are_refused_with_the_unit() {
        for (scale, unit) in TIME_UNITS {
            let rows: Vec<f64> = (0..90).map(|k| f64::from(k) * 60.0 * scale).collect();
            let said = said(&rows);
            assert!(said.contains("must be at most 21600 s"), "{said}");
            let remedy = format!("it looks like {unit}: divide the column by {scale}");
            assert!(said.ends_with(&remedy), "{said}");
        }
    }

    /// Seconds by `date -u -d "2026-01-05 08:15:30" +%s`.
    #[test]
    fn every_spelling_of_an_instant_is_the_same_one() {
        for cell in [
            "2026-01-05T08:15:30Z",
            "2026-01-05T08:15:30",
            "2026-01-05 08:15:30",
            "2026-01-05T09:15:30+01:00",
            "2026/01/05 08:15:30.000",
            "05.01.2026 08:15:30",
            "5.1.2026 8:15:30,0",
        ] {
            let found = of_text(cell).unwrap();
            assert_eq!(found, Some(1_767_600_930.0), "{cell}");
        }
        for (cell, wanted) in [
            ("08:15:30", 29_730.0),
            ("8:15:30.5", 29_730.5),
            ("08:15", 29_700.0),
            ("12:00 AM", 0.0),
            ("12:30:00 PM", 45_000.0),
            ("1/25/2026 08:15:30 PM", 1_769_372_130.0),
            ("25/1/2026 20:15:30", 1_769_372_130.0),
            ("2026-01-05", 1_767_571_200.0),
            ("2026-01-04 24:00:00", 1_767_571_200.0),
            ("2026-01-04T24:00:00.000", 1_767_571_200.0),
        ] {
            assert_eq!(of_text(cell).unwrap(), Some(wanted), "{cell}");
        }
    }

    #[test]
    fn numbers_are_left_to_others_and_what_is_no_time_is_refused() {
        for cell in ["0", "-5", "1.5e-3", "1767600930,5", "", "abc"] {
            assert_eq!(of_text(cell).unwrap(), None, "{cell}");
        }
        for cell in ["8:xx", "2026-13-05 08:00", "25:00:00", "1-2-3", "13:00 PM"] {
            let said = of_text(cell).unwrap_err().to_string();
            assert!(said.contains("must be a time"), "{said}");
        }
        let said = of_text("05/01/2026 08:00").unwrap_err().to_string();
        assert!(said.contains("day and month are ambiguous"), "{said}");
    }

    #[test]
    fn rows_of_a_calendar_are_no_other_unit() {
        for days in [1.0, 7.0, 30.0, 30.44, 31.0, 91.3, 365.0, 365.2425, 366.0] {
            let rows: Vec<f64> = (0..9).map(|k| f64::from(k) * days * 86_400.0).collect();
            let shown = said(&rows);
            assert!(
                shown.ends_with("; make a table of its own of the rows of each session"),
                "{shown}"
            );
        }
    }

    #[test]
    fn mornings_with_nights_between_them_are_times_and_a_leap_is_named() {
        let day = |day: u32| (0..90).map(move |k| f64::from(day * 86_400 + k * 60));
        assert_eq!(said(&(0..3).flat_map(day).collect::<Vec<_>>()), "");
        assert_eq!(said(&[0.0]), "");
        assert_eq!(said(&[1_767_600_000.0, 1_767_600_060.0]), "");
        let wrong = said(&[0.0, 60.0, 120.0, 6e8]);
        assert!(
            wrong.ends_with("the greatest leap is at row 4, from 120 to 600000000 s"),
            "{wrong}"
        );
    }

    /// 240 rows, one a minute, as loggers in each unit write them.
    fn minutes(unit: Unit) -> Vec<f64> {
        let row = |k: u32| Unit::Second.convert(60.0 * f64::from(k), unit);
        (0..240).map(row).collect()
    }

    #[test]
    fn a_column_of_times_without_a_unit_is_said_to_be_in_the_likely_one_or_refused() {
        for unit in [Unit::Min, Unit::Hour, Unit::Day] {
            let times = minutes(unit);
            assert_eq!(likely(&times), Some(unit));
            let state = format!("state `units: {{\"time\": {}}}` in the map", unit.name());
            let said = match of_column("time", &times, false) {
                Ok(said) => said.unwrap(),
                Err(refused) => refused.to_string(),
            };
            assert!(said.contains(&state), "{said}");
            assert!(said.contains("14340 s with a row every 60 s"), "{said}");
            assert_eq!(of_column("time", &times, true).unwrap(), None);
        }
        assert!(of_column("time", &minutes(Unit::Day), false).is_err());
        assert_eq!(likely(&minutes(Unit::Ms)), Some(Unit::Ms));
        assert_eq!(likely(&minutes(Unit::Second)), None);
        assert_eq!(
            of_column("time", &minutes(Unit::Second), false).unwrap(),
            None
        );
        // Every second for an hour, or every minute for two days and a half.
        let seconds: Vec<f64> = (0..3_600).map(f64::from).collect();
        let said = of_column("time", &seconds, false).unwrap().unwrap();
        assert!(said.contains("min is possible"), "{said}");
        assert_eq!(of_column("time_s", &seconds, false).unwrap(), None);
    }

    #[test]
    fn rows_too_close_for_the_seconds_of_a_name_are_refused_until_the_map_states_a_unit() {
        for (unit, begin) in [(Unit::Day, 46_000.0), (Unit::Day, 0.0), (Unit::Day, 1.5)] {
            let times: Vec<f64> = minutes(unit).iter().map(|time| begin + time).collect();
            for name in ["time_s", "time [s]", "seconds", "t"] {
                let refused = of_column(name, &times, false).unwrap_err().to_string();
                assert!(refused.contains("must be at least 0.005 s"), "{refused}");
                let state = format!("state `units: {{\"{name}\": d}}` in the map, or `s`");
                assert!(refused.ends_with(&state), "{refused}");
                assert_eq!(of_column(name, &times, true).unwrap(), None);
            }
        }
        let fast: Vec<f64> = (0..900).map(|k| f64::from(k) * 0.01).collect();
        assert_eq!(of_column("time_s", &fast, false).unwrap(), None);
    }

    #[test]
    fn an_instant_outside_the_range_of_the_wire_names_the_range() {
        for cell in [
            "1969-12-31T23:00:00Z",
            "1970-01-01T00:30:00+01:00",
            "1601-01-01 00:00:00",
            "31.12.1899 08:15",
            "2106-02-07T06:28:16Z",
            "2107-01-01",
            "9999-12-31 23:59:59",
        ] {
            let said = of_text(cell).unwrap_err().to_string();
            assert!(
                said.starts_with(&format!("\"{cell}\": {OF_NO_CLOCK}")),
                "{said}"
            );
        }
        for cell in [
            "1969-13-31 23:00:00",
            "1969-02-30 08:00:00",
            "2026-02-29 08:00:00",
        ] {
            let said = of_text(cell).unwrap_err().to_string();
            assert!(said.contains("must be a time: seconds"), "{said}");
        }
    }

    #[test]
    fn the_unit_in_the_name_of_a_column_must_be_that_of_the_map() {
        for (name, unit) in [
            ("time [d]", Unit::Day),
            ("t (min)", Unit::Min),
            ("hours", Unit::Hour),
            ("elapsed_ms", Unit::Ms),
            ("Zeit/h", Unit::Hour),
            ("t [µs]", Unit::Us),
        ] {
            assert_eq!(named_unit(name), Some(unit), "{name}");
            let refused = of_column(name, &minutes(Unit::Second), false).unwrap_err();
            let words = format!("its name says {}, the map s", unit.name());
            assert!(refused.to_string().contains(&words), "{refused}");
        }
        for name in ["time", "t", "h", "d", "time of day", "stamp", ""] {
            assert_eq!(named_unit(name), None, "{name}");
        }
        assert_eq!(named_unit("time_s"), Some(Unit::Second));
    }

    #[test]
    fn a_column_with_one_time_alone_is_no_column_of_times() {
        for (time_s, n) in [(0.0, 240), (29_700.0, 2), (1.767e9, 9)] {
            let refused = of_column("time_s", &vec![time_s; n], true).unwrap_err();
            assert!(refused.to_string().contains("need"), "{refused}");
        }
        assert_eq!(of_column("t", &[5.0], false).unwrap(), None);
        assert_eq!(of_column("t", &[], false).unwrap(), None);
    }
}
