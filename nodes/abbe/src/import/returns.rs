//! Passes that begin anew at an end without a number of the run: the machine came back without a reading between.

use std::cmp::Ordering;

use super::runs::GRID_MM;
use super::table::Row;

/// Fewest targets of which a way back leaves one out.
const LEAST_TARGETS: usize = 3;

/// Where a row stands among all targets.
fn places(rows: &[Row]) -> (Vec<usize>, usize) {
    let grid = |row: &Row| (row.cells[1] / GRID_MM).round() as i64;
    let mut all: Vec<i64> = rows.iter().map(grid).collect();
    all.sort_unstable();
    all.dedup();
    let place = |row: &Row| all.binary_search(&grid(row)).unwrap_or_default();
    (rows.iter().map(place).collect(), all.len())
}

/// Whether a step goes from one end of the targets to the other and leaves targets out: either end may lack its first row.
fn is_return([from, to]: [usize; 2], n_targets: usize) -> bool {
    let (low, high) = (from.min(to), from.max(to));
    low <= 1 && high + 2 >= n_targets && high > low + 1
}

/// The passes of rows that begin anew at an end, and what was done; none where the machine never came back unread, or where
/// the rows are no passes of targets one behind another.
pub fn apart(rows: &[Row]) -> Option<(Vec<Vec<Row>>, String)> {
    let (places, n_targets) = places(rows);
    if n_targets < LEAST_TARGETS {
        return None;
    }
    let mut passes: Vec<Vec<Row>> = vec![];
    let mut before: Option<usize> = None;
    let mut way: Option<Ordering> = None;
    let mut n_returns = 0;
    for (row, place) in rows.iter().zip(places) {
        let step = before.map(|before| place.cmp(&before));
        let is_back = before.is_some_and(|before| is_return([before, place], n_targets));
        n_returns += usize::from(is_back);
        let goes_on =
            !is_back && step.is_some_and(|step| step.is_ne() && way.is_none_or(|way| way == step));
        match passes.last_mut().filter(|_| goes_on) {
            Some(pass) => {
                pass.push(row.clone());
                way = step;
            }
            None => {
                passes.push(vec![row.clone()]);
                way = None;
            }
        }
        before = Some(place);
    }
    if n_returns == 0 || passes.iter().any(|pass| pass.len() < 2) {
        return None;
    }
    for (number, pass) in (1..).zip(&mut passes) {
        for row in pass {
            row.cells[0] = f64::from(number);
        }
    }
    let n = passes.len();
    Some((
        passes,
        format!(
            "no number of a run: the rows begin anew at an end {n_returns} times, and were taken as {n} passes; how the machine came back is not known"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::super::passes::repetitions;
    use super::*;

    fn rows(targets: &[f64]) -> Vec<Row> {
        let row = |(k, target): (usize, &f64)| Row {
            line: k as u64 + 2,
            cells: vec![1.0, *target, 100.0 + k as f64],
        };
        targets.iter().enumerate().map(row).collect()
    }

    fn targets(runs: &[Vec<Row>]) -> Vec<Vec<f64>> {
        let run = |rows: &Vec<Row>| rows.iter().map(|row| row.cells[1]).collect();
        runs.iter().map(run).collect()
    }

    #[test]
    fn passes_from_one_side_keep_their_targets_at_both_ends() {
        for n in [3, 4, 5, 12] {
            for n_passes in [2, 5, 7] {
                for way in [1.0, -1.0] {
                    let pass: Vec<f64> = (0..n).map(|k| way * 40.5 * f64::from(k) - 7.0).collect();
                    let all = vec![pass.clone(); n_passes];
                    let found = repetitions(rows(&all.concat())).unwrap();
                    let (runs, remark) = (found.runs, found.remarks.join("\n"));
                    assert_eq!(targets(&runs), all, "{n} targets, {way}");
                    assert!(remark.contains("begin anew at an end"), "{remark}");
                    let numbers = runs.iter().map(|rows| rows[0].cells[0]);
                    assert!(numbers.eq((1..=n_passes).map(|k| k as f64)));
                }
            }
        }
    }

    #[test]
    fn a_pass_that_lacks_a_row_at_an_end_and_passes_of_both_sides_are_apart_too() {
        let up = [0.0, 9.0, 20.0, 31.0, 40.0];
        let down = [40.0, 31.0, 20.0, 9.0, 0.0];
        for all in [
            vec![up.to_vec(), up[1..].to_vec(), up.to_vec()],
            vec![up.to_vec(), up[..4].to_vec(), up.to_vec()],
            vec![up.to_vec(), up.to_vec(), up[..2].to_vec()],
            vec![up.to_vec(), up.to_vec(), down.to_vec(), down.to_vec()],
            vec![down.to_vec(), down.to_vec(), up.to_vec(), up.to_vec()],
        ] {
            let (runs, _) = apart(&rows(&all.concat())).expect("passes");
            assert_eq!(targets(&runs), all);
        }
    }

    #[test]
    fn cycles_step_cycles_and_pilgrim_steps_are_no_passes_from_one_side() {
        for all in [
            vec![
                0.0, 9.0, 20.0, 20.0, 9.0, 0.0, 0.0, 9.0, 20.0, 20.0, 9.0, 0.0,
            ],
            vec![0.0, 9.0, 20.0, 31.0, 20.0, 9.0, 0.0, 9.0, 20.0, 31.0],
            vec![0.0, 0.0, 0.0, 9.0, 9.0, 9.0, 20.0, 20.0, 20.0],
            vec![0.0, 30.0, 10.0, 40.0, 20.0, 50.0, 30.0, 60.0],
            vec![0.0, 100.0, 0.0, 100.0],
            vec![0.0, 9.0, 20.0],
        ] {
            assert!(apart(&rows(&all)).is_none(), "{all:?}");
        }
    }
}
