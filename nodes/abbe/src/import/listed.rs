//! Tables whose rows are listed by target, and not in the order of the measurement.
//!
//! A sheet that was sorted, or a form that was filled in, has both directions by ascending (or both by descending) targets: one
//! below the other, or side by side. The column of the direction then tells which reading is which, and the figures of
//! ISO 230-2 need no more. In which order they were measured is lost.

use super::runs::{SAME_TARGET_MM, gathered, ways};
use super::table::Row;

/// Part of the rows of one direction that the other must have at least: fewer are taken for slips of the pen.
const LEAST_OF_A_DIRECTION: f64 = 0.5;

/// Puts rows that are listed by target in the order that a run has: upwards first, and then downwards. What was done.
///
/// Nothing is done where an order of rows agrees with its directions, where one direction is missing, or where rows are in no
/// order at all: then one of them is likely to be wrong, and it is refused later on with its line.
pub fn relist(runs: &mut Vec<Vec<Row>>) -> Option<String> {
    if let [rows] = runs.as_slice()
        && let Some(parted) = parted(rows)
    {
        *runs = parted;
    }
    let rows = || runs.iter().flatten();
    if !rows().all(|row| row.cells.get(3).is_some_and(|way| way.abs() > 0.0)) {
        return None;
    }
    let n_up = rows().filter(|row| is_up(row)).count() as f64;
    let n_down = rows().count() as f64 - n_up;
    if n_up.min(n_down) < LEAST_OF_A_DIRECTION * n_up.max(n_down).max(1.0) {
        return None;
    }
    let orders: Vec<f64> = runs.iter().map(|rows| order(rows)).collect::<Option<_>>()?;
    let first = orders.first()?;
    let is_one = orders.iter().all(|order| order * first > 0.0);
    let line = runs.iter().find_map(|rows| contradiction(rows))?;
    if !is_one {
        return None;
    }
    *runs = gathered(&runs.concat());
    Some(format!(
        "line {line}: the rows are listed by target, and not in the order of the measurement. They were put in order by their directions, \
         upwards first and then downwards"
    ))
}

/// The runs of rows without a number of one, where each direction is listed by target again and again.
fn parted(rows: &[Row]) -> Option<Vec<Vec<Row>>> {
    let has_way = |row: &Row| row.cells.get(3).is_some();
    if !rows.iter().all(has_way) || order(rows).is_some() {
        return None;
    }
    let blocks: Vec<&[Row]> = rows.chunk_by(|a, b| is_up(a) == is_up(b)).collect();
    let orders: Vec<f64> = { blocks.iter() }
        .map(|rows| monotone(rows))
        .collect::<Option<_>>()?;
    let is_one = orders.windows(2).all(|two| two[0] * two[1] > 0.0);
    if blocks.len() < 4 || !is_one {
        return None;
    }
    let number = |(k, rows): (usize, &[&[Row]])| {
        let rows = rows.iter().copied().flatten().cloned();
        rows.map(|mut row| {
            row.cells[0] = k as f64 + 1.0;
            row
        })
        .collect()
    };
    Some(blocks.chunks(2).enumerate().map(number).collect())
}

fn is_up(row: &Row) -> bool {
    row.cells[3] > 0.0
}

/// Sign of the order of targets in which a run is listed: all its rows, or both its directions one after the other. None of a
/// run in no such order.
fn order(rows: &[Row]) -> Option<f64> {
    let blocks: Vec<&[Row]> = rows.chunk_by(|a, b| is_up(a) == is_up(b)).collect();
    monotone(rows).or_else(|| match blocks.as_slice() {
        [one, other] => {
            let (one, other) = (monotone(one)?, monotone(other)?);
            (one * other > 0.0).then_some(one)
        }
        _ => None,
    })
}

/// Sign of the steps between targets, where they all have one; a step of nothing has either.
fn monotone(rows: &[Row]) -> Option<f64> {
    let steps = rows.windows(2).map(|two| two[1].cells[1] - two[0].cells[1]);
    let steps = steps.filter(|step| step.abs() > SAME_TARGET_MM);
    let mut signs = steps.map(f64::signum);
    let first = signs.next()?;
    signs.all(|sign| sign * first > 0.0).then_some(first)
}

/// Line of the first row whose direction is not the one that the order of the rows makes.
fn contradiction(rows: &[Row]) -> Option<u64> {
    let mut made = ways(rows).into_iter().zip(rows).skip(1);
    let found = made.find(|(way, row)| row.cells[3] * way < 0.0);
    found.map(|(_, row)| row.line)
}

/// What a reader must know of a single run of pairs of rows, one for each direction: a step cycle, or rows that were sorted.
pub fn doubt(runs: &[Vec<Row>]) -> Option<String> {
    let [rows] = runs else {
        return None;
    };
    let is_pair = |two: &[Row]| match two {
        [one, other] => (one.cells[1] - other.cells[1]).abs() <= SAME_TARGET_MM,
        _ => false,
    };
    let is_listed = rows.len() > 2 && monotone(rows).is_some() && rows.chunks(2).all(is_pair);
    is_listed.then(|| {
        "each target has both directions before the next one: a step cycle, or rows that were sorted by target, whose order of the measurement is not known".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: f64 = 1.0;
    const DOWN: f64 = -1.0;
    const TARGETS: [f64; 4] = [0.0, 9.0, 20.0, 41.0];

    fn rows(all: &[(f64, f64, f64)]) -> Vec<Row> {
        let row = |(k, (run, target, way)): (usize, &(f64, f64, f64))| Row {
            line: k as u64 + 2,
            cells: vec![*run, *target, 100.0 * way + target, *way],
        };
        all.iter().enumerate().map(row).collect()
    }

    fn side(run: f64, way: f64, is_ascending: bool) -> Vec<(f64, f64, f64)> {
        let mut targets = TARGETS.to_vec();
        if !is_ascending {
            targets.reverse();
        }
        targets
            .into_iter()
            .map(|target| (run, target, way))
            .collect()
    }

    fn readings(runs: &[Vec<Row>]) -> Vec<Vec<f64>> {
        let run = |rows: &Vec<Row>| rows.iter().map(|row| row.cells[2]).collect();
        runs.iter().map(run).collect()
    }

    #[test]
    fn both_directions_by_ascending_or_descending_targets_are_put_in_order() {
        let measured = rows(&[side(1.0, UP, true), side(1.0, DOWN, false)].concat());
        let pairs = |first: f64| -> Vec<(f64, f64, f64)> {
            let two = |target: f64| [(1.0, target, first), (1.0, target, -first)];
            TARGETS.into_iter().flat_map(two).collect()
        };
        let mut back = pairs(DOWN);
        back.reverse();
        for listed in [
            [side(1.0, UP, true), side(1.0, DOWN, true)].concat(),
            [side(1.0, DOWN, true), side(1.0, UP, true)].concat(),
            [side(1.0, UP, false), side(1.0, DOWN, false)].concat(),
            pairs(DOWN),
            back,
            [&side(1.0, UP, true)[1..], &side(1.0, DOWN, true)].concat(),
        ] {
            let mut runs = vec![rows(&listed)];
            let said = relist(&mut runs).expect("a remark");
            assert!(
                said.contains("not in the order of the measurement"),
                "{said}"
            );
            let mut wanted = readings(std::slice::from_ref(&measured));
            if listed.len() < 8 {
                wanted[0].remove(0);
            }
            assert_eq!(readings(&runs), wanted, "{listed:?}");
        }
        // Passes that are numbered as runs.
        let mut passes = vec![rows(&side(1.0, UP, true)), rows(&side(2.0, DOWN, true))];
        assert!(relist(&mut passes).is_some());
        assert_eq!(passes.concat().len(), 8);
        assert!((passes[1][0].cells[1] - 41.0).abs() < 1e-9);
    }

    #[test]
    fn an_order_that_agrees_one_direction_and_no_order_are_left_alone() {
        let agrees = [side(1.0, UP, true), side(1.0, DOWN, false)].concat();
        let mut slip = agrees.clone();
        slip[2].2 = DOWN;
        let mut one_way = side(1.0, UP, true);
        one_way[2].2 = DOWN;
        let turned = [side(1.0, DOWN, true), side(1.0, UP, false)].concat();
        for listed in [agrees, slip, one_way, side(1.0, DOWN, true), turned] {
            let mut runs = vec![rows(&listed)];
            assert_eq!(relist(&mut runs), None, "{listed:?}");
            assert_eq!(runs, [rows(&listed)]);
        }
        let mut untold = vec![rows(&[side(1.0, UP, true), side(1.0, DOWN, true)].concat())];
        for row in untold.iter_mut().flatten() {
            row.cells.truncate(3);
        }
        assert_eq!(relist(&mut untold), None);
    }

    #[test]
    fn pairs_of_a_single_run_may_be_a_step_cycle_or_sorted() {
        let two = |target: f64| [(1.0, target, UP), (1.0, target, DOWN)];
        let pairs: Vec<_> = TARGETS.into_iter().flat_map(two).collect();
        assert!(doubt(&[rows(&pairs)]).is_some());
        assert_eq!(doubt(&[rows(&pairs), rows(&pairs)]), None);
        assert_eq!(doubt(&[rows(&side(1.0, UP, true))]), None);
        let measured = [side(1.0, UP, true), side(1.0, DOWN, false)].concat();
        assert_eq!(doubt(&[rows(&measured)]), None);
    }
}
