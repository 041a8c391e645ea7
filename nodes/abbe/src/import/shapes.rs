//! Rows of one shape, whatever their table had: of a positioning test run, target, deviation and, where it is known, direction.

use std::collections::BTreeMap;

use super::map::{Map, Pass, Test};
use super::runs::GRID_MM;
use super::table::Row;
use super::touches;

/// Rows as every kind of table of a test has them.
pub fn shaped(rows: Vec<Row>, map: &Map) -> Vec<Row> {
    let passes = map.test.passes();
    match &map.test {
        Test::Positioning { run: None, .. } if passes.is_empty() => {
            rows.into_iter().map(numbered).collect()
        }
        Test::Touches { .. } => touches::shaped(rows, &map.test),
        _ if passes.is_empty() => rows,
        Test::Positioning { run: Some(_), .. } => of_runs(rows, passes),
        _ => of_passes(rows, passes),
    }
}

/// A row without a number of run as one of the first.
fn numbered(row: Row) -> Row {
    let Row { line, mut cells } = row;
    cells.insert(0, 1.0);
    Row { line, cells }
}

/// Each column of a pass is a run; where both directions stand in two columns and targets come again, each repetition is one.
fn of_passes(rows: Vec<Row>, passes: &[Pass]) -> Vec<Row> {
    let mut seen: BTreeMap<i64, u32> = BTreeMap::new();
    let counted: Vec<f64> = rows
        .iter()
        .map(|row| {
            let n = seen
                .entry((row.cells[0] / GRID_MM).round() as i64)
                .or_insert(0);
            *n += 1;
            f64::from(*n)
        })
        .collect();
    let is_once = counted.iter().all(|n| n.total_cmp(&1.0).is_eq());
    if !is_once && passes.len() <= 2 {
        let number = |(row, n): (Row, f64)| {
            let Row { line, mut cells } = row;
            cells.insert(0, n);
            Row { line, cells }
        };
        return of_runs(rows.into_iter().zip(counted).map(number).collect(), passes);
    }
    let mut shaped = vec![];
    for (k, pass) in (1_u32..).zip(passes) {
        shaped.extend(of_pass(&rows, pass, |row| {
            let read = row.cells.get(k as usize).copied();
            [f64::from(k), row.cells[0], read.unwrap_or(f64::NAN)]
        }));
    }
    shaped
}

/// Rows with their number of run, and a column for each direction.
fn of_runs(rows: Vec<Row>, passes: &[Pass]) -> Vec<Row> {
    let mut runs: Vec<Vec<Row>> = vec![];
    let mut places: BTreeMap<u64, usize> = BTreeMap::new();
    for row in rows {
        let place = *places
            .entry(row.cells[0].to_bits())
            .or_insert_with(|| runs.len());
        match runs.get_mut(place) {
            Some(run) => run.push(row),
            None => runs.push(vec![row]),
        }
    }
    let mut shaped = vec![];
    for rows in &runs {
        for (k, pass) in passes.iter().enumerate() {
            shaped.extend(of_pass(rows, pass, |row| {
                let read = row.cells.get(k + 2).copied();
                [row.cells[0], row.cells[1], read.unwrap_or(f64::NAN)]
            }));
        }
    }
    shaped
}

/// The rows of one pass in the order of its measurement.
fn of_pass(rows: &[Row], pass: &Pass, cells: impl Fn(&Row) -> [f64; 3]) -> Vec<Row> {
    let sign = pass.direction.sign();
    let row = |row: &Row| Row {
        line: row.line,
        cells: cells(row).into_iter().chain([sign]).collect(),
    };
    let mut own: Vec<Row> = rows.iter().map(row).collect();
    own.sort_by(|a, b| (sign * a.cells[1]).total_cmp(&(sign * b.cells[1])));
    own
}

#[cfg(test)]
mod tests {
    use super::super::runs;
    use super::super::sheet::Sheet;
    use super::super::table::Table;
    use super::*;

    fn read(keys: &str, text: &str) -> Vec<Vec<Vec<f64>>> {
        let test = format!(
            "{{axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, {keys}target_mm: t, passes_um: [{{column: u, direction: up}}, {{column: d, direction: down}}]}}"
        );
        let map = format!("start_s: 0\ntest:\n  positioning: {test}\n");
        let map: Map = serde_saphyr::from_str(&map).expect("a map");
        map.check_columns().expect("columns");
        let sheet = Sheet::of_text(text, ',').expect("rows");
        let table = Table::of(&sheet, &map, &[None; 4]).expect("a table");
        let runs = runs::of(&map.test, &table).expect("runs");
        let cells = |rows: &Vec<Row>| rows.iter().map(|row| row.cells.clone()).collect();
        runs.runs.iter().map(cells).collect()
    }

    #[test]
    fn a_row_for_a_run_and_a_target_with_a_column_up_and_one_down_is_both_ways() {
        let rows = [
            (1, 0, 0.5, 1.5),
            (1, 9, 0.6, 1.6),
            (2, 0, 0.7, 1.7),
            (2, 9, 0.8, 1.8),
        ];
        let with = rows.map(|(run, target, up, down)| format!("{run},{target},{up},{down}\n"));
        let without = rows.map(|(_, target, up, down)| format!("{target},{up},{down}\n"));
        let wanted = vec![
            vec![
                vec![1.0, 0.0, 0.5, 1.0],
                vec![1.0, 9.0, 0.6, 1.0],
                vec![1.0, 9.0, 1.6, -1.0],
                vec![1.0, 0.0, 1.5, -1.0],
            ],
            vec![
                vec![2.0, 0.0, 0.7, 1.0],
                vec![2.0, 9.0, 0.8, 1.0],
                vec![2.0, 9.0, 1.8, -1.0],
                vec![2.0, 0.0, 1.7, -1.0],
            ],
        ];
        let text = format!("n,t,u,d\n{}", with.concat());
        assert_eq!(read("run: n, ", &text), wanted);
        let text = format!("t,u,d\n{}", without.concat());
        assert_eq!(read("", &text), wanted);
    }
}
