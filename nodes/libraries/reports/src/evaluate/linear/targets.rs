//! Which places of a test are its targets, and which readings belong to none.

use std::collections::{BTreeMap, BTreeSet};

use super::Visits;

/// Both sides of approach, or one: up is 0, down is 1.
const BOTH: &[usize] = &[0, 1];
/// Fewest targets of a test.
const LEAST_TARGETS: usize = 2;

/// Stops at most this far from their neighbour are at one place, mm and deg: the least input increment of most controls is
/// coarser. Programs in inches and motions in ticks end beside their target by less.
pub(in crate::evaluate) const SAME_PLACE: f64 = 1e-4;
/// Places are stated as multiples of this, mm and deg.
const STATED: f64 = 1e-6;

/// The places of all runs of a test, ascending, each with the greatest position that belongs to it.
#[derive(Debug)]
pub(in crate::evaluate) struct Places(Vec<[f64; 2]>);

impl Places {
    /// Of the positions of all stops: neighbours within [`SAME_PLACE`] are one place, at the middle of its positions.
    pub(in crate::evaluate) fn of(positions: impl Iterator<Item = f64>) -> Self {
        let mut all: Vec<f64> = positions.collect();
        all.sort_by(f64::total_cmp);
        let groups = all.chunk_by(|a, b| b - a <= SAME_PLACE);
        let ends = groups.filter_map(|group| Some((group.first()?, group.last()?)));
        let place = |(first, last): (&f64, &f64)| {
            let middle = f64::midpoint(*first, *last);
            [(middle / STATED).round() * STATED, *last]
        };
        Self(ends.map(place).collect())
    }

    /// The number of the place of a stop.
    pub(in crate::evaluate) fn number(&self, position: f64) -> usize {
        self.0.partition_point(|[_, last]| *last < position)
    }

    /// The positions of places by their numbers.
    pub(in crate::evaluate) fn at(&self, numbers: &[usize]) -> Vec<f64> {
        let known = numbers.iter().filter_map(|number| self.0.get(*number));
        known.map(|[at, _]| *at).collect()
    }
}

/// The places that every run approached once from each of the sides, and these sides.
pub(in crate::evaluate) fn targets(runs: &[Visits]) -> (Vec<usize>, &'static [usize]) {
    let complete = |sides: &'static [usize]| -> Vec<usize> {
        let once = |run: &Visits, place: &usize| {
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
/// the targets that every run came to from one side alone are as they should be.
pub(in crate::evaluate) fn left_out(
    runs: &[Visits],
    numbers: &[u32],
    (targets, sides): (&[usize], &[usize]),
    (places, unit): (&Places, &str),
) -> Vec<String> {
    let all: BTreeSet<usize> = runs.iter().flat_map(BTreeMap::keys).copied().collect();
    let within = |place: &usize| {
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
                    flaws.push(format!("no run has a reading {from}"));
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
        let at = places.at(&[*place]);
        if let (false, Some(at)) = (flaws.is_empty(), at.first()) {
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
