//! Passes of a laser file that were broken off, planned and not measured, or are not in the file.

use std::collections::BTreeMap;

use anyhow::{Result, bail};

/// One reading.
#[derive(Clone, Copy)]
pub struct Reading {
    /// Its line.
    pub line: u64,
    /// Where it was read, mm or deg.
    pub target: f64,
    /// Measured minus target, in the unit of the file.
    pub deviation: f64,
}

/// Passes by their numbers, each in the order of its lines.
pub type Passes = BTreeMap<u32, Vec<Reading>>;

/// Readings that are all zero by chance: fewer than these.
const FEWEST_ZEROS: usize = 3;
/// Most passes that are named.
const NAMED: usize = 10;
/// Deviations of a machine are larger than this, µm: smaller ones are of another unit.
const LEAST_OF_MACHINES_UM: f64 = 0.02;

/// Whether a pass has no other deviation than zero.
pub fn is_empty(pass: &[Reading]) -> bool {
    pass.iter().all(|one| one.deviation.abs() <= 0.0)
}

/// Leaves out passes that are no measurement, and counts those missing in the file. In words, and how many passes of a measurement
/// are not read.
pub fn leave_out(passes: &mut Passes, run_count: Option<usize>) -> (Vec<String>, usize) {
    let most = passes.values().map(Vec::len).max().unwrap_or(0);
    let n_listed = passes.len();
    let (mut remarks, mut n_broken_off) = (vec![], 0);
    let is_measured = passes.values().any(|pass| !is_empty(pass));
    passes.retain(|number, pass| {
        let why = if pass.len() < 2 || 2 * pass.len() < most {
            n_broken_off += 1;
            "it was broken off"
        } else if is_measured && pass.len() >= FEWEST_ZEROS && is_empty(pass) {
            "its deviations are all 0, as of a pass that was planned and not measured"
        } else {
            return true;
        };
        remarks.push(format!(
            "warning, run {number} has {} of {most} readings and is left out: {why}",
            pass.len()
        ));
        false
    });
    let more = remarks.len().saturating_sub(NAMED);
    remarks.truncate(NAMED);
    remarks.extend((more > 0).then(|| format!("warning, {more} more such runs are left out")));
    let missing = run_count.map_or(0, |n| n.saturating_sub(n_listed));
    if missing > 0 {
        remarks.push(format!(
            "warning, Run-count is {}, and {n_listed} runs have readings: {missing} were not measured, or are missing in the file",
            run_count.unwrap_or(0)
        ));
    }
    (remarks, n_broken_off + missing)
}

/// The way of a pass, by the order of its targets.
///
/// # Errors
/// With the line at which it turns round.
pub fn way_of(number: u32, pass: &[Reading]) -> Result<&'static str> {
    let mut way = 0.0;
    for two in pass.windows(2) {
        let step = two[1].target - two[0].target;
        if step.abs() <= 0.0 || step * way < 0.0 {
            bail!(
                "line {}: run {number} goes to and fro: runs that pass their targets one way each are read",
                two[1].line
            );
        }
        way = step;
    }
    Ok(if way < 0.0 { "down" } else { "up" })
}

/// A doubt of the unit, where no deviation is as large as any machine's.
pub fn doubt_unit(passes: &Passes) -> Option<String> {
    let all = passes.values().flatten().map(|one| one.deviation.abs());
    let greatest = all.fold(0.0, f64::max);
    (greatest > 0.0 && greatest < LEAST_OF_MACHINES_UM).then(|| {
        format!("warning, no deviation is above {greatest} µm: the file states µm; are they in mm?")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn passes(all: &[&[f64]]) -> Passes {
        let pass = |deviations: &&[f64]| {
            let readings = deviations.iter().enumerate();
            readings
                .map(|(k, deviation)| Reading {
                    line: 1,
                    target: k as f64,
                    deviation: *deviation,
                })
                .collect()
        };
        (1..).zip(all.iter().map(pass)).collect()
    }

    #[test]
    fn passes_that_are_no_measurement_are_left_out_by_name() {
        let whole: &[f64] = &[1.0, 2.0, 3.0, 4.0, 5.0];
        for (all, n_kept, words) in [
            (vec![whole, whole], 2, vec![]),
            (
                vec![whole, &[1.0]],
                1,
                vec!["run 2 has 1 of 5 readings and is left out: it was broken off"],
            ),
            (vec![whole, whole, &[1.0, 2.0]], 2, vec!["run 3 has 2 of 5"]),
            (vec![whole, &[1.0, 2.0, 3.0]], 2, vec![]),
            (
                vec![whole, &[0.0; 5]],
                1,
                vec!["run 2 has 5 of 5 readings and is left out: its deviations are all 0"],
            ),
            (vec![&[0.0; 5], &[0.0; 5]], 2, vec![]),
        ] {
            let mut found = passes(&all);
            let (said, n_lost) = leave_out(&mut found, Some(all.len()));
            let n_broken_off = words
                .iter()
                .filter(|words| !words.contains("all 0"))
                .count();
            assert_eq!(n_lost, n_broken_off, "{said:?}");
            assert_eq!((found.len(), said.len()), (n_kept, words.len()), "{said:?}");
            for (said, words) in said.iter().zip(words) {
                assert!(said.contains(words), "{said}");
            }
        }
        let (said, n_lost) = leave_out(&mut passes(&[whole, whole]), Some(4));
        assert_eq!(n_lost, 2);
        assert!(
            said[0].contains("Run-count is 4, and 2 runs have readings: 2 were not measured"),
            "{said:?}"
        );
    }

    #[test]
    fn deviations_that_no_machine_has_are_of_another_unit() {
        assert!(doubt_unit(&passes(&[&[0.001, -0.004]])).is_some());
        assert!(doubt_unit(&passes(&[&[0.001, -0.4]])).is_none());
        assert!(doubt_unit(&passes(&[&[0.0, 0.0]])).is_none());
    }
}
