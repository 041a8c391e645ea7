//! Times of two parts: hours and minutes of a clock, or minutes and seconds of a stopwatch.

use anyhow::{Result, bail};
use metrology::number::number;
use metrology::yaml::shown;

use super::table::Row;
use super::times::{in_words, usual};
use super::units::Unit;

/// A day, s.
const DAY_S: f64 = 86_400.0;
/// Times of the day that go back by less do not pass midnight, s.
const LEAST_BACK_S: f64 = DAY_S / 2.0;

/// Counts times of the day on, which have no dates and pass midnight once; what was done. `place`: that of the times among the cells.
///
/// # Errors
/// With line and column, where they go back otherwise.
pub fn over_midnight(name: &str, place: usize, rows: &mut [Row]) -> Result<Option<String>> {
    if rows.iter().any(|row| row.cells[place] >= DAY_S) {
        return Ok(None);
    }
    let back_s = |two: &[Row]| two[0].cells[place] - two[1].cells[place];
    let steps = rows.windows(2).enumerate();
    let back: Vec<(usize, f64)> = steps
        .map(|(k, two)| (k + 1, back_s(two)))
        .filter(|(_, back_s)| *back_s > 0.0)
        .collect();
    let Some((first, by_s)) = back.first().copied() else {
        return Ok(None);
    };
    let line = rows.get(first).map_or(0, |row| row.line);
    let by = format!(
        "line {line}, column \"{}\": the times of the day go back by {}",
        shown(name),
        span(by_s)
    );
    if back.len() > 1 || by_s < LEAST_BACK_S {
        let more = match back.len() {
            1 => String::new(),
            n => format!(" (such lines: {n})"),
        };
        bail!("{by}{more}: write dates, as 2026-01-05 08:15:00");
    }
    for row in &mut rows[first..] {
        row.cells[place] += DAY_S;
    }
    Ok(Some(format!(
        "{by}: the rows from there on were taken as those of the next day: write dates where they are not"
    )))
}

/// A span in h, or below one in s.
fn span(of_s: f64) -> String {
    if of_s >= 3600.0 {
        format!("{} h", number((of_s / 36.0).round() / 100.0))
    } else {
        format!("{} s", number(of_s))
    }
}

/// Whether a cell is two numbers parted by a colon, which are hours and minutes or minutes and seconds.
pub fn has_two_parts(cell: &str) -> bool {
    let is_digits = |part: &str| part.chars().all(|letter| letter.is_ascii_digit());
    cell.split_once(':').is_some_and(|(first, last)| {
        !first.is_empty() && last.len() == 2 && is_digits(first) && is_digits(last)
    })
}

/// What is doubtful about a column of times of two parts, which were read as hours and minutes, in s.
///
/// # Errors
/// Where the name of the column says minutes and seconds.
pub fn of_two_parts(name: &str, times_s: &[f64]) -> Result<Option<String>> {
    let letters = name.to_lowercase().replace(' ', "");
    let remedy = "write 00:00:30 for 30 s where they are minutes and seconds";
    let is_said = letters.contains("h:m") || letters.contains("hh:mm");
    if is_said {
        return Ok(None);
    }
    if letters.contains("m:s") || letters.contains("mm:ss") || letters.contains("min:s") {
        bail!("column \"{name}\": times of two parts are read as hours and minutes: {remedy}");
    }
    let as_seconds: Vec<f64> = times_s.iter().map(|time_s| time_s / 60.0).collect();
    let is_usual = |times_s: &[f64]| usual(times_s).contains(&Unit::Second);
    if is_usual(times_s) && !is_usual(&as_seconds) {
        return Ok(None);
    }
    let of =
        |times_s: &[f64]| in_words(times_s, Unit::Second).replacen("in s it lasts", "lasts", 1);
    Ok(Some(format!(
        "warning, column \"{name}\": its times have two parts and were read as hours and minutes: the log {}; as minutes and seconds it {}: {remedy}",
        of(times_s),
        of(&as_seconds)
    )))
}

#[cfg(test)]
mod tests {
    use super::super::times::of_text;
    use super::*;

    /// Rows of a log every `step_s` from a time of the day on.
    fn log(first_s: f64, step_s: f64, n: i32) -> Vec<Row> {
        let row = |k: i32| Row {
            line: k as u64 + 2,
            cells: vec![(first_s + step_s * f64::from(k)).rem_euclid(DAY_S), 0.5],
        };
        (0..n).map(row).collect()
    }

    #[test]
    fn a_log_without_dates_that_passes_midnight_once_is_counted_on() {
        for (first_s, step_s, n) in [
            (81_000.0, 60.0, 241),
            (86_399.0, 1.0, 10),
            (28_800.0, 600.0, 200),
            (43_201.0, 43_200.0, 2),
        ] {
            let mut rows = log(first_s, step_s, n);
            let said = over_midnight("Time", 0, &mut rows)
                .unwrap()
                .expect("a remark");
            let places = rows.iter().enumerate();
            for (k, row) in places {
                let wanted = first_s + step_s * k as f64;
                assert!((row.cells[0] - wanted).abs() < 1e-6, "{row:?}");
            }
            assert!(said.contains("taken as those of the next day"), "{said}");
        }
        let said = over_midnight("Time", 0, &mut log(81_000.0, 60.0, 241));
        let said = said.unwrap().expect("a remark");
        let words = "line 92, column \"Time\": the times of the day go back by 23.98 h: ";
        assert!(said.starts_with(words), "{said}");
    }

    #[test]
    fn times_of_the_day_that_go_back_otherwise_are_refused_with_line_and_remedy() {
        let mut dated = log(81_000.0, 60.0, 241);
        dated.iter_mut().for_each(|row| row.cells[0] += 1.7e9);
        for mut rows in [log(0.0, 60.0, 100), dated] {
            let wanted = rows.clone();
            assert_eq!(over_midnight("t", 0, &mut rows).unwrap(), None);
            assert_eq!(rows, wanted);
        }
        let mut swapped = log(3600.0, 60.0, 20);
        swapped.swap(4, 5);
        (swapped[4].line, swapped[5].line) = (6, 7);
        for (mut rows, words) in [
            (
                swapped,
                "line 7, column \"t\": the times of the day go back by 60 s: write dates",
            ),
            (
                log(43_200.0, 3600.0, 60),
                "the times of the day go back by 23 h (such lines: 2): write dates",
            ),
        ] {
            let refused = over_midnight("t", 0, &mut rows).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }

    #[test]
    fn times_of_two_parts_are_told_with_the_other_reading() {
        let column =
            |step_s: f64, n: i32| -> Vec<f64> { (0..n).map(|k| step_s * f64::from(k)).collect() };
        for (times_s, is_doubtful) in [
            // A stopwatch of 22 and of 10 min: 0:30, 1:30, ...; 0:00, 0:30, ...
            (column(3600.0, 23), true),
            (column(1800.0, 20), true),
            (column(60.0, 1440), true),
            // A clock on the wall, every minute to ten for some hours.
            (column(60.0, 90), false),
            (column(300.0, 48), false),
            (column(600.0, 30), false),
        ] {
            let said = of_two_parts("time", &times_s).unwrap();
            assert_eq!(said.is_some(), is_doubtful, "{said:?}");
            assert_eq!(of_two_parts("time [hh:mm]", &times_s).unwrap(), None);
            for name in ["time mm:ss", "t [m:ss]", "time (min:sec)"] {
                assert!(of_two_parts(name, &times_s).is_err(), "{name}");
            }
        }
        let said = of_two_parts("time", &column(3600.0, 23)).unwrap().unwrap();
        for words in [
            "lasts 79200 s with a row every 3600 s",
            "it lasts 1320 s with a row every 60 s",
        ] {
            assert!(said.contains(words), "{said}");
        }
        for cell in ["0:30", "8:15", "08:15", "120:00"] {
            assert!(has_two_parts(cell), "{cell}");
        }
        for cell in [
            "0:30:00",
            "08:15 PM",
            "2026-01-05 08:15",
            "8:15.5",
            "8:1",
            "08:15Z",
            ":30",
            "30",
        ] {
            assert!(!has_two_parts(cell), "{cell}");
        }
        for cell in ["0:30.5", "1:30,25", "59:59.9"] {
            assert!(of_text(cell).is_err(), "{cell}");
        }
    }
}
