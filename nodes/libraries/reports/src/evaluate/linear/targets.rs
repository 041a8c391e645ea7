//! Which places of a test are its targets, and which readings belong to none.

use std::collections::{BTreeMap, BTreeSet};

use super::Visits;

/// Both sides of approach, or one: up is 0, down is 1.
const BOTH: &[usize] = &[0, 1];
/// Fewest targets of a test.
const LEAST_TARGETS: usize = 2;

/// The places that every run approached once from each of the sides, and these sides.
pub(in crate::evaluate) fn targets(runs: &[Visits]) -> (Vec<i64>, &'static [usize]) {
    let complete = |sides: &'static [usize]| -> Vec<i64> {
        let once = |run: &Visits, place: &i64| {
            run.get(place)
                .is_some_and(|visits| sides.iter().all(|side| visits[*side].len() == 1))
        };
        let first = runs.first().into_iter().flat_map(BTreeMap::keys);
        let in_every = first.filter(|place| runs.iter().all(|run| once(run, place)));
        in_every.copied().collect()
    };
    let both = complete(BOTH);
    let one: [&'static [usize]; 2] = [&[0], &[1]];
    let of_one = one.map(|side| (complete(side), side));
    let most = of_one.into_iter().max_by_key(|(places, _)| places.len());
    match most {
        Some((places, side)) if both.len() < LEAST_TARGETS && places.len() >= LEAST_TARGETS => {
            (places, side)
        }
        _ => (both, BOTH),
    }
}

/// Places with readings that are no targets, with the runs that lack a reading or have several. Turning points beyond
/// the targets that every run came to from one side alone are as they should be. `grid` is the spacing of places in `unit`.
pub(in crate::evaluate) fn left_out(
    runs: &[Visits],
    numbers: &[u32],
    (targets, sides): (&[i64], &[usize]),
    (grid, unit): (f64, &str),
) -> Vec<String> {
    let all: BTreeSet<i64> = runs.iter().flat_map(BTreeMap::keys).copied().collect();
    let within = |place: &i64| {
        targets.first().is_some_and(|first| place >= first)
            && targets.last().is_some_and(|last| place <= last)
    };
    let mut lines = vec![];
    for place in all.iter().filter(|place| !targets.contains(place)) {
        let counts = |side: usize| -> Vec<usize> {
            let count = |run: &Visits| run.get(place).map_or(0, |visits| visits[side].len());
            runs.iter().map(count).collect()
        };
        let mut flaws = vec![];
        for side in sides {
            let from = if *side == 0 { "up" } else { "down" };
            let counts = counts(*side);
            if counts.iter().all(|n| *n == 0) {
                if within(place) {
                    flaws.push(format!("no run came to it {from}"));
                }
                continue;
            }
            for (run, n) in numbers.iter().zip(&counts) {
                match n {
                    0 => flaws.push(format!("run {run} has no reading {from}")),
                    1 => {}
                    n => flaws.push(format!("run {run} has {n} readings {from}")),
                }
            }
        }
        if !flaws.is_empty() {
            let at = *place as f64 * grid;
            lines.push(format!("{at:.3} {unit}: {}", shortened(&flaws)));
        }
    }
    lines
}

/// Most flaws of a place that are named.
const MOST_NAMED: usize = 4;

fn shortened(flaws: &[String]) -> String {
    let named = flaws[..flaws.len().min(MOST_NAMED)].join(", ");
    match flaws.len().saturating_sub(MOST_NAMED) {
        0 => named,
        more => format!("{named}, and {more} more"),
    }
}
