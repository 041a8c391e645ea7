//! A column of dates beside one of times of the day: a row's time is both.

use super::times;

/// Fewest rows with both; a table of fewer has no column of dates.
const LEAST_ROWS: usize = 2;

/// The date of a cell that is a date alone; midnight behind it, as worksheets have it, is no time.
fn date(cell: &str) -> Option<&str> {
    let (date, clock) = cell.split_once(['T', ' ']).unwrap_or((cell, ""));
    let is_midnight = clock
        .chars()
        .all(|letter| matches!(letter, '0' | ':' | '.' | 'Z'));
    // One whose day and month are ambiguous is refused where it is read with its time.
    let is_date = || {
        !date.contains(':')
            && date.starts_with(|letter: char| letter.is_ascii_digit())
            && !matches!(times::of_text(date), Ok(None))
    };
    (is_midnight && is_date()).then_some(date)
}

/// Whether a cell is a time of the day without a date.
fn is_clock(cell: &str) -> bool {
    let is_first = cell.starts_with(|letter: char| letter.is_ascii_digit());
    is_first && cell.contains(':') && !cell.contains(['T', '/', '-']) && date(cell).is_none()
}

/// Puts the dates of a column before the times of the day in others, row by row; the place of that column, where there is one.
/// A row without a date keeps its time, which is then refused as one of 1970.
pub fn join(lines: &mut [(u64, Vec<String>)]) -> Option<usize> {
    let n_columns = lines.iter().map(|(_, cells)| cells.len()).max()?;
    let n_dates = |k: usize| {
        let cells = lines.iter().filter_map(|(_, cells)| cells.get(k));
        cells.filter(|cell| date(cell).is_some()).count()
    };
    let mut dated = (0..n_columns).filter(|k| 2 * n_dates(*k) > lines.len());
    let (Some(place), None) = (dated.next(), dated.next()) else {
        return None;
    };
    let has_both = |cells: &Vec<String>| {
        let others = cells.iter().enumerate().filter(|(k, _)| *k != place);
        cells.get(place).is_some_and(|cell| date(cell).is_some())
            && others.into_iter().any(|(_, cell)| is_clock(cell))
    };
    let n_both = lines.iter().filter(|(_, cells)| has_both(cells)).count();
    if n_both < LEAST_ROWS || 2 * n_both <= n_dates(place) {
        return None;
    }
    for (_, cells) in lines.iter_mut() {
        let Some(day) = cells
            .get(place)
            .and_then(|cell| date(cell))
            .map(str::to_owned)
        else {
            continue;
        };
        for cell in cells.iter_mut().filter(|cell| is_clock(cell)) {
            *cell = format!("{day} {cell}");
        }
    }
    Some(place)
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Sheet;

    fn joined(text: &str) -> (Option<usize>, Vec<String>) {
        let sheet = Sheet::of_text(text, ',').expect("rows");
        let rows = sheet.lines.into_iter().map(|(_, cells)| cells.join(","));
        (sheet.dates, rows.collect())
    }

    #[test]
    fn a_column_of_dates_is_put_before_the_times_of_the_day() {
        for (text, place, last) in [
            (
                "date,time,z_um\n2026-01-05,08:00:00,0.1\n2026-01-06,00:01:00,0.2\n",
                0,
                "2026-01-06,2026-01-06 00:01:00,0.2",
            ),
            (
                "z_um,Uhrzeit,Datum\n0.1,23:59,05.01.2026\n0.2,00:01,06.01.2026\n",
                2,
                "0.2,06.01.2026 00:01,06.01.2026",
            ),
            (
                "Date,Time,z\n2026-01-05T00:00:00,8:00:00 AM,1\n2026-01-05T00:00:00,8:01:00 PM,2\n",
                0,
                "2026-01-05T00:00:00,2026-01-05 8:01:00 PM,2",
            ),
            (
                "day,t,z\n01/25/2026,08:00,1\n01/25/2026,08:01,2\n",
                0,
                "01/25/2026,01/25/2026 08:01,2",
            ),
        ] {
            let (found, rows) = joined(text);
            assert_eq!(found, Some(place), "{text}");
            assert_eq!(rows.last().map(String::as_str), Some(last), "{text}");
        }
    }

    #[test]
    fn marks_of_an_end_of_file_are_no_row() {
        for end in ["\u{1a}", "\0\0", "\r\n\u{1a}\r\n", "\n\u{1a}", ""] {
            let (_, rows) = joined(&format!("t,z\n1,2\n3,4{end}"));
            assert_eq!(rows, ["t,z", "1,2", "3,4"], "{end:?}");
        }
    }

    #[test]
    fn other_tables_stay_as_they_are() {
        for text in [
            "time,z_um\n08:00:00,0.1\n08:01:00,0.2\n",
            "time,z_um\n2026-01-05 08:00:00,0.1\n2026-01-05 08:01:00,0.2\n",
            "date,z_um\n2026-01-05,0.1\n2026-01-06,0.2\n",
            "date,target_mm,deviation_um\n2026-01-05,0,0.5\n2026-01-05,100,0.5\n",
            "date,done,time\n2026-01-05,2026-01-06,08:00\n2026-01-05,2026-01-06,08:01\n",
            "1.2.3,time\n1.5,08:00\n2.5,08:01\n",
        ] {
            let (found, rows) = joined(text);
            assert_eq!((found, rows.join("\n") + "\n"), (None, text.to_owned()));
        }
    }
}
