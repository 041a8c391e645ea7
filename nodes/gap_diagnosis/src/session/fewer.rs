//! The runs that are diagnosed of a recording with more of them than can be looked at at once.
//!
//! # Model
//!
//! Rows are the stations of every channel of every run, and `most_rows` bounds them. Stations are made longer for that
//! first (`diagnose`). Where a recording of many hours has too many rows even with the fewest, runs are left out: of n
//! runs of one condition those stay that lie closest to
//!
//! ```text
//!   k = max(3, n most_rows / rows),   at i (n - 1) / (k - 1),   i = 0 to k - 1   (1)
//! ```
//!
//! in their order, so that the first and the last stay, and what changes through the recording is still seen. What the
//! machine did in between stays as well: its history is the whole recording's.
//!
//! One log by itself is cut into parts (`log`), each of which has few rows.
//!
//! # Holds when
//! Conditions are few against runs: each keeps three runs.

use twin::Session;

use crate::config::GapConfig;
use crate::noise::repeats::same_condition;
use crate::search::rows::Rows;
use crate::session::log;

/// Fewest stations of a circle or pass.
pub const MIN_STATIONS_KEPT: usize = 32;
/// Stations of a circle or pass where runs are left out.
const STATIONS_KEPT: usize = 64;
/// Runs that each condition keeps.
const KEPT: usize = 3;

/// The session with fewer runs, where all of them would have too many rows; one log in parts.
pub fn fewer(session: &Session, config: &GapConfig) -> Option<Session> {
    if let Some(parts) = log::in_parts(session) {
        return Some(parts);
    }
    let all: Vec<usize> = (0..session.runs.len()).collect();
    let rows = |stations: usize| Rows::new(session, &all, stations, |_| true).len;
    let fewest = rows(MIN_STATIONS_KEPT.min(config.stations));
    if fewest <= config.most_rows {
        return None;
    }
    let rows = rows(STATIONS_KEPT.min(config.stations));
    let mut kept = vec![];
    for runs in conditions(session) {
        kept.extend(spread(&runs, config.most_rows, rows));
    }
    kept.sort_unstable();
    (kept.len() < session.runs.len()).then(|| Session {
        history: session.history.clone(),
        runs: kept.iter().map(|run| session.runs[*run].clone()).collect(),
        first_bag_ends: session.first_bag_ends,
    })
}

/// Runs with readings, by condition.
fn conditions(session: &Session) -> Vec<Vec<usize>> {
    let mut groups = Vec::<Vec<usize>>::new();
    for (place, run) in session.runs.iter().enumerate() {
        if run.readings.is_empty() {
            continue;
        }
        let same = |group: &&mut Vec<usize>| same_condition(&session.runs[group[0]], run);
        match groups.iter_mut().find(same) {
            Some(group) => group.push(place),
            None => groups.push(vec![place]),
        }
    }
    groups
}

/// (1) of some runs.
fn spread(runs: &[usize], most_rows: usize, rows: usize) -> Vec<usize> {
    let wanted = (runs.len() * most_rows / rows.max(1)).max(KEPT);
    if wanted >= runs.len() {
        return runs.to_vec();
    }
    let last = runs.len() - 1;
    let at = |k: usize| (k * last + (wanted - 1) / 2) / (wanted - 1);
    (0..wanted).map(|k| runs[at(k)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_first_and_the_last_stay_and_the_others_are_spread() {
        let runs: Vec<usize> = (10..20).collect();
        assert_eq!(spread(&runs, 40, 100), [10, 13, 16, 19]);
        assert_eq!(spread(&runs, 1, 100), [10, 15, 19]);
        assert_eq!(spread(&runs, 100, 100), runs);
        assert_eq!(spread(&runs[..2], 1, 100), runs[..2]);
    }
}
