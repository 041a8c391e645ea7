//! Which rows of a table are one run, and in what order they were measured.
//!
//! Rows with one number of run that stand together are a run, in the order of the measurement. A number that comes
//! again after another one shows that the table was sorted by something else. Of a positioning test with a column of
//! the direction the rows of each number are then gathered, upwards by ascending target first and downwards behind; of
//! every other test the order of the measurement is lost, and the table is refused. Rows that are listed by target are put in
//! order by their directions ([`listed`]). Targets that are meant to be one become
//! one ([`same`]), rows without a number of run are counted, and passes that are numbered as runs become cycles
//! ([`passes`]).

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail};
use metrology::Axis;
use metrology::number::number;

use super::doubled;
use super::lacking;
use super::limits::Range;
use super::listed;
use super::map::{Test, Units, units};
use super::passes;
use super::same;
use super::table::{Row, Table};
use super::touches;

/// Targets nearer than this are one, mm.
pub const SAME_TARGET_MM: f64 = 1e-9;
/// Spacing of the grid on which targets are compared from run to run, mm.
pub const GRID_MM: f64 = 1e-6;

/// Targets of a turning point that lie closer may be meant to be one, mm or deg.
const MOST_JITTER: f64 = 1.0;
/// Most runs of a table: a test has some ten, and every one is evaluated.
pub const MOST_RUNS: usize = 10_000;
/// The runs of a table.
#[derive(Debug)]
pub struct Runs {
    /// Rows of each, in the order of the measurement.
    pub runs: Vec<Vec<Row>>,
    /// What a reader should know of them.
    pub remarks: Vec<String>,
    /// Whether rows came in the order of the measurement.
    pub is_order_known: bool,
}

/// Finds the runs of a test's table.
///
/// # Errors
/// Line and remedy where rows contradict their column of the direction, repeat each other, or are in no order from
/// which the motion follows.
pub fn of(test: &Test, table: &Table) -> Result<Runs> {
    let mut runs = match test {
        Test::Touches { .. } => touches::runs(test, table)?,
        _ => ordered(test, table)?,
    };
    let n = runs.runs.len();
    if n > MOST_RUNS {
        let column = test.run().map_or(String::new(), |column| {
            format!(": does the column \"{column}\" number the runs?")
        });
        bail!("{n} runs: must be at most {MOST_RUNS}{column}");
    }
    runs.remarks.extend(table.odd.iter().cloned());
    Ok(runs)
}

/// The runs in the order of their measurement.
fn ordered(test: &Test, table: &Table) -> Result<Runs> {
    let Runs {
        mut runs,
        mut remarks,
        mut is_order_known,
    } = numbered(test, table)?;
    let Test::Positioning {
        axis,
        run,
        same_target_um,
        ..
    } = test
    else {
        return Ok(Runs {
            runs,
            remarks,
            is_order_known,
        });
    };
    let units = units(*axis);
    let relisted = listed::relist(&mut runs);
    is_order_known &= relisted.is_none();
    remarks.extend(relisted);
    if let Some(turn) = units.turn {
        remarks.extend(unwrap(&mut runs, turn));
    }
    remarks.extend(same::merge(&mut runs, *same_target_um, units));
    doubled::check(&runs, units)?;
    let is_counted = run.is_none() && test.passes().is_empty();
    if is_counted || passes::are_rows(&runs) {
        let counted = passes::repetitions(runs.concat())?;
        runs = counted.runs;
        remarks.extend(counted.remarks);
        is_order_known &= counted.is_order_known;
    }
    remarks.extend(passes::without_readings(&mut runs));
    remarks.extend(passes::pair(&mut runs));
    remarks.extend(passes::broken_off(&runs));
    check_directions(&runs, units)?;
    let doubt = listed::doubt(&runs);
    is_order_known &= doubt.is_none();
    remarks.extend(doubt);
    remarks.extend(lacking::check_targets(&runs, units)?);
    Ok(Runs {
        runs,
        remarks,
        is_order_known,
    })
}

/// The runs by their numbers.
fn numbered(test: &Test, table: &Table) -> Result<Runs> {
    let column = match test.run() {
        Some(column) => column,
        None if !test.passes().is_empty() => "",
        None => {
            return Ok(Runs {
                runs: vec![table.rows.clone()],
                remarks: vec![],
                is_order_known: true,
            });
        }
    };
    let together: Vec<&[Row]> = table
        .rows
        .chunk_by(|a, b| a.cells[0].total_cmp(&b.cells[0]).is_eq())
        .collect();
    let mut remarks = vec![];
    let runs = match again(&together) {
        None => together.iter().map(|rows| rows.to_vec()).collect(),
        Some((row, before)) if test.direction().is_some() => {
            remarks.push(format!(
                "run {} comes again in line {}, after run {before}: the rows are not in the order of the measurement. They were gathered by run, \
                 upwards first and then downwards; how long a stop came after another is not known",
                row.cells[0], row.line
            ));
            gathered(&table.rows)
        }
        Some((row, before)) => {
            let remedy = if matches!(test, Test::Positioning { .. }) {
                "; or name a column of the direction in the map"
            } else {
                ""
            };
            bail!(
                "line {}: column \"{column}\": run {} comes again after run {before}, so the order of the measurement is lost: \
                 put the rows of a run one after another, as they were measured{remedy}",
                row.line,
                row.cells[0],
            );
        }
    };
    Ok(Runs {
        is_order_known: remarks.is_empty(),
        runs,
        remarks,
    })
}

/// The first row whose number of run was there before another number, with that number.
fn again<'a>(together: &[&'a [Row]]) -> Option<(&'a Row, f64)> {
    let mut seen = BTreeSet::new();
    let mut before = None;
    for rows in together {
        let first = rows.first()?;
        let number = first.cells[0];
        if !seen.insert(number.to_bits()) {
            return Some((first, before?));
        }
        before = Some(number);
    }
    None
}

/// Rows by their number of run, upwards by ascending target, then downwards by descending target.
pub fn gathered(rows: &[Row]) -> Vec<Vec<Row>> {
    let mut runs: Vec<Vec<Row>> = vec![];
    let mut places = BTreeMap::new();
    for row in rows {
        let place = *places
            .entry(row.cells[0].to_bits())
            .or_insert_with(|| runs.len());
        match runs.get_mut(place) {
            Some(run) => run.push(row.clone()),
            None => runs.push(vec![row.clone()]),
        }
    }
    for run in &mut runs {
        run.sort_by(|a, b| {
            let (down_a, down_b) = (a.cells[3] < 0.0, b.cells[3] < 0.0);
            let targets = a.cells[1].total_cmp(&b.cells[1]);
            let targets = if down_a { targets.reverse() } else { targets };
            down_a.cmp(&down_b).then(targets)
        });
    }
    runs
}

/// Counts targets of a rotary axis on where they wrap: a step against its direction of more than half a turn goes on beyond
/// the turn. Without a column of directions nothing shows that a step wrapped.
fn unwrap(runs: &mut [Vec<Row>], turn: f64) -> Option<String> {
    let mut n = 0;
    for rows in runs {
        let mut added = 0.0;
        let mut before: Option<f64> = None;
        for row in rows {
            let told = row.cells.get(3).copied().unwrap_or(0.0);
            let step = before.map_or(0.0, |before| row.cells[1] + added - before);
            if told * step < 0.0 && step.abs() > turn / 2.0 {
                added += told.signum() * turn;
                n += 1;
            }
            row.cells[1] += added;
            before = Some(row.cells[1]);
        }
    }
    (n > 0).then(|| {
        format!(
            "targets wrap {n} times at {turn} deg against their direction: they were counted on"
        )
    })
}

/// Refuses targets that the axis cannot reach once they were counted on, and places where a linear axis would have turned
/// round beyond its travel; those of a rotary axis, whose travel may be one of the control's alone, are remarks.
///
/// # Errors
/// With line, value and travel.
pub fn check_travel(
    runs: &Runs,
    travel: Option<&Range>,
    (axis, overrun): (Axis, f64),
) -> Result<Option<String>> {
    let Some(travel) = travel else {
        return Ok(None);
    };
    if let Some(row) = { runs.runs.iter().flatten() }.find(|row| !travel.holds(row.cells[1])) {
        bail!(
            "line {}: target {}: must be {travel}",
            row.line,
            row.cells[1]
        );
    }
    let turns = runs.runs.iter().flat_map(|rows| turns(rows, overrun));
    let mut beyond = turns.filter(|(_, at)| !travel.holds(*at));
    let Some((row, at)) = beyond.next() else {
        return Ok(None);
    };
    let others = beyond.count();
    let units = units(axis);
    let key = units.keys[1];
    let words = format!(
        "line {}: target {} {unit} with test.positioning.{key} = {} {unit}: {axis} turns round at {} {unit}: must be {travel}; \
         correct {key} in the map, or travel_{unit} in the machine file{}",
        row.line,
        row.cells[1],
        number(overrun),
        number(at),
        if others > 0 {
            format!(" (places beyond it: {})", others + 1)
        } else {
            String::new()
        },
        unit = units.target
    );
    if axis.is_linear() {
        bail!("{words}");
    }
    Ok(Some(words))
}

/// Where a run turns round beyond a target, and the row of the target: before its first one, and between two rows of one.
fn turns(rows: &[Row], overrun: f64) -> Vec<(&Row, f64)> {
    let is_turn = |k: usize| match k.checked_sub(1).and_then(|before| rows.get(before)) {
        None => true,
        Some(before) => (rows[k].cells[1] - before.cells[1]).abs() <= SAME_TARGET_MM,
    };
    let ways = ways(rows).into_iter().zip(rows).enumerate();
    ways.filter(|(k, _)| is_turn(*k))
        .map(|(_, (way, row))| (row, row.cells[1] - way * overrun))
        .collect()
}

/// Sign of the approach to the first target of a run, as its row states it. Without it, the sign of the way to the next
/// other target.
pub fn first_way(rows: &[Row]) -> f64 {
    let first_mm = rows[0].cells[1];
    let told = rows[0].cells.get(3).copied();
    let mut ways = rows.iter().map(|row| row.cells[1] - first_mm);
    told.unwrap_or_else(|| {
        ways.find(|way| way.abs() > SAME_TARGET_MM)
            .unwrap_or(1.0)
            .signum()
    })
}

/// From which side each target of a run is approached, by the order of its rows.
pub fn ways(rows: &[Row]) -> Vec<f64> {
    let mut way = first_way(rows);
    let mut all = vec![way];
    for two in rows.windows(2) {
        let by_mm = two[1].cells[1] - two[0].cells[1];
        way = if by_mm.abs() > SAME_TARGET_MM {
            by_mm.signum()
        } else {
            -way
        };
        all.push(way);
    }
    all
}

/// A side of approach in words.
pub const fn word(way: f64) -> &'static str {
    if way > 0.0 { "up" } else { "down" }
}

/// Refuses rows whose order makes another direction than their column tells.
fn check_directions(runs: &[Vec<Row>], units: Units) -> Result<()> {
    for rows in runs {
        for (k, way) in ways(rows).into_iter().enumerate().skip(1) {
            let (row, before) = (&rows[k], &rows[k - 1]);
            if row.cells.get(3).is_some_and(|told| *told * way < 0.0) {
                let apart = row.cells[1] - before.cells[1];
                if apart.abs() < MOST_JITTER && row.cells.get(3) != before.cells.get(3) {
                    bail!("{}", jitter(row, before, units));
                }
                bail!(
                    "line {}: run {}: target {} {unit} after {} {unit} is approached {}, and its direction says {}: rows must be in the order of the measurement",
                    row.line,
                    row.cells[0],
                    row.cells[1],
                    before.cells[1],
                    word(way),
                    word(-way),
                    unit = units.target
                );
            }
        }
    }
    Ok(())
}

/// Two targets at a turning point that are meant to be one.
fn jitter(row: &Row, before: &Row, units: Units) -> String {
    format!(
        "line {}: run {}: target {} {unit} after {} {unit}, where the direction turns: where they are meant to be one target, state \
         same_target_{} in the map, how far such targets differ",
        row.line,
        row.cells[0],
        row.cells[1],
        before.cells[1],
        units.of_cells[1].name(),
        unit = units.target
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn test(direction: bool) -> Test {
        Test::Positioning {
            axis: Axis::X,
            feed_mm_min: 6000.0,
            dwell_s: 2.0,
            overrun_mm: 5.0,
            run: Some("n".to_owned()),
            target_mm: "t".to_owned(),
            deviation_um: Some("d".to_owned()),
            measured_mm: None,
            passes_um: vec![],
            direction: direction.then(|| "way".to_owned()),
            same_target_um: None,
        }
    }

    fn table(rows: &[[f64; 4]], columns: usize) -> Table {
        let row = |(k, cells): (usize, &[f64; 4])| Row {
            line: k as u64 + 2,
            cells: cells[..columns].to_vec(),
        };
        Table {
            rows: rows.iter().enumerate().map(row).collect(),
            left_out: vec![],
            odd: vec![],
            features: vec![],
        }
    }

    const UP: f64 = 1.0;
    const DOWN: f64 = -1.0;

    /// Three runs over three targets, both ways, in the order of the measurement.
    fn measured() -> Vec<[f64; 4]> {
        let mut rows = vec![];
        for run in [1.0, 2.0, 3.0] {
            for target in [0.0, 9.0, 20.0] {
                rows.push([run, target, run + target, UP]);
            }
            for target in [20.0, 9.0, 0.0] {
                rows.push([run, target, run - target, DOWN]);
            }
        }
        rows
    }

    fn cells(runs: &Runs) -> Vec<Vec<Vec<f64>>> {
        let run = |rows: &Vec<Row>| rows.iter().map(|row| row.cells.clone()).collect();
        runs.runs.iter().map(run).collect()
    }

    #[test]
    fn a_table_in_any_order_gives_the_runs_as_they_were_measured() {
        let rows = measured();
        let wanted = cells(&of(&test(true), &table(&rows, 4)).unwrap());
        assert_eq!(wanted.len(), 3);
        type Order = fn(&[f64; 4], &[f64; 4]) -> std::cmp::Ordering;
        let orders: [Order; 4] = [
            |a, b| a[1].total_cmp(&b[1]),
            |a, b| a[3].total_cmp(&b[3]).then(a[1].total_cmp(&b[1])),
            |a, b| b[1].total_cmp(&a[1]),
            |a, b| a[2].total_cmp(&b[2]),
        ];
        for (k, order) in orders.iter().enumerate() {
            let mut sorted = rows.clone();
            sorted.sort_by(order);
            let runs = of(&test(true), &table(&sorted, 4)).unwrap();
            let mut found = cells(&runs);
            found.sort_by(|a, b| a[0][0].total_cmp(&b[0][0]));
            assert_eq!(found, wanted, "order {k}");
            assert!(
                runs.remarks[0].contains("comes again in line"),
                "{:?}",
                runs.remarks
            );
        }
    }

    #[test]
    fn more_runs_than_a_test_has_are_refused_and_as_many_are_read() {
        for direction in [true, false] {
            let columns = if direction { 4 } else { 3 };
            let rows = |n: usize| -> Vec<[f64; 4]> {
                let two = |k: usize| [0.0, 9.0].map(|target| [k as f64, target, 0.1, UP]);
                (0..n).flat_map(two).collect()
            };
            let of = |n: usize| of(&test(direction), &table(&rows(n), columns));
            assert_eq!(of(10_000).unwrap().runs.len(), 10_000);
            let refused = of(30_000).unwrap_err().to_string();
            assert_eq!(
                refused,
                "30000 runs: must be at most 10000: does the column \"n\" number the runs?"
            );
        }
        // Runs that lack a target are named up to ten.
        let mut rows: Vec<[f64; 4]> = (0..2_000).map(|k| [f64::from(k), 0.0, 0.1, UP]).collect();
        rows.extend([[0.0, 9.0, 0.1, UP]]);
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let remarks = of(&test(true), &table(&rows, 4)).unwrap().remarks;
        let lacking = remarks.iter().find(|one| one.starts_with("target 9"));
        assert!(lacking.unwrap().contains(" and 1989 more"), "{remarks:?}");
    }

    #[test]
    fn without_a_direction_a_sorted_table_is_refused_with_line_and_remedy() {
        let mut rows = measured();
        assert_eq!(of(&test(false), &table(&rows, 3)).unwrap().runs.len(), 3);
        rows.sort_by(|a, b| a[1].total_cmp(&b[1]));
        let words = of(&test(false), &table(&rows, 3)).unwrap_err().to_string();
        assert!(
            words.starts_with("line 8: column \"n\": run 1 comes again after run 3"),
            "{words}"
        );
        assert!(words.contains("name a column of the direction"), "{words}");
    }

    #[test]
    fn rows_whose_order_is_not_that_of_their_directions_are_refused_with_the_line() {
        let rows = |rows: &[(f64, f64)]| {
            let rows: Vec<_> = rows.iter().map(|(mm, way)| [1.0, *mm, 0.0, *way]).collect();
            of(&test(true), &table(&rows, 4))
        };
        assert!(rows(&[(0.0, UP), (9.0, UP), (9.0, DOWN), (0.0, DOWN)]).is_ok());
        assert!(rows(&[(0.0, DOWN), (0.0, UP), (9.0, UP), (9.0, DOWN)]).is_ok());
        let odd = rows(&[
            (0.0, UP),
            (9.0, DOWN),
            (20.0, UP),
            (20.0, DOWN),
            (0.0, DOWN),
        ]);
        assert_eq!(
            odd.unwrap_err().to_string(),
            "line 3: run 1: target 9 mm after 0 mm is approached up, and its direction says down: rows must be in the order of the measurement"
        );
        let listed = rows(&[(0.0, DOWN), (0.0, UP), (9.0, DOWN), (9.0, UP)]).unwrap();
        assert!(!listed.is_order_known, "{:?}", listed.remarks);
    }

    #[test]
    fn targets_that_differ_where_the_direction_turns_are_refused_with_the_key_that_joins_them() {
        let rows: Vec<[f64; 4]> = [(0.0, UP), (400.0, UP), (400.12, DOWN), (0.0, DOWN)]
            .map(|(mm, way)| [1.0, mm, 0.0, way])
            .to_vec();
        let refused = of(&test(true), &table(&rows, 4)).unwrap_err().to_string();
        assert_eq!(
            refused,
            "line 4: run 1: target 400.12 mm after 400 mm, where the direction turns: where they are meant to be one target, state \
             same_target_um in the map, how far such targets differ"
        );
        let mut joined = test(true);
        if let Test::Positioning { same_target_um, .. } = &mut joined {
            *same_target_um = Some(200.0);
        }
        let runs = of(&joined, &table(&rows, 4)).unwrap();
        let targets: Vec<f64> = runs.runs[0].iter().map(|row| row.cells[1]).collect();
        assert!(targets[1].total_cmp(&targets[2]).is_eq(), "{targets:?}");
    }

    #[test]
    fn a_target_that_a_run_lacks_or_has_twice_is_named() {
        let mut rows = measured();
        rows.remove(7);
        let runs = of(&test(true), &table(&rows, 4)).unwrap();
        let words = "target 9 mm up has no row in run 2: an evaluation leaves it out";
        assert_eq!(runs.remarks, [words]);
        let mut rows = measured();
        rows.insert(1, [1.0, 9.0, 5.0, UP]);
        rows.insert(2, [1.0, 5.0, 5.0, DOWN]);
        let words = of(&test(true), &table(&rows, 4)).unwrap_err().to_string();
        assert!(
            words.contains("run 1 has target 9 mm up already in line 3"),
            "{words}"
        );
    }

    #[test]
    fn a_run_that_was_broken_off_is_named_once_and_no_target_for_it() {
        for n in 1..=4 {
            for run in [1.0, 2.0, 3.0] {
                let mut rows = measured();
                let mut left = n;
                rows.retain(|row| {
                    let is_kept = row[0].total_cmp(&run).is_ne() || left > 0;
                    left -= i32::from(row[0].total_cmp(&run).is_eq() && left > 0);
                    is_kept
                });
                let runs = of(&test(true), &table(&rows, 4)).unwrap();
                let [said] = &runs.remarks[..] else {
                    panic!("{:?}", runs.remarks);
                };
                let words = format!("{n} readings where a complete run has 6: it was broken off");
                assert!(said.starts_with(&format!("run {run}, line ")), "{said}");
                assert!(said.contains(&words), "{said}");
            }
        }
    }

    /// Targets to 315 mm in a travel to 320 mm: turned round 5 mm behind the last it is at its end, 6 mm are beyond.
    #[test]
    fn an_overrun_beyond_the_travel_is_refused_with_line_value_limit_and_remedy() {
        let travel = Range::new(-320.0, 320.0, "mm, the axis' travel");
        let rows: Vec<_> = [(-315.0, UP), (315.0, UP), (315.0, DOWN), (-315.0, DOWN)]
            .map(|(mm, way)| [1.0, mm, 0.0, way])
            .to_vec();
        let runs = of(&test(true), &table(&rows, 4)).unwrap();
        let of = |axis, overrun| check_travel(&runs, Some(&travel), (axis, overrun));
        assert_eq!(of(Axis::X, 5.0).unwrap(), None);
        let said = of(Axis::X, 6.0).unwrap_err().to_string();
        let words = "line 2: target -315 mm with test.positioning.overrun_mm = 6 mm: X turns round at -321 mm: must be from -320 to 320 mm, the axis' travel; correct overrun_mm in the map, or travel_mm in the machine file (places beyond it: 2)";
        assert_eq!(said, words);
        let told = of(Axis::C, 6.0).unwrap().unwrap();
        assert!(told.contains("C turns round at -321 deg"), "{told}");
    }

    #[test]
    fn a_run_turns_round_before_its_first_target_and_between_two_rows_of_one() {
        let rows = table(
            &[
                [1.0, 0.0, 0.0, UP],
                [1.0, 9.0, 0.0, UP],
                [1.0, 9.0, 0.0, DOWN],
            ],
            4,
        )
        .rows;
        let at: Vec<f64> = turns(&rows, 5.0).iter().map(|(_, at)| *at).collect();
        assert_eq!(at, [-5.0, 14.0]);
    }
}
