//! Passes that are numbered as runs, and tables without a number of the run.
//!
//! A run of ISO 230-2 is a cycle: every target from both sides. Programs of lasers number each pass, and others nothing at
//! all; both are legal tables.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use iso230::positioning::whole_runs::{is_broken_off, n_of_complete};

use super::returns;
use super::runs::{GRID_MM, Runs, gathered, ways};
use super::table::Row;

/// Runs that are named one by one.
const NAMED: usize = 10;

fn n_read(rows: &[Row]) -> usize {
    rows.iter().filter(|row| row.cells[2].is_finite()).count()
}

/// Leaves out runs in which nothing was read, where others have readings; which they are.
pub fn without_readings(runs: &mut Vec<Vec<Row>>) -> Vec<String> {
    if runs.iter().all(|rows| n_read(rows) == 0) {
        return vec![];
    }
    let is_empty = |rows: &Vec<Row>| n_read(rows) == 0;
    let remarks = runs.iter().filter(|rows| is_empty(rows)).map(|rows| {
        let first = rows.first();
        format!(
            "run {}, line {} on: none of its {} rows has a reading: the run is left out",
            first.map_or(0.0, |row| row.cells[0]),
            first.map_or(0, |row| row.line),
            rows.len()
        )
    });
    let mut remarks: Vec<String> = remarks.collect();
    let others = remarks.len().saturating_sub(NAMED);
    remarks.truncate(NAMED);
    remarks.extend(
        (others > 0).then(|| format!("{others} more runs have no reading: they are left out")),
    );
    runs.retain(|rows| !is_empty(rows));
    remarks
}

/// Which runs were broken off, by the readings of the others.
pub fn are_broken_off(runs: &[Vec<Row>]) -> Vec<bool> {
    let n_complete = n_of_complete(runs.iter().map(|rows| n_read(rows)).collect());
    let is_one = |rows: &Vec<Row>| is_broken_off(n_read(rows), n_complete);
    runs.iter().map(is_one).collect()
}

/// Names runs that were broken off: an evaluation leaves them out.
pub fn broken_off(runs: &[Vec<Row>]) -> Vec<String> {
    let n_complete = n_of_complete(runs.iter().map(|rows| n_read(rows)).collect());
    let all = runs.iter().zip(are_broken_off(runs));
    let few = all.filter(|(_, is_one)| *is_one);
    few.filter_map(|(rows, _)| {
        let first = rows.first()?;
        Some(format!(
            "run {}, line {} on: {} readings where a complete run has {n_complete}: it was broken off, and an evaluation leaves it out whole: \
             repeat the run",
            first.cells[0],
            first.line,
            n_read(rows)
        ))
    })
    .take(NAMED)
    .collect()
}

/// Makes cycles of runs that hold one direction each, the k-th up with the k-th down; what was done.
pub fn pair(runs: &mut Vec<Vec<Row>>) -> Option<String> {
    let sides: Vec<f64> = runs.iter().map(|rows| side(rows)).collect::<Option<_>>()?;
    let of = |sign: f64| -> Vec<usize> {
        let places = sides.iter().enumerate();
        let own = places.filter(|(_, side)| **side * sign > 0.0);
        own.map(|(k, _)| k).collect()
    };
    let (ups, downs) = (of(1.0), of(-1.0));
    let (fewer, more) = (ups.len().min(downs.len()), ups.len().max(downs.len()));
    if fewer == 0 {
        return None;
    }
    let said = format!(
        "{} runs hold one direction each, {} up and {} down: they are passes",
        runs.len(),
        ups.len(),
        downs.len()
    );
    if 2 * fewer < more {
        // One stray pass makes no cycles of the others.
        let kept = if ups.len() > downs.len() {
            &ups
        } else {
            &downs
        };
        *runs = kept.iter().map(|k| runs[*k].clone()).collect();
        return Some(format!(
            "{said}. Too few of one direction to make cycles of: the {fewer} of it are left out, and the others are one-way"
        ));
    }
    let cycle = |(up, down): (&usize, &usize)| {
        let both = [*up.min(down), *up.max(down)];
        both.into_iter().flat_map(|k| runs[k].clone()).collect()
    };
    let cycles: Vec<Vec<Row>> = ups.iter().zip(&downs).map(cycle).collect();
    *runs = cycles;
    let without = if fewer < more {
        format!(
            "; the last {} have no partner and are left out",
            more - fewer
        )
    } else {
        String::new()
    };
    Some(format!(
        "{said}, and were taken as {fewer} cycles, the first up with the first down and so on{without}"
    ))
}

/// The one direction of a run; none where it has both, or where nothing shows it.
fn side(rows: &[Row]) -> Option<f64> {
    let first = rows.first()?;
    let ways = match first.cells.get(3) {
        Some(_) => rows
            .iter()
            .filter_map(|row| row.cells.get(3).copied())
            .collect(),
        None if rows.len() < 2 => return None,
        None => ways(rows),
    };
    let way = ways.first()?.signum();
    ways.iter().all(|other| other * way > 0.0).then_some(way)
}

/// Whether every row has a number of run of its own, so that these count rows and no runs.
pub fn are_rows(runs: &[Vec<Row>]) -> bool {
    runs.len() > 2 && runs.iter().all(|rows| rows.len() == 1)
}

/// Runs of rows without a number of run: every further visit of a target from one side belongs to a further run.
///
/// # Errors
/// With the line where the rows are neither in the order of the measurement nor have a column of the direction.
pub fn repetitions(rows: Vec<Row>) -> Result<Runs> {
    let is_told = rows.first().is_some_and(|row| row.cells.len() > 3);
    if let Some((runs, remark)) = returns::apart(&rows).filter(|_| !is_told) {
        return Ok(Runs {
            runs,
            remarks: vec![remark],
            is_order_known: true,
        });
    }
    let mut visits: BTreeMap<(i64, bool), f64> = BTreeMap::new();
    let ways = ways(&rows);
    let mut numbered = vec![];
    let mut last = 1.0;
    let mut steps_back = None;
    for (mut row, by_order) in rows.into_iter().zip(ways) {
        let way = row.cells.get(3).copied().unwrap_or(by_order);
        let place = (row.cells[1] / GRID_MM).round() as i64;
        let n = visits.entry((place, way > 0.0)).or_insert(0.0);
        *n += 1.0;
        if *n < last {
            steps_back.get_or_insert((row.line, row.cells.len() > 3));
        }
        last = *n;
        row.cells[0] = *n;
        numbered.push(row);
    }
    let by_number = "every repetition of a target from one side was taken as a run of its own";
    match steps_back {
        None => {
            let runs = numbered.chunk_by(|a, b| a.cells[0].total_cmp(&b.cells[0]).is_eq());
            let runs = runs.map(<[Row]>::to_vec).collect();
            Ok(Runs {
                runs,
                remarks: vec![format!("no number of a run: {by_number}")],
                is_order_known: true,
            })
        }
        Some((_, true)) => Ok(Runs {
            runs: gathered(&numbered),
            remarks: vec![format!(
                "no number of a run: {by_number}. The rows are not in the order of whole runs; they were gathered by run, upwards first and then \
                 downwards, and how long a stop came after another is not known"
            )],
            is_order_known: false,
        }),
        Some((line, false)) => bail!(
            "line {line}: a target comes again before the run ends, and the runs cannot be separated: name a column of the run or of the direction in the map"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TARGETS: [f64; 3] = [0.0, 9.0, 20.0];

    /// One pass; the reading is a hundred times its number plus the target.
    fn pass(number: f64, way: f64, is_told: bool) -> Vec<Row> {
        let mut targets = TARGETS.to_vec();
        if way < 0.0 {
            targets.reverse();
        }
        let row = |target: f64| {
            let mut cells = vec![number, target, 100.0 * number + target];
            cells.extend(is_told.then_some(way));
            Row { line: 2, cells }
        };
        targets.into_iter().map(row).collect()
    }

    fn readings(runs: &[Vec<Row>]) -> Vec<Vec<f64>> {
        let run = |rows: &Vec<Row>| rows.iter().map(|row| row.cells[2]).collect();
        runs.iter().map(run).collect()
    }

    #[test]
    fn a_run_without_a_reading_is_left_out_and_one_broken_off_is_named() {
        let good = || vec![pass(1.0, 1.0, true), pass(2.0, 1.0, true)];
        let blank = |n: usize| {
            let rows = pass(3.0, 1.0, true).into_iter().take(n);
            let empty = |mut row: Row| {
                row.cells[2] = f64::NAN;
                row
            };
            rows.map(empty).collect::<Vec<_>>()
        };
        for n in [1, 2, 3] {
            let mut runs = good();
            runs.push(blank(n));
            let said = without_readings(&mut runs);
            assert_eq!(runs.len(), 2);
            let words = format!("run 3, line 2 on: none of its {n} rows has a reading");
            assert!(said[0].starts_with(&words), "{said:?}");
        }
        let mut runs = vec![blank(3)];
        assert!(without_readings(&mut runs).is_empty() && runs.len() == 1);
        assert!(broken_off(&good()).is_empty());
        let mut runs = good();
        runs.push(pass(3.0, 1.0, true).into_iter().take(1).collect());
        let said = broken_off(&runs);
        let words = "run 3, line 2 on: 1 readings where a complete run has 3: it was broken off";
        assert!(said.len() == 1 && said[0].starts_with(words), "{said:?}");
    }

    #[test]
    fn the_kth_pass_up_and_the_kth_down_are_a_cycle() {
        for is_told in [true, false] {
            let ways = [1.0, -1.0, 1.0, -1.0];
            let mut runs: Vec<Vec<Row>> = (1..=4)
                .map(|k| pass(f64::from(k), ways[k as usize - 1], is_told))
                .collect();
            let said = pair(&mut runs).expect("a remark");
            assert!(
                said.contains("4 runs hold one direction each, 2 up and 2 down"),
                "{said}"
            );
            assert_eq!(
                readings(&runs),
                [
                    [100.0, 109.0, 120.0, 220.0, 209.0, 200.0],
                    [300.0, 309.0, 320.0, 420.0, 409.0, 400.0]
                ]
            );
            // They are whole now.
            assert_eq!(pair(&mut runs), None);
        }
    }

    #[test]
    fn passes_without_a_partner_are_told() {
        let all = [1.0, 1.0, -1.0, 1.0, -1.0];
        let passes = |n: usize| -> Vec<Vec<Row>> {
            let ways = all[..n].iter().enumerate();
            ways.map(|(k, way)| pass((k + 1) as f64, *way, true))
                .collect()
        };
        let mut five = passes(5);
        let said = pair(&mut five).expect("a remark");
        assert!(
            said.contains("2 cycles") && said.contains("the last 1 have no partner"),
            "{said}"
        );
        assert_eq!(readings(&five)[0][..3], [100.0, 109.0, 120.0]);
        assert_eq!(readings(&five)[0][3..], [320.0, 309.0, 300.0]);
        // Two of one way alone are no cycle, nor is a run with both.
        assert_eq!(pair(&mut passes(2)), None);
        let mut mixed = vec![
            [pass(1.0, 1.0, true), pass(1.0, -1.0, true)].concat(),
            pass(2.0, 1.0, true),
        ];
        assert_eq!(pair(&mut mixed), None);
        let mut stray: Vec<Vec<Row>> = (1..=4).map(|k| pass(f64::from(k), 1.0, true)).collect();
        stray.push(pass(5.0, -1.0, true));
        let said = pair(&mut stray).expect("a remark");
        assert!(said.contains("the others are one-way"), "{said}");
        assert_eq!(stray.len(), 4);
    }

    #[test]
    fn rows_without_a_number_of_run_are_counted_by_target_and_side() {
        let cycle = |n: f64| [pass(n, 1.0, true), pass(n, -1.0, true)].concat();
        let wanted = vec![cycle(1.0), cycle(2.0)];
        let unnumbered = |row: &Row| Row {
            line: row.line,
            cells: [&[1.0][..], &row.cells[1..]].concat(),
        };
        let rows: Vec<Row> = wanted.iter().flatten().map(unnumbered).collect();
        assert_eq!(repetitions(rows.clone()).unwrap().runs, wanted);
        // Sorted by target: a step cycle, or a sheet that somebody sorted.
        let mut sorted = rows.clone();
        sorted.sort_by(|a, b| a.cells[1].total_cmp(&b.cells[1]));
        let found = repetitions(sorted.clone()).unwrap();
        assert_eq!(found.runs, wanted);
        let said = &found.remarks[0];
        assert!(said.contains("gathered") && !found.is_order_known, "{said}");
        // In the order of the measurement no column of the direction is needed, sorted one is.
        let bare = |rows: &[Row]| -> Vec<Row> {
            let cut = |row: &Row| Row {
                line: row.line,
                cells: row.cells[..3].to_vec(),
            };
            rows.iter().map(cut).collect()
        };
        assert_eq!(
            readings(&repetitions(bare(&rows)).unwrap().runs),
            readings(&wanted)
        );
        assert!(repetitions(bare(&sorted)).is_err());
    }
}
