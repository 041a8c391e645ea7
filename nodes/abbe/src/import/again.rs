//! A line of names, or of units, further down in a table: another table begins there, whose columns may be others.

use anyhow::{Result, bail};
use metrology::yaml::shown;

use super::map::{Column, What};
use super::odd::is_missing;
use super::recognise::{Role, role_of_name};
use super::stated;

/// Refuses a row that is no row of numbers but names columns, or units, again. `columns`: those of the map, with their
/// places among the cells; lines count from 1.
///
/// # Errors
/// With both lines, and what to do.
pub fn check(
    (head, cells): (&[String], &[String]),
    (columns, places): (&[Column<'_>], &[usize]),
    [head_line, line]: [u64; 2],
) -> Result<()> {
    let numbers = columns.iter().zip(places);
    let numbers = numbers.filter(|(column, _)| column.what != What::Direction);
    let read: Vec<&str> = numbers
        .filter_map(|(_, place)| cells.get(*place).map(String::as_str))
        .collect();
    let is_timed = columns.iter().any(|column| column.what == What::Time);
    let what = if are_names((head, cells), &read, is_timed) {
        "names of columns"
    } else if are_units(&read) {
        "units"
    } else {
        return Ok(());
    };
    let words: Vec<String> = cells.iter().map(|cell| shown(cell).to_string()).collect();
    bail!(
        "line {line}: {what} again ({}), the first are in line {head_line}: a second table begins there: write each table into a \
         file of its own, or remove this line where the same test goes on in the same units",
        words.join(", ")
    );
}

/// Whether most cells are those of the first line of names, or all that should be numbers are words and one is a name: one of
/// the first line, or that of a target or an angle, of a log a time. Words of failed readings (`ERR`, `lost`) are not such roles.
fn are_names((head, cells): (&[String], &[String]), read: &[&str], is_timed: bool) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let lower = |cell: &String| cell.to_lowercase();
    let pairs = head.iter().zip(cells);
    let same = pairs.filter(|(name, cell)| !cell.is_empty() && lower(name) == lower(cell));
    let n_same = same.count();
    let is_word = |cell: &&str| {
        let has = |is: fn(char) -> bool| cell.contains(is);
        let is_number = cell.starts_with(|letter: char| letter.is_ascii_digit() || letter == '-');
        has(char::is_alphabetic) && !is_number && !is_missing(cell)
    };
    let is_name = |cell: &&str| match role_of_name(cell) {
        Some(Role::Target | Role::Angle | Role::Radial) => true,
        Some(Role::Time) => is_timed,
        _ => false,
    };
    let are_words = read.len() >= 2 && read.iter().all(is_word);
    (n_same >= 2 && 2 * n_same > filled) || (are_words && (n_same >= 1 || read.iter().any(is_name)))
}

fn are_units(read: &[&str]) -> bool {
    let filled = || read.iter().copied().filter(|cell| !cell.is_empty());
    let n = filled().count();
    let is_bracketed = |cell: &str| cell.starts_with(['[', '(']);
    n > 0
        && stated::is_row(filled())
        && filled().all(|cell| is_bracketed(cell) || stated::of_cell(cell).unit().is_some())
}

#[cfg(test)]
mod tests {
    use super::super::map::Map;
    use super::super::sheet::Sheet;
    use super::super::table::Table;

    fn said(lines: &str) -> Result<usize, String> {
        let map: Map = serde_saphyr::from_str(
            "start_s: 0\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, run: n, target_mm: t, deviation_um: d, direction: w}\n",
        )
        .expect("a map");
        let rows: String = (0..20).map(|k| format!("1,up,{k},0.5\n")).collect();
        let text = format!("n,w,t,d\n{rows}{lines}{}", rows.replace("1,up", "2,up"));
        let sheet = Sheet::of_text(&text, ',').expect("rows");
        let table = Table::of(&sheet, &map, &[None; 4]).map_err(|error| format!("{error:#}"))?;
        Ok(table.rows.len())
    }

    #[test]
    fn names_and_units_further_down_are_refused_with_both_lines() {
        for (lines, words) in [
            (
                "n,w,t,d\n",
                "line 22: names of columns again (n, w, t, d), the first are in line 1",
            ),
            ("\n\nN,W,T,D\n", "line 24: names of columns again"),
            ("n,w,t,d_mm\n", "line 22: names of columns again"),
            (
                "run,direction,target_mm,deviation_mm\n",
                "line 22: names of columns again",
            ),
            (
                "Lauf,Richtung,Soll,Abweichung\n",
                "a second table begins there",
            ),
            (",,mm,mm\n", "line 22: units again"),
            (",,[mm],[nm]\n", "line 22: units again"),
        ] {
            let refused = said(lines).expect_err(lines);
            assert!(refused.contains(words), "{lines}: {refused}");
        }
    }

    #[test]
    fn odd_cells_and_missing_readings_are_no_names() {
        for (lines, rows) in [
            ("", 40),
            ("1,up,20,n/a\n", 41),
            ("1,up,20,oops\n", 41),
            ("four,up,20,0.5\n", 40),
            ("nan,up,nan,nan\n", 40),
        ] {
            assert_eq!(said(lines), Ok(rows), "{lines}");
        }
    }

    #[test]
    fn words_of_a_failed_reading_are_an_odd_row_where_no_column_numbers_the_runs() {
        let rows_with = |line: &str| {
            let map: Map = serde_saphyr::from_str(
                "start_s: 0\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, target_mm: t, deviation_um: d}\n",
            )
            .expect("a map");
            let rows: String = (0..20).map(|k| format!("{k},0.5\n")).collect();
            let sheet = Sheet::of_text(&format!("t,d\n{rows}{line}\n{rows}"), ',').expect("rows");
            let table = Table::of(&sheet, &map, &[None; 2]);
            table
                .map(|table| (table.rows.len(), table.odd.len()))
                .map_err(|error| format!("{error:#}"))
        };
        for line in [
            "ERR,ERR",
            "lost,beam",
            "no signal,no signal",
            "ERR,timeout",
            "fault,overrange",
        ] {
            assert_eq!(rows_with(line), Ok((40, 1)), "{line}");
        }
        for line in [
            "t,d",
            "T,error",
            "target,deviation",
            "Soll,Abweichung",
            "position,value",
        ] {
            let refused = rows_with(line).expect_err(line);
            assert!(
                refused.contains("line 22: names of columns again"),
                "{refused}"
            );
        }
    }
}
