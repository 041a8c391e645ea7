//! Times of two parts: hours and minutes of a clock, or minutes and seconds of a stopwatch.

use anyhow::{Result, bail};

use super::times::{in_words, usual};
use super::units::Unit;

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
