//! Tables without a line of names, of which a map gives the columns by their numbers (`column 2`).
//!
//! Their first line is a row where each cell that the map names holds a value of its column: no name is a number.

use super::directions;
use super::map::{Column, Map, What};
use super::odd::is_missing;
use super::separators;
use super::sheet::Sheet;
use super::table::number_of;
use super::times;

/// Whether a map names every column by its number.
pub fn is_by_number(map: &Map) -> bool {
    let columns = map.test.columns();
    !columns.is_empty()
        && columns
            .iter()
            .all(|column| separators::by_number(column.name, usize::MAX).is_some())
}

/// Gives a table names where its first line is a row; what was done.
pub fn give_names(sheet: &mut Sheet, map: &Map) -> Option<String> {
    let columns = map.test.columns();
    let is_named = columns.iter().any(|column| sheet.has(column.name));
    let (line, first) = sheet.lines.first()?;
    if is_named || !is_by_number(map) || !is_row(first, &columns, map.decimal) {
        return None;
    }
    let said = format!(
        "line {line}: has values where names of columns stand, and the map gives numbers of columns: it was read as the first row"
    );
    let names = (1..=first.len()).map(|k| format!("column {k}")).collect();
    sheet.lines.insert(0, (0, names));
    Some(said)
}

/// Whether each cell that is named holds a value of its column, and one a number or a time.
fn is_row(cells: &[String], columns: &[Column<'_>], decimal: char) -> bool {
    let is_number = |cell: &str| number_of(cell, decimal).is_some();
    let is_time = |cell: &str| matches!(times::of_text(cell), Ok(Some(_)));
    let mut n_numbers = 0;
    let are_values = columns.iter().all(|column| {
        let place = separators::by_number(column.name, cells.len());
        let Some(cell) = place.and_then(|place| cells.get(place)) else {
            return false;
        };
        let is_value = match column.what {
            What::Direction => return directions::of_cell(cell).is_some(),
            What::Feature => return true,
            What::Time => is_number(cell) || is_time(cell),
            _ => is_number(cell),
        };
        n_numbers += usize::from(is_value);
        is_value || column.what.is_reading() && is_missing(cell)
    });
    are_values && n_numbers > 0
}

#[cfg(test)]
mod tests {
    use super::super::table::Table;
    use super::*;

    fn map(keys: &str) -> Map {
        let text = format!("start_s: 0\ntest:\n  {keys}\n");
        serde_saphyr::from_str(&text).expect("a map")
    }

    fn read(text: &str, map: &Map) -> (Vec<u64>, Option<String>) {
        let mut sheet = Sheet::of_text(text, ',').expect("rows");
        let said = give_names(&mut sheet, map);
        let ranges = vec![None; map.test.columns().len()];
        let table = Table::of(&sheet, map, &ranges).expect("a table");
        (table.rows.iter().map(|row| row.line).collect(), said)
    }

    #[test]
    fn the_first_line_is_a_row_where_it_holds_values_and_the_map_gives_numbers() {
        let stops = "positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, run: column 1, direction: column 2, target_mm: column 3, deviation_um: column 4}";
        let log = "log: {axis: Z, time_s: column 1, displacement_um: column 2}";
        for (keys, first, next) in [
            (stops, "1,up,0,0.5", "1,up,50,0.7"),
            (stops, "1,-1,0,0.5", "1,-1,50,0.7"),
            (stops, "1,auf,0,", "1,auf,50,0.7"),
            (stops, "1,up,0,0.5,Otto", "1,up,50,0.7,Otto"),
            (log, "0,0.5", "30,0.7"),
            (log, "2026-01-05 08:00:00,0.5", "2026-01-05 08:00:30,0.7"),
            (log, "08:00:00,NaN", "08:00:30,0.7"),
        ] {
            let (lines, said) = read(&format!("# a comment\n{first}\n{next}\n"), &map(keys));
            assert_eq!(lines, [2, 3], "{first}");
            assert!(said.expect(first).starts_with("line 2: has values"));
        }
        for head in ["n,w,t,d", "1,2,3,d", "Lauf,auf,Soll,Ist", "-,-,-,-"] {
            let (lines, said) = read(&format!("{head}\n1,up,0,0.5\n1,up,50,1\n"), &map(stops));
            assert_eq!((lines, said), (vec![2, 3], None), "{head}");
        }
        let named = stops.replace("column 4", "d");
        let (lines, said) = read("1,2,3,d\n1,up,0,0.5\n", &map(&named));
        assert_eq!((lines, said), (vec![2], None));
    }
}
