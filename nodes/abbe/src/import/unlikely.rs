//! Readings that an instrument hardly shows: one value all the time, or those of another run digit for digit.
//!
//! They are in the figures all the same, and named: an instrument that does not count, one at the end of its range, and readings that
//! were copied look so.

use std::collections::{BTreeMap, BTreeSet};

use super::map::{Column, Test, What};
use super::runs::{GRID_MM, ways};
use super::table::Row;

/// Fewer readings may be equal by chance.
const LEAST_READINGS: usize = 5;
/// So many different values among them at least, where those of another run are the same.
const LEAST_VALUES: usize = 4;
/// Readings at the end of a range, one after another, at least.
const LEAST_AT_END: usize = 20;
/// Most equal readings one after another elsewhere in such a log.
const MOST_EQUAL: usize = 2;
/// Runs that are named one by one.
const NAMED: usize = 10;

/// A target from one side.
type Visit = (i64, bool);

/// What is unlikely about the readings of a test, a warning each.
pub fn warnings(test: &Test, runs: &[Vec<Row>]) -> Vec<String> {
    match test {
        Test::Positioning { .. } => of_positioning(runs),
        Test::Log { .. } => {
            let is_read = |column: &Column<'_>| matches!(column.what, What::Deviation(_));
            let read = test.columns().iter().position(is_read);
            let values = |k: usize| {
                let rows = runs.iter().flatten();
                let values = rows.filter_map(|row| row.cells.get(k).copied());
                values.filter(|value| value.is_finite()).collect()
            };
            let values: Vec<f64> = read.map_or_else(Vec::new, values);
            of_log(&values).into_iter().collect()
        }
        Test::Circle { .. } | Test::Touches { .. } => vec![],
    }
}

fn of_positioning(runs: &[Vec<Row>]) -> Vec<String> {
    let read: Vec<BTreeMap<Visit, u64>> = runs.iter().map(|rows| readings(rows)).collect();
    let values = |run: &BTreeMap<Visit, u64>| run.values().copied().collect::<BTreeSet<u64>>();
    let every: BTreeSet<u64> = read.iter().flat_map(values).collect();
    let n: usize = read.iter().map(BTreeMap::len).sum();
    if let (Some(value), true) = (one(&every), n >= LEAST_READINGS) {
        return vec![format!(
            "warning, all {n} readings are {value}: an instrument that does not count shows one value"
        )];
    }
    let mut lines = vec![];
    for (k, (own, rows)) in read.iter().zip(runs).enumerate() {
        let Some(number) = rows.first().map(|row| row.cells[0]) else {
            continue;
        };
        if own.len() < LEAST_READINGS {
            continue;
        }
        let own_values = values(own);
        if let Some(value) = one(&own_values) {
            lines.push(format!(
                "warning, run {number}: all {} readings are {value}, and those of other runs are not: an instrument that does not count shows one value",
                own.len()
            ));
            continue;
        }
        if own_values.len() < LEAST_VALUES {
            continue;
        }
        let before = read.iter().zip(runs).take(k);
        let copied = before.filter(|(other, _)| *other == own);
        if let Some(first) = copied.filter_map(|(_, rows)| rows.first()).next() {
            lines.push(format!(
                "warning, run {number} has the {} readings of run {} digit for digit: where they were copied the repeatability is too small",
                own.len(),
                first.cells[0]
            ));
        }
    }
    if lines.is_empty() {
        lines.extend(one_way(&read));
    }
    let more = lines.len().saturating_sub(NAMED);
    lines.truncate(NAMED);
    lines.extend((more > 0).then(|| format!("warning, {more} more runs are such")));
    lines
}

/// The readings of a run by their targets, as their bits.
fn readings(rows: &[Row]) -> BTreeMap<Visit, u64> {
    let read = rows.iter().zip(ways(rows));
    let read = read.filter(|(row, _)| row.cells[2].is_finite());
    let place = |row: &Row| (row.cells[1] / GRID_MM).round() as i64;
    read.map(|(row, way)| ((place(row), way > 0.0), row.cells[2].to_bits()))
        .collect()
}

/// The one value of readings.
fn one(values: &BTreeSet<u64>) -> Option<f64> {
    let value = values.first().copied().filter(|_| values.len() == 1);
    value.map(f64::from_bits)
}

/// Readings down that are those up in every run.
fn one_way(read: &[BTreeMap<Visit, u64>]) -> Option<String> {
    let mut values = BTreeSet::new();
    let mut n = 0_usize;
    for run in read {
        for ((place, is_up), value) in run {
            let Some(other) = run.get(&(*place, !is_up)) else {
                continue;
            };
            if other != value {
                return None;
            }
            n += usize::from(*is_up);
            values.insert(*value);
        }
    }
    (n >= LEAST_READINGS && values.len() >= LEAST_VALUES).then(|| {
        format!(
            "warning, all {n} readings down are those up digit for digit: where they were copied there is no reversal in them"
        )
    })
}

/// A log of one value, or one that ends at the end of the range of its sensor.
fn of_log(values: &[f64]) -> Option<String> {
    let first = values.first()?;
    let stretches: Vec<&[f64]> = values.chunk_by(|a, b| a.total_cmp(b).is_eq()).collect();
    if stretches.len() == 1 && values.len() >= LEAST_READINGS {
        let n = values.len();
        return Some(format!(
            "warning, all {n} readings are {first}: an instrument that does not count shows one value"
        ));
    }
    let longest = stretches.iter().max_by_key(|stretch| stretch.len())?;
    let value = longest.first()?;
    let ends = [f64::min, f64::max].map(|end| values.iter().copied().fold(*first, end));
    let is_end = ends.iter().any(|end| end.total_cmp(value).is_eq());
    let is_other = |stretch: &&&[f64]| stretch.first() != Some(value);
    let mut others = stretches.iter().filter(is_other);
    let is_cut = longest.len() >= LEAST_AT_END && others.all(|it| it.len() <= MOST_EQUAL);
    (is_end && is_cut).then(|| {
        format!(
            "warning, {} readings one after another are {value}, the end of all, and the others change from one to the next: a sensor at the end of its range shows so",
            longest.len()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TARGETS: [f64; 5] = [0.0, 50.0, 100.0, 150.0, 200.0];

    /// Runs up and down with these readings.
    fn runs(read: impl Fn(u32, usize, bool) -> f64) -> Vec<Vec<Row>> {
        let run = |run: u32| {
            let up = TARGETS
                .iter()
                .enumerate()
                .map(|(k, target)| (k, target, true));
            let down = TARGETS.iter().enumerate().rev();
            let down = down.map(|(k, target)| (k, target, false));
            let row = |(k, target, is_up): (usize, &f64, bool)| Row {
                line: 2,
                cells: vec![f64::from(run), *target, read(run, k, is_up)],
            };
            up.chain(down).map(row).collect()
        };
        (1..=3).map(run).collect()
    }

    /// Different for each run, target and side.
    fn sound(run: u32, k: usize, is_up: bool) -> f64 {
        let side = if is_up { 0.0 } else { 2.3 };
        1.7 * k as f64 + side + 0.1 * f64::from(run * 7 % 5)
    }

    #[test]
    fn runs_of_one_value_and_copies_of_another_run_are_named() {
        assert_eq!(of_positioning(&runs(sound)), Vec::<String>::new());
        let zeros = of_positioning(&runs(|_, _, _| 0.0));
        assert!(
            zeros.len() == 1 && zeros[0].starts_with("warning, all 30 readings are 0:"),
            "{zeros:?}"
        );
        let one = of_positioning(&runs(
            |run, k, is_up| if run == 2 { 0.0 } else { sound(run, k, is_up) },
        ));
        assert!(
            one.len() == 1 && one[0].starts_with("warning, run 2: all 10 readings are 0,"),
            "{one:?}"
        );
        let copied = of_positioning(&runs(|run, k, is_up| sound(run.min(2), k, is_up)));
        let begin = "warning, run 3 has the 10 readings of run 2 digit for digit";
        assert!(
            copied.len() == 1 && copied[0].starts_with(begin),
            "{copied:?}"
        );
        let same = of_positioning(&runs(|run, k, _| sound(run, k, true)));
        assert!(
            same.len() == 1 && same[0].starts_with("warning, all 15 readings down are those up"),
            "{same:?}"
        );
        // A dial of 10 um on a good machine.
        let coarse = of_positioning(&runs(|_, k, _| 10.0 * (k / 3) as f64));
        assert_eq!(coarse, Vec::<String>::new());
    }

    #[test]
    fn a_log_at_the_end_of_a_range_is_named_and_one_that_settles_is_not() {
        let grown = |k: u32| 20.0 * (1.0 - (-f64::from(k) / 60.0).exp());
        let log = |read: &dyn Fn(u32) -> f64| of_log(&(0..300).map(read).collect::<Vec<f64>>());
        assert_eq!(log(&grown), None);
        let cut = log(&|k| grown(k).min(12.5)).expect("a warning");
        assert!(
            cut.starts_with("warning, 241 readings one after another are 12.5"),
            "{cut}"
        );
        // Read to 0.5 um: it stands at each value for a while.
        assert_eq!(log(&|k| (2.0 * grown(k)).round() / 2.0), None);
        let still = log(&|_| 0.0).expect("a warning");
        assert!(
            still.starts_with("warning, all 300 readings are 0"),
            "{still}"
        );
    }
}
