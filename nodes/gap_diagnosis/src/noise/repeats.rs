//! Which runs repeat each other, and what their differences are.
//!
//! # Model
//!
//! R repeats of one test hold the same error and R draws of noise. Any combination whose weights are
//! orthogonal to 1 holds noise only; with orthonormal weights it has the noise of one run:
//!
//! ```text
//!   d_j = sum_i q_ij y_i,   q_j . 1 = 0,   q_j . q_k = [j = k]             (1)
//! ```
//!
//! With five repeats and more the weights are also orthogonal to time, with nine to its square, with
//! thirteen to its cube: what drifts through the session is the machine's, not noise; nor is what changed in steps (`changes`),
//! to which they are orthogonal as well. Touches are minutes apart, with a machine that warms between them: of five and more
//! half of all powers are left out, so that only what differs from one cycle to the next is noise. Touches of one
//! feature from one side, at one feed and in one pose of the rotary axes are repeats within a run as well.
//!
//! Rows of tests in motion are one where they are of one station of the path; those of a log where they are of one time
//! since its begin (`log`).
//!
//! # References
//! \[1\] ISO 230-2:2014, 4 (repeats of one test).

use std::collections::{BTreeMap, BTreeSet};

use metrology::PerAxis;
use nalgebra::DVector;
use twin::{Channel, Run, Session};

use crate::noise::joins::Joins;
use crate::search::nuisance::orthonormal;
use crate::search::rows::{Block, Row, Rows, Station, count, position, time_s};
use crate::session::log;

mod touches;

/// Repeats of touches up to which no power of time is left out.
const MOST_WITHOUT_POWERS: usize = 4;
/// Most powers of time that are left out of differences of touches.
const MOST_POWERS_OF_TOUCHES: usize = 7;

pub(crate) use touches::digit_mm;
pub use touches::{Label, is_same_touch, label};

/// Differences of one group of repeats.
#[derive(Clone, Debug)]
pub struct Contrasts {
    /// Places of the repeated blocks.
    pub blocks: Vec<usize>,
    /// The rows that all have, by place in the first block.
    pub rows: Vec<usize>,
    /// (1), each with the noise of one run.
    pub values: Vec<Vec<f64>>,
    /// Whether all repeats share one zero, so that their offsets mean something.
    pub one_zero: bool,
    /// How the repeats join, where they are runs at targets made one after another.
    pub joins: Option<Joins>,
}

/// Places of the blocks that repeat each other; a block without a repeat is a group of its own.
pub fn groups(session: &Session, rows: &Rows) -> Vec<Vec<usize>> {
    let mut groups = Vec::<Vec<usize>>::new();
    for (index, block) in rows.blocks.iter().enumerate() {
        let same = |group: &&mut Vec<usize>| is_repeat(session, &rows.blocks[group[0]], block);
        match groups.iter_mut().find(same) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

/// Groups of repeats with their differences, by channel; nothing of what changed at `steps` (the first run after each) is in
/// them.
pub fn contrasts(
    session: &Session,
    rows: &Rows,
    residual: &[f64],
    steps: &[usize],
) -> BTreeMap<Channel, Vec<Contrasts>> {
    let mut all = BTreeMap::<Channel, Vec<Contrasts>>::new();
    for group in groups(session, rows) {
        let channel = rows.blocks[group[0]].channel.clone();
        let found = between(session, rows, &group, residual, steps);
        all.entry(channel).or_default().extend(found);
    }
    all
}

/// By block of a group of touches: by row of the first, the row that repeats it.
pub(crate) fn matched(session: &Session, blocks: &[&Block]) -> Vec<Vec<Option<usize>>> {
    let matched = |block: &&Block| touches::matched(session, blocks[0], block);
    blocks.iter().map(matched).collect()
}

/// Poses of a rotary axis that differ by less are one.
const POSE_RAD: f64 = 0.01;

/// Whether two blocks are one test of one channel.
pub fn is_repeat(session: &Session, a: &Block, b: &Block) -> bool {
    let (one, other) = (&session.runs[a.run], &session.runs[b.run]);
    let is_same = a.channel == b.channel && same_condition(one, other);
    if a.run == b.run || !is_same || !log::heats_alike(session, a, b) {
        return false;
    }
    if a.channel == Channel::Touch {
        return touches::are_repeated(session, a, b);
    }
    let (from, to) = (extent(one, a), extent(other, b));
    one.motion.axes.iter().all(|axis| {
        let reach = if axis.is_linear() {
            0.2 + 0.02 * (from[axis].1 - from[axis].0)
        } else {
            POSE_RAD
        };
        let near = |p: f64, q: f64| (p - q).abs() < reach;
        near(from[axis].0, to[axis].0) && near(from[axis].1, to[axis].1)
    })
}

/// Whether two runs are one test under one condition.
pub fn same_condition(a: &Run, b: &Run) -> bool {
    let (a, b) = (&a.segment, &b.segment);
    a.kind == b.kind
        && a.plane == b.plane
        && (a.centre_mm - b.centre_mm).norm() < 0.05
        && (a.radius_mm - b.radius_mm).abs() < 0.05
        && (a.feed_mm_s - b.feed_mm_s).abs() < 0.01 * a.feed_mm_s.abs().max(1e-9)
        && a.sense == b.sense
        && a.stylus == b.stylus
        && a.stations == b.stations
        && a.features == b.features
        && (a.tool_offset_mm - b.tool_offset_mm).norm() < 0.05
}

fn extent(run: &Run, block: &Block) -> PerAxis<(f64, f64)> {
    PerAxis::from_fn(|axis| {
        if !run.motion.axes.contains(axis) {
            return (0.0, 0.0);
        }
        let all = || block.rows.iter().map(|row| position(run, row, axis));
        (
            all().fold(f64::INFINITY, f64::min),
            all().fold(f64::NEG_INFINITY, f64::max),
        )
    })
}

fn between(
    session: &Session,
    rows: &Rows,
    group: &[usize],
    residual: &[f64],
    steps: &[usize],
) -> Vec<Contrasts> {
    let blocks: Vec<&Block> = group.iter().map(|k| &rows.blocks[*k]).collect();
    let mut found = Vec::new();
    if let Some(contrasts) = runs_between(session, group, &blocks, residual, steps) {
        found.push(contrasts);
    } else if blocks[0].channel == Channel::Touch {
        for (place, block) in group.iter().zip(blocks) {
            found.extend(touches::between(
                &session.runs[block.run],
                *place,
                block,
                residual,
            ));
        }
    }
    found
}

/// The rows that all blocks have, by block; touches are one where they meet the same place alike, whatever each run lacks.
pub fn shared(session: &Session, blocks: &[&Block]) -> Vec<Vec<usize>> {
    if blocks[0].channel == Channel::Touch {
        return touches::shared(session, blocks);
    }
    let stations =
        |block: &Block| -> BTreeSet<Station> { block.rows.iter().map(|row| row.station).collect() };
    let mut shared = stations(blocks[0]);
    for block in &blocks[1..] {
        shared = &shared & &stations(block);
    }
    let of = |block: &&Block| -> Vec<usize> {
        (0..block.rows.len())
            .filter(|k| shared.contains(&block.rows[*k].station))
            .collect()
    };
    blocks.iter().map(of).collect()
}

fn runs_between(
    session: &Session,
    group: &[usize],
    blocks: &[&Block],
    residual: &[f64],
    steps: &[usize],
) -> Option<Contrasts> {
    if blocks.len() < 2 {
        return None;
    }
    if log::is_log(&session.runs[blocks[0].run]) {
        return log_between(session, group, blocks, residual);
    }
    let places = shared(session, blocks);
    if places[0].is_empty() || 2 * places[0].len() < blocks[0].rows.len() {
        return None;
    }
    let times: Vec<f64> = blocks
        .iter()
        .map(|block| time_s(&session.runs[block.run], &block.rows[0]))
        .collect();
    let runs: Vec<usize> = blocks.iter().map(|block| block.run).collect();
    let powers = powers(&blocks[0].channel, times.len());
    let values: Vec<Vec<f64>> = weights_beside(&times, &runs, steps, powers)
        .iter()
        .map(|weight| {
            (0..places[0].len())
                .map(|row| {
                    let part = |i: usize| weight[i] * residual[blocks[i].start + places[i][row]];
                    (0..blocks.len()).map(part).sum()
                })
                .collect()
        })
        .collect();
    let joins = Joins::new(session, blocks, &places, residual, steps);
    let (rows, values) = match blocks[0].channel {
        Channel::Touch => {
            let first = (&session.runs[blocks[0].run], blocks[0]);
            let of_place = |row: usize| {
                let of_block =
                    |(block, rows): (&&Block, &Vec<usize>)| residual[block.start + rows[row]];
                blocks.iter().zip(&places).map(of_block).collect()
            };
            let digit_mm = digit_mm((0..places[0].len()).map(of_place));
            touches::of_noise(first, &places[0], values, digit_mm)
        }
        _ => (places[0].clone(), values),
    };
    (!values.is_empty()).then(|| Contrasts {
        blocks: group.to_vec(),
        rows,
        joins,
        values,
        one_zero: have_one_zero(session, blocks),
    })
}

fn have_one_zero(session: &Session, blocks: &[&Block]) -> bool {
    let zero = |block: &Block| {
        let segment = &session.runs[block.run].segment;
        (segment.zero_id, segment.setup_id)
    };
    blocks.iter().all(|block| zero(block) == zero(blocks[0]))
}

/// Differences of logs, at the times since their begin of the rows of one of them. What lies between two rows is taken from
/// both, (1 - f) y_a + f y_b, which has c = (1 - f)^2 + f^2 of the variance of a row; the sum (1) is brought back to that of
/// one.
fn log_between(
    session: &Session,
    group: &[usize],
    blocks: &[&Block],
    residual: &[f64],
) -> Option<Contrasts> {
    let kept = log::long_enough(session, blocks);
    let logs: Vec<&Block> = kept.iter().map(|k| blocks[*k]).collect();
    let first = logs.first()?;
    let since_s: Vec<Vec<f64>> = logs
        .iter()
        .map(|block| log::since_s(session, block))
        .collect();
    let at = |row: usize| -> Option<Vec<log::Between>> {
        let all = since_s
            .iter()
            .map(|times| log::between(times, since_s[0][row]));
        all.collect()
    };
    let shared = (0..first.rows.len()).filter_map(|row| Some((row, at(row)?)));
    let (rows, places): (Vec<usize>, Vec<Vec<log::Between>>) = shared.unzip();
    if logs.len() < 2 || 2 * rows.len() < first.rows.len() {
        return None;
    }
    let begins_s: Vec<f64> = logs
        .iter()
        .map(|block| time_s(&session.runs[block.run], &block.rows[0]))
        .collect();
    let of_row = |weight: &DVector<f64>, places: &Vec<log::Between>| {
        let (mut sum, mut variance) = (0.0, 0.0);
        for ((block, place), weight) in logs.iter().zip(places).zip(weight.iter()) {
            sum += weight * place.value(&residual[block.range()]);
            variance += weight * weight * place.variance();
        }
        sum / variance.sqrt()
    };
    let values = weights(&begins_s)
        .iter()
        .map(|weight| places.iter().map(|row| of_row(weight, row)).collect())
        .collect();
    Some(Contrasts {
        blocks: kept.iter().map(|k| group[*k]).collect(),
        rows,
        values,
        one_zero: have_one_zero(session, &logs),
        joins: None,
    })
}

/// Weights of (1) for repeats at some times.
fn weights(times: &[f64]) -> Vec<DVector<f64>> {
    weights_beside(times, &[], &[], powers_of_motion(times.len()))
}

/// Powers of time to which differences of so many repeats are orthogonal.
fn powers(channel: &Channel, repeats: usize) -> usize {
    match channel {
        Channel::Touch if repeats > MOST_WITHOUT_POWERS => {
            (repeats.saturating_sub(1) / 2).min(MOST_POWERS_OF_TOUCHES)
        }
        _ => powers_of_motion(repeats),
    }
}

fn powers_of_motion(repeats: usize) -> usize {
    (repeats.saturating_sub(1) / 4).min(3)
}

/// The same, orthogonal to steps as well, and to so many powers of time.
fn weights_beside(
    times: &[f64],
    runs: &[usize],
    steps: &[usize],
    powers: usize,
) -> Vec<DVector<f64>> {
    let n = times.len();
    let (first, last) = (times[0], times[n - 1]);
    let scaled = |t: f64| (t - first) / (last - first).max(f64::MIN_POSITIVE) * 2.0 - 1.0;
    let smooth = (0..=powers).map(|power| {
        let power = i32::try_from(power).expect("at most seven");
        DVector::from_iterator(n, times.iter().map(|t| scaled(*t).powi(power)))
    });
    let unit = (0..n).map(|i| DVector::from_fn(n, |row, _| if row == i { 1.0 } else { 0.0 }));
    let stepped = steps.iter().map(|step| {
        let after = runs.iter().map(|run| f64::from(u8::from(run >= step)));
        DVector::from_iterator(n, after)
    });
    let taken = orthonormal(n, smooth.chain(stepped));
    let own = (0..taken.ncols()).map(|k| taken.column(k).into_owned());
    let basis = orthonormal(n, own.chain(unit));
    (taken.ncols()..basis.ncols())
        .map(|k| basis.column(k).into_owned())
        .collect()
}

/// Mean variance of the readings within a row about their mean, mm2; the middle one over all rows. `residual` is that
/// of each reading of each run: what the machine is known to do within a row is no noise.
pub fn within_row_variance(residual: &[Vec<f64>], blocks: &[&Block]) -> f64 {
    let of_row = |run: usize, row: &Row| {
        let n = count(row.readings.len());
        let values = || row.readings.iter().map(|k| residual[run][*k]);
        let mean = values().sum::<f64>() / n;
        values().map(|v| (v - mean).powi(2)).sum::<f64>() / n
    };
    let mut all: Vec<f64> = blocks
        .iter()
        .flat_map(|block| block.rows.iter().map(|row| of_row(block.run, row)))
        .collect();
    if all.is_empty() {
        return 0.0;
    }
    let middle = all.len() / 2;
    all.select_nth_unstable_by(middle, f64::total_cmp);
    all[middle]
}
