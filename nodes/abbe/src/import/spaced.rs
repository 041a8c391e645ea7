//! Texts whose cells are apart by blanks, as LinuxCNC's `halsampler` writes them.
//!
//! A first line of numbers shows that there are no names: the columns are then `column 1`, `column 2` and so on. A line
//! `overrun` says that samples were lost there.

use anyhow::{Result, bail};

use super::sheet::{MOST_CELLS, MOST_COLUMNS};

/// What a sampler writes where it lost samples.
const OVERRUN_LINE: &str = "overrun";

/// Lines of cells, with the lines at which samples were lost.
#[derive(Debug, Default, PartialEq)]
pub struct Spaced {
    /// Lines that hold anything but comments; one of names, with number 0, where the file has none.
    pub lines: Vec<(u64, Vec<String>)>,
    /// Lines at which samples were lost.
    pub overruns: Vec<u64>,
}

/// Cuts a text at its blanks.
///
/// # Errors
/// When it has more cells or columns than are read.
pub fn cut(text: &str) -> Result<Spaced> {
    let mut spaced = Spaced::default();
    let mut n_cells = 0;
    for (n, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if line.eq_ignore_ascii_case(OVERRUN_LINE) {
            spaced.overruns.push(n);
            continue;
        }
        let cells: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        n_cells += cells.len();
        if cells.len() > MOST_COLUMNS as usize || n_cells > MOST_CELLS {
            bail!(
                "line {n}: {} columns, {n_cells} cells up to here: must be at most {MOST_COLUMNS} columns and {MOST_CELLS} cells: split the table",
                cells.len()
            );
        }
        spaced.lines.push((n, cells));
    }
    let are_numbers = |cells: &[String]| cells.iter().all(|cell| is_number(cell));
    let first = spaced.lines.first().map(|(_, cells)| cells);
    if let Some(n) = first.filter(|cells| are_numbers(cells)).map(Vec::len) {
        let names = (1..=n).map(|k| format!("column {k}")).collect();
        spaced.lines.insert(0, (0, names));
    }
    Ok(spaced)
}

fn is_number(cell: &str) -> bool {
    cell.replace(',', ".").parse::<f64>().is_ok()
}

/// What was lost, a sentence; none without a loss.
pub fn lost(overruns: &[u64]) -> Option<String> {
    let first = overruns.first()?;
    Some(format!(
        "warning, line {first}: \"{OVERRUN_LINE}\": samples were lost there, {} such lines: record again with a deeper buffer or a longer period",
        overruns.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::super::map::Map;
    use super::super::recognise::of_text;
    use super::super::sheet::Sheet;
    use super::super::table::Table;

    fn log(text: &str, keys: &str) -> Table {
        let map = format!("start_s: 0\nseparator: \" \"\ntest:\n  log: {{axis: Z, {keys}}}\n");
        let map: Map = serde_saphyr::from_str(&map).expect("a map");
        map.check_columns().expect("columns");
        let sheet = Sheet::of_text(text, ' ').expect("rows");
        Table::of(&sheet, &map, &[None; 3]).expect("a table")
    }

    #[test]
    fn samples_without_names_are_read_by_the_number_of_their_column() {
        let text = "0 0.000000 20.0000 \n1 -0.000072 20.1322 \noverrun\n5  -0.000001 20.2623\n";
        let keys = "time_s: column 1, displacement_um: column 2, period_ms: 500";
        let table = log(text, keys);
        let cells: Vec<&[f64]> = table.rows.iter().map(|row| &row.cells[..2]).collect();
        assert_eq!(cells, [[0.0, 0.0], [0.5, -0.000_072], [2.5, -0.000_001]]);
        assert!(table.odd.is_empty());
        let sheet = Sheet::of_text(text, ' ').expect("rows");
        assert_eq!(
            super::lost(&sheet.overruns).expect("a loss"),
            "warning, line 3: \"overrun\": samples were lost there, 1 such lines: record again with a deeper buffer or a longer period"
        );
        assert_eq!(super::lost(&[]), None);
        let lines: Vec<u64> = table.rows.iter().map(|row| row.line).collect();
        assert_eq!(lines, [1, 2, 4]);
    }

    #[test]
    fn names_apart_by_blanks_are_recognised_and_other_texts_are_as_before() {
        let found = of_text("t z T \n0 0.0 20.0 \n1 0.1 20.1 \n2 0.2 20.3\n");
        let found = found.expect("rows").expect("names");
        assert_eq!((found.separator, found.head_line), (' ', 1));
        let names: Vec<&str> = found
            .columns
            .iter()
            .map(|column| column.name.as_str())
            .collect();
        assert_eq!(names, ["t", "z", "T"]);
        let found = of_text("0 0.0 20.0\n1 0.1 20.1\n")
            .expect("rows")
            .expect("names");
        assert_eq!(found.columns[2].name, "column 3");
        let found = of_text("a;b\n1 2;3\n4 5;6\n").expect("rows");
        assert!(found.is_none_or(|found| found.separator == ';'));
        assert!(
            of_text("some words of a letter\nand more of them\n")
                .expect("lines")
                .is_none()
        );
    }
}
