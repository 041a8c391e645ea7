//! Logs: runs that stand and are read over time.
//!
//! # Model
//!
//! Rows of two logs are compared at one time since the begin of each, linear between neighbours, so that neither the
//! number of rows nor jitter of their stamps nor a cut matters. Two long logs repeat each other only where what heats the
//! machine does so: with T the temperature of a thermometer, in the middle of every tenth of the shorter one,
//!
//! ```text
//!   |T(a + t) - T(b + t)| <= max(0.15 K, 0.02 (max T - min T))              (1)
//! ```
//!
//! so that pieces of one long warm-up are no repeats of each other.
//!
//! Where no test was repeated a log has the noise of its neighbouring rows, each less what the line through the rows beside
//! it says; f is its place between them:
//!
//! ```text
//!   r_i = (y_i - (1 - f) y_(i-1) - f y_(i+1)) / sqrt(1 + (1 - f)^2 + f^2) (2)
//!   s = 1.4826 median |r_i|                                               (3)
//! ```
//!
//! That is its white part only. How two such logs would differ nobody has seen: [`ASSUMED_BETWEEN_UM`] is taken for it, of
//! the offset and of the drift along a part.
//!
//! One log by itself is cut into parts of equal time, so that the last of them can be held out (`split`). They share one
//! zero and are no repeats.
//!
//! # Holds when
//! What a log shows is smooth from row to row. Readings are rounded by less than they scatter.
//!
//! # References
//! \[1\] P. J. Rousseeuw, C. Croux, J. Am. Stat. Assoc. 88, 1993 (median absolute deviation, efficiency 37 %). \[2\] T.
//! Gasser, L. Sroka, C. Jennen-Steinmetz, Biometrika 73, 1986 (variance from neighbours).

use metrology::sample::{TestKind, TestSegment};
use twin::{Channel, Run, Session};

use crate::noise::stack::Stack;
use crate::search::rows::{Block, count, time_s};

/// Difference between repeats that is assumed for a log without repeats, µm (the repeatability of ISO 230-2 and -4 is
/// 0.2 to 0.5).
pub const ASSUMED_BETWEEN_UM: f64 = 0.35;
/// Logs that last longer than this repeat each other only where they are heated alike, s.
pub const LONG_S: f64 = 600.0;
/// Least difference of two temperatures that counts, K.
const LEAST_K: f64 = 0.15;
/// The same as a share of the range of the thermometer.
const MIN_SHARE_OF_RANGE: f64 = 0.02;
/// Rows further apart than this many of the usual spacing have nothing between them.
const MOST_SPACINGS: f64 = 3.0;
/// Parts of one log.
const PARTS: usize = 6;
/// Fewest readings of a part.
const PER_PART: usize = 20;
/// Noise needs so many rows.
const MIN_LOG_ROWS: usize = 12;
/// Share of the rows that the median is worth.
const EFFICIENCY: f64 = 0.37;
/// How a part of a log is marked among the features of its segment.
const PART: &str = "part ";

/// Whether a run is a log.
pub fn is_log(run: &Run) -> bool {
    run.segment.kind == TestKind::Dwell
}

/// Whether all that was read are logs.
pub(crate) fn is_of_logs(stack: &Stack<'_>) -> bool {
    let mut runs = stack.rows.blocks.iter().map(|block| block.run);
    runs.all(|run| is_log(&stack.session.runs[run]))
}

/// Times of the rows of a block since the first, s.
pub fn since_s(session: &Session, block: &Block) -> Vec<f64> {
    let run = &session.runs[block.run];
    let begin_s = block.rows.first().map_or(0.0, |row| time_s(run, row));
    block
        .rows
        .iter()
        .map(|row| time_s(run, row) - begin_s)
        .collect()
}

/// A time between two rows of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    rows: [usize; 2],
    share: f64,
}

impl Between {
    /// Value there of one value per row.
    pub fn value(&self, rows: &[f64]) -> f64 {
        let [before, after] = self.rows.map(|row| rows.get(row).copied().unwrap_or(0.0));
        before + (after - before) * self.share
    }

    /// Variance there over that of a row.
    pub fn variance(&self) -> f64 {
        (1.0 - self.share).powi(2) + self.share.powi(2)
    }
}

/// Where a time lies between growing times; none beyond their ends by more than half the usual spacing, or in a hole.
pub fn between(times_s: &[f64], at_s: f64) -> Option<Between> {
    let usual_s = usual_spacing(times_s)?;
    let next = times_s.partition_point(|t| *t <= at_s);
    let before = next.saturating_sub(1);
    let (from_s, to_s) = (*times_s.get(before)?, times_s.get(next).copied());
    let alone = |row: usize| Between {
        rows: [row; 2],
        share: 0.0,
    };
    match to_s {
        None => (at_s - from_s <= 0.5 * usual_s).then(|| alone(before)),
        Some(to_s) if next == 0 => (to_s - at_s <= 0.5 * usual_s).then(|| alone(0)),
        Some(to_s) if to_s - from_s > MOST_SPACINGS * usual_s => {
            (at_s - from_s <= 0.0).then(|| alone(before))
        }
        Some(to_s) => Some(Between {
            rows: [before, next],
            share: (at_s - from_s) / (to_s - from_s),
        }),
    }
}

fn usual_spacing(times_s: &[f64]) -> Option<f64> {
    let mut spacings: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if spacings.is_empty() {
        return None;
    }
    Some(median(&mut spacings))
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Places of the blocks that last at least half as long as the longest, in their order.
pub fn long_enough(session: &Session, blocks: &[&Block]) -> Vec<usize> {
    let lasts_s = |block: &Block| since_s(session, block).last().copied().unwrap_or(0.0);
    let all_s: Vec<f64> = blocks.iter().map(|block| lasts_s(block)).collect();
    let longest_s = all_s.iter().copied().fold(0.0, f64::max);
    (0..blocks.len())
        .filter(|k| 2.0 * all_s[*k] >= longest_s)
        .collect()
}

/// (1) of two blocks, for every thermometer; always so of runs that are no long logs.
pub fn heats_alike(session: &Session, a: &Block, b: &Block) -> bool {
    if !is_log(&session.runs[a.run]) {
        return true;
    }
    let begin_s = |block: &Block| {
        let run = &session.runs[block.run];
        block.rows.first().map_or(0.0, |row| time_s(run, row))
    };
    let lasts_s = |block: &Block| since_s(session, block).last().copied().unwrap_or(0.0);
    let shorter_s = lasts_s(a).min(lasts_s(b));
    if lasts_s(a).max(lasts_s(b)) < LONG_S {
        return true;
    }
    let history = &session.history;
    history.temperature_degc.values().all(|series| {
        let finite = || series.iter().copied().filter(|degc| degc.is_finite());
        let range =
            finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min);
        let most_k = LEAST_K.max(MIN_SHARE_OF_RANGE * range);
        (0..10).all(|tenth| {
            let since_s = shorter_s * 0.1 * (f64::from(tenth) + 0.5);
            let [one, other] = [a, b].map(|block| history.at(series, begin_s(block) + since_s));
            // A thermometer without a reading yet does not count.
            (one - other).abs() <= most_k || !(one - other).is_finite()
        })
    })
}

/// Variance (3) of the rows of some blocks of one channel, mm2, and the independent rows that it is known from; none of too
/// few rows, and where the rows do not scatter.
pub fn variance_within(
    session: &Session,
    blocks: &[&Block],
    raw: &[f64],
    least_mm2: f64,
) -> Option<(f64, f64)> {
    let mut all: Vec<f64> = blocks
        .iter()
        .flat_map(|block| beside_neighbours(session, block, raw))
        .map(f64::abs)
        .collect();
    if all.len() < MIN_LOG_ROWS {
        return None;
    }
    let freedom = EFFICIENCY * count(all.len());
    let variance = (1.4826 * median(&mut all)).powi(2).max(least_mm2);
    (variance > 0.0).then_some((variance, freedom))
}

/// (2) of the rows of a block.
fn beside_neighbours(session: &Session, block: &Block, raw: &[f64]) -> Vec<f64> {
    let times_s = since_s(session, block);
    let rows = raw.get(block.range()).unwrap_or(&[]);
    let of = |(y, t): (&[f64], &[f64])| match (y, t) {
        ([before, here, after], [t_0, t_1, t_2]) if t_2 > t_0 => {
            let f = (t_1 - t_0) / (t_2 - t_0);
            let line = (1.0 - f) * before + f * after;
            (here - line) / (1.0 + (1.0 - f).powi(2) + f * f).sqrt()
        }
        _ => 0.0,
    };
    rows.windows(3).zip(times_s.windows(3)).map(of).collect()
}

/// Whether a channel of a log has noise of its own.
pub fn is_read(channel: &Channel) -> bool {
    !matches!(channel, Channel::Thermometer(_) | Channel::Touch)
}

/// One log by itself as a session of its parts, each a run by itself; none for other sessions, and for a log too short to be
/// cut.
pub fn in_parts(session: &Session) -> Option<Session> {
    let mut with_readings = session.runs.iter().filter(|run| !run.readings.is_empty());
    let run = with_readings.next().filter(|run| is_log(run))?;
    let is_whole = part(&run.segment).is_none();
    if with_readings.next().is_some() || !is_whole {
        return None;
    }
    let times_s: Vec<f64> = run
        .readings
        .iter()
        .filter_map(|one| run.time_of(one))
        .collect();
    if times_s.len() < run.readings.len() {
        return None;
    }
    let first_s = times_s.iter().copied().fold(f64::INFINITY, f64::min);
    let last_s = times_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let channels = run.readings.chunk_by(|a, b| a.channel == b.channel).count();
    let parts = PARTS.min(times_s.len() / (PER_PART * channels.max(1)));
    let lasts_s = (last_s - first_s) / count(parts.max(1));
    if parts < 3 || lasts_s <= 0.0 {
        return None;
    }
    let part_of = |time_s: f64| {
        (1..parts)
            .filter(|k| time_s >= first_s + count(*k) * lasts_s)
            .count()
    };
    let runs = (0..parts).map(|k| {
        let mut segment = run.segment.clone();
        segment.run = u32::try_from(k + 1).unwrap_or(u32::MAX);
        segment.features.push(format!("{PART}{}", k + 1));
        let own = run.readings.iter().zip(&times_s);
        let own = own.filter(|(_, time_s)| part_of(**time_s) == k);
        Run {
            segment,
            readings: own.map(|(reading, _)| reading.clone()).collect(),
            ..run.clone()
        }
    });
    Some(Session {
        history: session.history.clone(),
        runs: runs.collect(),
        first_bag_ends: session.first_bag_ends,
    })
}

/// Which part of one log a run is, as it is marked; none of other runs.
pub fn part(segment: &TestSegment) -> Option<&str> {
    let marks = segment.features.iter();
    marks
        .map(String::as_str)
        .find(|name| name.starts_with(PART))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_lies_between_its_neighbours_and_not_in_a_hole_or_beyond_the_ends() {
        let times_s = [0.0, 10.0, 20.0, 80.0, 90.0, 100.0];
        let rows = [1.0, 2.0, 4.0, 8.0, 9.0, 10.0];
        let at = |time_s: f64| between(&times_s, time_s);
        let found = at(12.5).expect("between two");
        assert!((found.value(&rows) - 2.5).abs() < 1e-12, "{found:?}");
        assert!((found.variance() - 0.625).abs() < 1e-12);
        let on_a_row = at(20.0).expect("a row");
        assert!((on_a_row.value(&rows) - 4.0).abs() < 1e-12);
        assert!((on_a_row.variance() - 1.0).abs() < 1e-12);
        assert_eq!(at(50.0), None);
        assert!(at(104.0).is_some() && at(106.0).is_none());
    }
}
