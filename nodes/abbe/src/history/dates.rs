//! Dates that people write and read: UTC.

use chrono::{DateTime, NaiveDate, NaiveTime};

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// A date or time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Its first second, s since 1970.
    pub begin_s: i64,
    /// Its last second: of a date, that of the day.
    pub end_s: i64,
}

/// Reads `2026-03-01` (the whole day, UTC) or RFC 3339 such as `2026-03-01T12:00:00Z`.
///
/// # Errors
/// Says what is wanted.
pub fn moment(text: &str) -> Result<Moment, String> {
    if let Ok(date) = NaiveDate::parse_from_str(text, "%Y-%m-%d") {
        let begin_s = date.and_time(NaiveTime::MIN).and_utc().timestamp();
        return Ok(Moment {
            begin_s,
            end_s: begin_s.saturating_add(86_399),
        });
    }
    let time = DateTime::parse_from_rfc3339(text)
        .map_err(|_| "must be a date as 2026-03-01 or a time as 2026-03-01T12:00:00Z".to_owned())?;
    let at_s = time.timestamp();
    Ok(Moment {
        begin_s: at_s,
        end_s: at_s,
    })
}

/// A date for people; beyond the calendar's range a dash.
pub fn date(at_s: f64) -> String {
    written(at_s, "%Y-%m-%d")
}

/// Date and time for machines.
pub fn time(at_s: f64) -> String {
    written(at_s, "%Y-%m-%dT%H:%M:%SZ")
}

fn written(at_s: f64, format: &str) -> String {
    // Out of range, the cast ends at the limits of 64 bits, which no calendar has.
    let known = DateTime::from_timestamp(at_s as i64, 0);
    known.map_or_else(|| "—".to_owned(), |time| time.format(format).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_days_and_times_are_seconds_of_utc() {
        let day = moment("2026-03-01").unwrap();
        assert_eq!(day.end_s - day.begin_s, 86_399);
        let noon = moment("2026-03-01T13:00:00+01:00").unwrap();
        assert_eq!(noon.begin_s, day.begin_s + 43_200);
        assert_eq!(date(day.begin_s as f64), "2026-03-01");
        assert_eq!(time(noon.begin_s as f64), "2026-03-01T12:00:00Z");
        assert_eq!(date(1e30), "—");
        for text in [
            "",
            "2026-13-01",
            "yesterday",
            "1.3.2026",
            "2026-03-01 12:00",
        ] {
            assert!(moment(text).is_err(), "{text}");
        }
    }
}
