//! Times that count from other days than 1970-01-01, as some programs write them.

use anyhow::{Context, Result, anyhow, bail};
use metrology::yaml::shown;
use metrology::{Host, epoch};

use super::super::recognise::Known;
use super::super::times;
use super::super::units::Unit;
use super::super::vocabulary::words;

/// From 1990 to 2100, s since 1970 (`date -u -d 1990-01-01 +%s`): measurements are in between.
const MEASURED_S: [f64; 2] = [631_152_000.0, 4_102_444_800.0];
/// Counts of 100 ns: who writes them, their first day, and 1970 in them.
const TICKS: [(&str, &str, f64); 2] = [
    ("ticks of .NET", "0001", 621_355_968_000_000_000.0),
    ("file times of Windows", "1601", 116_444_736_000_000_000.0),
];
const TICKS_A_SECOND: f64 = 1e7;
/// 1970 in seconds since 1904, which LabVIEW writes.
const LABVIEW_1970_S: f64 = 2_082_844_800.0;
/// 1970 in seconds since 1900, which NTP counts.
const NTP_1970_S: f64 = 2_208_988_800.0;
/// 1980-01-06 in seconds since 1970, from which GPS counts.
const GPS_EPOCH_S: f64 = 315_964_800.0;
/// No measurement is later, s since 1970: 2060.
const LATEST_S: f64 = 2_840_140_800.0;

/// 1970 in the days of Excel, since 1899-12-30 (a cell of 1970-01-01 shown as a number).
const EXCEL_1970_D: f64 = 25_569.0;
const DAY_S: f64 = 86_400.0;

/// The begin of a column of days since 1899-12-30, s since 1970; none where they are days since 1970 or since the begin.
pub fn of_excel(unit: Unit, first: f64) -> Option<f64> {
    let begin_s = (first - EXCEL_1970_D) * DAY_S;
    (unit == Unit::Day && (MEASURED_S[0]..LATEST_S).contains(&begin_s)).then_some(begin_s)
}

/// The first time of a column, s since 1970 or of its day; none of a plain number.
///
/// # Errors
/// With the cell, where it is no time, or none from which a log has room before 2106.
pub fn of_first(time: &Known) -> Result<Option<f64>> {
    let place = || format!("line {}, column \"{}\"", time.first_line, shown(&time.name));
    let first_s = times::of_text(&time.first).with_context(place)?;
    if let Some(first_s) = first_s {
        check_start(time, first_s)?;
    }
    Ok(first_s)
}

fn check_start(time: &Known, first_s: f64) -> Result<()> {
    epoch::whole_seconds::<Host>(first_s as i64, times::LONGEST_LOG_S as i64)
        .map(|_| ())
        .map_err(|error| {
            let (name, cell) = (shown(&time.name), shown(&time.first));
            anyhow!("column \"{name}\": \"{cell}\": a log begins {error}")
        })
}

fn is_measured(time_s: f64) -> bool {
    (MEASURED_S[0]..MEASURED_S[1]).contains(&time_s)
}

/// What is doubtful about a column of times whose first number looks like seconds since 1904.
///
/// # Errors
/// With the cell and the remedy, where the numbers are counts of 100 ns from another day.
pub fn check(time: &Known, first: f64) -> Result<Option<String>> {
    let (name, cell) = (shown(&time.name), shown(&time.first));
    for (what, year, of_1970) in TICKS {
        if is_measured((first - of_1970) / TICKS_A_SECOND) {
            bail!(
                "column \"{name}\": \"{cell}\": looks like {what}, of 100 ns since the year {year}: write seconds since the first row, or state their unit in a map (units)"
            );
        }
    }
    // A time from zero may begin before it.
    let is_beyond = first > epoch::END_S as f64 - times::LONGEST_LOG_S;
    if is_beyond && epoch::likely_unit(first).is_none() {
        check_start(time, first)?;
    }
    let is_of = |of_1970: f64| first > LATEST_S && is_measured(first - of_1970);
    if !is_of(LABVIEW_1970_S) && !is_of(NTP_1970_S) {
        return Ok(None);
    }
    Ok(Some(format!(
        "column \"{name}\": \"{cell}\": looks like seconds since 1904, as LabVIEW writes them, or since 1900, as NTP counts them, and was read as \
         seconds since 1970: subtract {LABVIEW_1970_S} or {NTP_1970_S} for the date"
    )))
}

/// What is doubtful about a column that is named GPS, which counts from 1980.
pub fn check_gps(time: &Known, first_s: f64) -> Option<String> {
    let is_gps = words(&time.name).iter().any(|word| word == "gps");
    let is_of_epoch = is_measured(first_s) || is_measured(first_s + GPS_EPOCH_S);
    (is_gps && is_of_epoch).then(|| {
        format!(
            "column \"{}\": \"{}\": named GPS, which counts from 1980-01-06, and was read as seconds since 1970: add {GPS_EPOCH_S} less \
             the leap seconds (18 since 2017) for the date",
            shown(&time.name),
            shown(&time.first)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::recognise::{Role, of_text};
    use super::*;

    fn checked(first: f64) -> Result<Option<String>> {
        let text = format!("time,z_um\n{first},0.1\n{},0.2\n", first + 60.0);
        let found = of_text(&text).unwrap().unwrap();
        check(found.first(Role::Time).unwrap(), first)
    }

    #[test]
    fn days_of_excel_are_known_by_their_size() {
        // Excel shows 2026-03-28 22:30 as 46109.9375; `date -u -d "2026-03-28 22:30" +%s`.
        let begin_s = of_excel(Unit::Day, 46_109.937_5).unwrap();
        assert!((begin_s - 1_774_737_000.0).abs() < 1e-6, "{begin_s}");
        for (unit, first) in [
            (Unit::Day, 20_540.9),
            (Unit::Day, 0.5),
            (Unit::Second, 46_109.9),
            (Unit::Day, 73_000.0),
        ] {
            assert_eq!(of_excel(unit, first), None, "{first}");
        }
    }

    /// The same day by both counts: Python, (datetime(2026, 1, 5, 8) - datetime(1900, 1, 1)).total_seconds() and from 1980-01-06, where
    /// GPS is 18 s ahead of UTC.
    #[test]
    fn seconds_of_ntp_and_of_gps_are_named_with_what_makes_dates_of_them() {
        let ntp = checked(3_976_588_800.0).unwrap().unwrap();
        let words = "since 1900, as NTP counts them, and was read as seconds since 1970: subtract 2082844800 or 2208988800 for the date";
        assert!(ntp.contains(words), "{ntp}");
        assert!((3_976_588_800.0 - NTP_1970_S - 1_767_600_000.0_f64).abs() < 0.5);
        let named = |name: &str, first: f64| {
            let text = format!("{name},z_um\n{first},0.1\n{},0.2\n", first + 60.0);
            let found = of_text(&text).unwrap().unwrap();
            check_gps(found.first(Role::Time).unwrap(), first)
        };
        let gps = named("gps time s", 1_451_635_218.0).unwrap();
        assert!(
            gps.contains("named GPS, which counts from 1980-01-06"),
            "{gps}"
        );
        assert!(gps.contains("add 315964800 less the leap seconds"), "{gps}");
        assert!((1_451_635_218.0 + GPS_EPOCH_S - 18.0 - 1_767_600_000.0_f64).abs() < 0.5);
        // A time from zero, and one that is not of GPS.
        assert_eq!(named("gps time s", 0.0), None);
        assert_eq!(named("time s", 1_451_635_218.0), None);
    }

    #[test]
    fn counts_from_other_days_are_named_and_those_from_1970_are_taken() {
        // The second: Python, (datetime(2026, 1, 5, 8) - datetime(1, 1, 1)) and - datetime(1601, 1, 1), in 100 ns.
        for first in [
            629_000_000_000_000_000.0 + 4e15,
            639_031_968_000_000_000.0,
            643_400_000_000_000_000.0,
        ] {
            let refused = checked(first).unwrap_err().to_string();
            assert!(refused.contains("ticks of .NET"), "{refused}");
        }
        for first in [134_120_736_000_000_000.0, 129_000_000_000_000_000.0] {
            let refused = checked(first).unwrap_err().to_string();
            assert!(refused.contains("file times of Windows"), "{refused}");
        }
        for first in [3_850_444_800.0, 3_500_000_000.0] {
            let said = checked(first).unwrap().unwrap();
            assert!(said.contains("subtract 2082844800"), "{said}");
        }
        for first in [4_300_000_000.0, 9e9, 1e12, 1e25] {
            let said = checked(first).map_err(|error| error.to_string());
            let is_refused = said
                .as_ref()
                .is_err_and(|said| said.starts_with("column \"time\": \""));
            assert!(
                is_refused || first.total_cmp(&1e12).is_eq(),
                "{first}: {said:?}"
            );
        }
        // 2026 since 1970 in s, ms, us and ns, and times from zero.
        for first in [
            1_767_600_000.0,
            1_767_600_000e3,
            1_767_600_000e6,
            1_767_600_000e9,
            0.0,
            -60.0,
            45_000.0,
        ] {
            assert_eq!(checked(first).unwrap(), None, "{first}");
        }
    }
}
