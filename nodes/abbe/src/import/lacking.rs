//! Targets that a run of a positioning test lacks, or has twice from one side.

use std::collections::BTreeMap;

use anyhow::{Result, bail};

use super::map::Units;
use super::passes;
use super::runs::{GRID_MM, ways, word};
use super::table::Row;

/// Runs and targets that a remark names one by one.
const NAMED: usize = 10;

/// A target from one side, comparable from run to run.
type Visit = (i64, bool);

/// Names targets that every run reads from one side alone, in a test of both sides: an evaluation leaves them out.
pub fn one_sided(runs: &[Vec<Row>], units: Units) -> Vec<String> {
    let broken_off = passes::are_broken_off(runs);
    let whole = runs.iter().zip(broken_off);
    let whole = whole.filter_map(|(rows, is_broken_off)| (!is_broken_off).then_some(rows));
    let mut seen: BTreeMap<i64, (f64, [usize; 2])> = BTreeMap::new();
    for rows in whole {
        for (row, way) in rows.iter().zip(ways(rows)) {
            if row.cells[2].is_nan() {
                continue;
            }
            let place = (row.cells[1] / GRID_MM).round() as i64;
            let (_, n) = seen.entry(place).or_insert((row.cells[1], [0, 0]));
            n[usize::from(way > 0.0)] += 1;
        }
    }
    let has = |side: usize| seen.values().filter(|(_, n)| n[side] > 0).count();
    let has_both = |(_, n): &(f64, [usize; 2])| n.iter().all(|n| *n > 0);
    if has(0) == 0 || has(1) == 0 || !seen.values().any(has_both) {
        return vec![];
    }
    let odd = seen.values().filter(|target| !has_both(target));
    let odd = odd.map(|(target, [down, up])| {
        let lacking = if *up > 0 { "down" } else { "up" };
        format!(
            "warning, target {target} {} has no reading {lacking} in any run: an evaluation of both directions leaves it out, {} readings; \
             read it from both sides, beyond which the axis turns round",
            units.target,
            down + up
        )
    });
    let mut remarks: Vec<String> = odd.take(NAMED).collect();
    let others = seen.values().filter(|target| !has_both(target)).count();
    let others = others.saturating_sub(NAMED);
    remarks.extend((others > 0).then(|| {
        format!(
            "{others} more targets have readings from one side alone: an evaluation leaves them out"
        )
    }));
    remarks
}

/// Refuses a target that a run has twice from one side; names those that a run lacks which was not broken off.
///
/// # Errors
/// With both lines.
pub fn check_targets(runs: &[Vec<Row>], units: Units) -> Result<Vec<String>> {
    let unit = units.target;
    let mut seen: BTreeMap<Visit, (f64, Vec<usize>)> = BTreeMap::new();
    let broken_off = passes::are_broken_off(runs);
    let whole: Vec<usize> = (0..runs.len()).filter(|k| !broken_off[*k]).collect();
    for (k, rows) in runs.iter().enumerate() {
        let mut own: BTreeMap<Visit, u64> = BTreeMap::new();
        for (row, way) in rows.iter().zip(ways(rows)) {
            if row.cells[2].is_nan() {
                // It was stopped at and nothing was read.
                continue;
            }
            let target_mm = row.cells[1];
            let visit = ((target_mm / GRID_MM).round() as i64, way > 0.0);
            if let Some(line) = own.insert(visit, row.line) {
                bail!(
                    "line {}: run {} has target {target_mm} {unit} {} already in line {line}: give every repetition a number of run of its own",
                    row.line,
                    row.cells[0],
                    word(way)
                );
            }
            if !broken_off[k] {
                seen.entry(visit).or_insert((target_mm, vec![])).1.push(k);
            }
        }
    }
    let (mut remarks, mut others) = (vec![], 0);
    for ((_, is_up), (target_mm, has)) in seen {
        let n = whole.len() - has.len();
        if n == 0 {
            continue;
        }
        if remarks.len() == NAMED {
            others += 1;
            continue;
        }
        // A run has a target from one side once, and they come in the order of the runs.
        let lacking = whole.iter().filter(|k| has.binary_search(k).is_err());
        let named = lacking.take(NAMED);
        let named: Vec<String> = named.map(|k| runs[*k][0].cells[0].to_string()).collect();
        let more = match n - named.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        remarks.push(format!(
            "target {target_mm} {unit} {} has no row in run {}{more}: an evaluation leaves it out",
            if is_up { "up" } else { "down" },
            named.join(", ")
        ));
    }
    if others > 0 {
        remarks.push(format!("{others} more targets have no row in every run"));
    }
    Ok(remarks)
}

#[cfg(test)]
mod tests {
    use metrology::Axis;

    use super::super::map::units;
    use super::*;

    /// Two runs up to 300 mm and back, whose turning point has so many rows.
    fn turned(n: usize) -> Vec<Vec<Row>> {
        let run = |run: u32| {
            let up = [0.0, 100.0, 200.0, 300.0];
            let down = [300.0, 200.0, 100.0, 0.0];
            let targets = up.iter().chain(&down[2 - n..]);
            let row = |(k, target): (usize, &f64)| Row {
                line: k as u64 + 2,
                cells: vec![f64::from(run), *target, 0.1],
            };
            targets.enumerate().map(row).collect()
        };
        vec![run(1), run(2)]
    }

    #[test]
    fn a_target_that_every_run_has_from_one_side_alone_is_named() {
        let said = one_sided(&turned(1), units(Axis::X));
        let begin = "warning, target 300 mm has no reading down in any run: an evaluation of both directions leaves it out, 2 readings; ";
        assert!(said.len() == 1 && said[0].starts_with(begin), "{said:?}");
        assert_eq!(one_sided(&turned(2), units(Axis::X)), Vec::<String>::new());
        // Of one side alone it is a test of one side.
        let up: Vec<Vec<Row>> = turned(1).into_iter().map(|run| run[..4].to_vec()).collect();
        assert_eq!(one_sided(&up, units(Axis::X)), Vec::<String>::new());
    }
}
