//! Cells that were merged: a run or a direction that stands in the first row of its block alone.

use std::borrow::Cow;

use super::map::{Column, What};

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

/// Lines whose empty cells of runs and directions have the value above them, where most rows have none; what was done. `at` is
/// the place of the line of names.
pub fn filled<'l>(
    lines: &'l Lines,
    at: usize,
    (columns, places): (&[Column<'_>], &[usize]),
) -> (Cow<'l, Lines>, Option<String>) {
    let is_block = |column: &Column<'_>| matches!(column.what, What::Run | What::Direction);
    let rows = lines.get(at + 1..).unwrap_or_default();
    let of_blocks = columns.iter().zip(places);
    let of_blocks = of_blocks.filter(|(column, _)| is_block(column));
    let merged: Vec<(&str, usize)> = of_blocks
        .filter(|(_, place)| is_merged(rows, **place))
        .map(|(column, place)| (column.name, *place))
        .collect();
    if merged.is_empty() {
        return (Cow::Borrowed(lines), None);
    }
    let mut all = lines.to_vec();
    for (_, place) in &merged {
        let mut last = String::new();
        for (_, cells) in all.iter_mut().skip(at + 1) {
            let is_row = cells.iter().any(|cell| !cell.is_empty());
            match cells.get_mut(*place) {
                Some(cell) if cell.is_empty() && is_row => cell.clone_from(&last),
                Some(cell) if is_row => last.clone_from(cell),
                _ => {}
            }
        }
    }
    let names: Vec<String> = merged
        .iter()
        .map(|(name, _)| format!("\"{name}\""))
        .collect();
    let said = format!(
        "column {}: stands in the first row of each block alone, as merged cells do: the rows below were taken to have the same",
        names.join(", ")
    );
    (Cow::Owned(all), Some(said))
}

/// Whether a column has a value in the first row, several in all, and none in most rows.
fn is_merged(rows: &Lines, place: usize) -> bool {
    let cells = rows
        .iter()
        .filter(|(_, cells)| cells.iter().any(|cell| !cell.is_empty()));
    let has: Vec<bool> = cells
        .map(|(_, cells)| cells.get(place).is_some_and(|cell| !cell.is_empty()))
        .collect();
    let n = has.iter().filter(|has| **has).count();
    has.first() == Some(&true) && n >= 2 && 2 * n < has.len()
}

#[cfg(test)]
mod tests {
    use super::super::map::Map;
    use super::super::sheet::Sheet;
    use super::super::table::Table;

    fn read(text: &str) -> Result<(Vec<Vec<f64>>, Vec<String>), String> {
        let map = "start_s: 0\ntest:\n  positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, run: n, direction: w, target_mm: t, deviation_um: d}\n";
        let map: Map = serde_saphyr::from_str(map).expect("a map");
        let sheet = Sheet::of_text(text, ',').expect("rows");
        let table = Table::of(&sheet, &map, &[None; 4]).map_err(|error| format!("{error:#}"))?;
        let rows = table.rows.into_iter().map(|row| row.cells).collect();
        Ok((rows, table.left_out))
    }

    #[test]
    fn a_run_and_a_direction_in_the_first_row_of_a_block_hold_for_it() {
        let merged = "n,w,t,d\n1,up,0,1\n,,50,2\n,,100,3\n1,down,100,4\n,,50,5\n,,0,6\n";
        let (rows, said) = read(merged).expect("rows");
        let whole =
            "n,w,t,d\n1,up,0,1\n1,up,50,2\n1,up,100,3\n1,down,100,4\n1,down,50,5\n1,down,0,6\n";
        let (wanted, unsaid) = read(whole).expect("rows");
        assert_eq!(rows, wanted);
        assert!(
            said[0].starts_with("column \"n\", \"w\": stands in the first row"),
            "{said:?}"
        );
        assert!(unsaid.is_empty(), "{unsaid:?}");
        // One cell that was forgotten is no block.
        let slip =
            "n,w,t,d\n1,up,0,1\n1,,50,2\n1,up,100,3\n1,down,100,4\n1,down,50,5\n1,down,0,6\n";
        let (rows, _) = read(slip).map_or((vec![], vec![]), |read| read);
        assert!(rows.len() < 6);
    }
}
