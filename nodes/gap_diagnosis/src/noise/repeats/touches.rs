//! Touches that repeat each other, within a run and between runs.

use std::collections::BTreeMap;

use metrology::Axis;
use nalgebra::DVector;
use twin::{Run, Session, Touch};

use super::{Contrasts, POSE_RAD, weights};
use crate::search::rows::{Block, Row, time_s};

/// Touches whose axes stood further apart, mm, are of two places; latency, drift and compensation move less.
const SAME_PLACE_MM: f64 = 1.0;
/// Greatest difference of the directions of two approaches that are one.
const SAME_APPROACH: f64 = 0.01;
/// Greatest difference of two feeds that are one, as a share: they are measured.
const SAME_MEASURED_FEED: f64 = 0.02;

/// What touches that repeat each other have in common.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Label {
    feature: String,
    /// Directions in hundredths, the feed in hundredths of mm/s.
    approach: [i64; 4],
    /// Of the rotary axes, in hundredths of a radian.
    pose: Vec<i64>,
}

/// Feature, approach, feed and pose of a touch.
pub fn label(touch: &Touch) -> Label {
    #[expect(clippy::cast_possible_truncation, reason = "a label, rounded")]
    let rounded = |value: f64| (value * 100.0).round() as i64;
    let a = touch.approach;
    let pose = Axis::ROTARY.map(|axis| rounded(touch.position[axis]));
    Label {
        feature: touch.feature_id.clone(),
        approach: [a.x, a.y, a.z, touch.feed_mm_s].map(rounded),
        pose: pose.to_vec(),
    }
}

/// Touches of one feature, approach, feed and pose within a run.
pub(super) fn between(run: &Run, place: usize, block: &Block, residual: &[f64]) -> Vec<Contrasts> {
    let mut same = BTreeMap::<Label, Vec<usize>>::new();
    for (index, row) in block.rows.iter().enumerate() {
        if let Some(touch) = touch_of(run, row) {
            same.entry(label(touch)).or_default().push(index);
        }
    }
    let contrast = |rows: Vec<usize>| {
        let times: Vec<f64> = rows.iter().map(|k| time_s(run, &block.rows[*k])).collect();
        let of = |weight: &DVector<f64>| {
            let parts = rows.iter().zip(weight.iter());
            vec![parts.map(|(k, w)| w * residual[block.start + k]).sum()]
        };
        let values = weights(&times).iter().map(of).collect();
        Contrasts {
            blocks: vec![place],
            rows: vec![rows[0]],
            values,
            one_zero: false,
            joins: None,
        }
    };
    same.into_values()
        .filter(|rows| rows.len() > 1)
        .map(contrast)
        .collect()
}

fn touch_of<'r>(run: &'r Run, row: &Row) -> Option<&'r Touch> {
    row.touch.and_then(|touch| run.touches.get(touch))
}

/// Whether two touches meet one place alike.
fn is_same(a: &Touch, b: &Touch) -> bool {
    let off = |axis: &Axis| (a.position[*axis] - b.position[*axis]).abs();
    let feeds_mm_s = (a.feed_mm_s - b.feed_mm_s).abs();
    a.feature_id == b.feature_id
        && (a.approach - b.approach).norm() < SAME_APPROACH
        && (feeds_mm_s.is_nan() || feeds_mm_s <= SAME_MEASURED_FEED * a.feed_mm_s.abs())
        && Axis::LINEAR.iter().all(|axis| off(axis) < SAME_PLACE_MM)
        && Axis::ROTARY.iter().all(|axis| off(axis) < POSE_RAD)
}

/// By row of `block`: the row of `other` that repeats it, each at most once.
fn matched(session: &Session, block: &Block, other: &Block) -> Vec<Option<usize>> {
    let (one, again) = (&session.runs[block.run], &session.runs[other.run]);
    let mut free = vec![true; other.rows.len()];
    let of = |row: &Row| {
        let touch = touch_of(one, row)?;
        let repeats = |k: &usize| {
            free[*k] && touch_of(again, &other.rows[*k]).is_some_and(|it| is_same(touch, it))
        };
        let found = (0..other.rows.len()).find(repeats)?;
        free[found] = false;
        Some(found)
    };
    block.rows.iter().map(of).collect()
}

/// Whether at least half of the touches of each of two blocks are in the other.
pub(super) fn are_repeated(session: &Session, a: &Block, b: &Block) -> bool {
    let both = matched(session, a, b).into_iter().flatten().count();
    both > 0 && 2 * both >= a.rows.len().max(b.rows.len())
}

/// The rows that all blocks have, by block, in the order of the first.
pub(super) fn shared(session: &Session, blocks: &[&Block]) -> Vec<Vec<usize>> {
    let matches: Vec<Vec<Option<usize>>> = blocks
        .iter()
        .map(|block| matched(session, blocks[0], block))
        .collect();
    let in_all = |row: &usize| matches.iter().all(|rows| rows[*row].is_some());
    let rows: Vec<usize> = (0..blocks[0].rows.len()).filter(in_all).collect();
    let of = |matches: &Vec<Option<usize>>| rows.iter().filter_map(|row| matches[*row]).collect();
    matches.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use metrology::{AxisSet, PerAxis};
    use nalgebra::Vector3;
    use twin::{Channel, Motion, Reading};

    use super::*;
    use crate::preflight::rig;
    use crate::search::rows::{Rows, count};

    /// Six faces of two blocks, as a cycle touches them; the deviation of each is its number, mm.
    const FACES: [(&str, [f64; 3], [f64; 3]); 6] = [
        ("block_1.x", [1.0, 0.0, 0.0], [-223.0, -174.0, 14.0]),
        ("block_1.y", [0.0, 1.0, 0.0], [-214.0, -183.0, 14.0]),
        ("block_1.z", [0.0, 0.0, -1.0], [-214.0, -174.0, 23.0]),
        ("block_2.x", [-1.0, 0.0, 0.0], [223.0, 174.0, 194.0]),
        ("block_2.y", [0.0, -1.0, 0.0], [214.0, 183.0, 194.0]),
        ("block_2.z", [0.0, 0.0, -1.0], [214.0, 174.0, 203.0]),
    ];

    /// A cycle without some of its touches, measured at feeds that differ a little.
    fn cycle(of: &Run, lacks: &[usize], feed_mm_s: f64) -> Run {
        let touched: Vec<usize> = (0..FACES.len()).filter(|k| !lacks.contains(k)).collect();
        let touches = touched.iter().map(|k| {
            let (feature, approach, place) = FACES[*k];
            let mut position = PerAxis::default();
            for axis in Axis::LINEAR {
                position[axis] = place[axis.index()];
            }
            Touch {
                time_s: 2.0 * count(*k),
                feature_id: feature.to_owned(),
                approach: Vector3::from(approach),
                feed_mm_s,
                position,
                tick: None,
            }
        });
        let readings = touched.iter().enumerate().map(|(at, k)| Reading {
            channel: Channel::Touch,
            at,
            fraction: 0.0,
            deviation: count(*k),
        });
        let still = PerAxis::from_fn(|_| vec![0.0; 3]);
        let motion = Motion::new(vec![0.0, 1.0, 2.0], AxisSet::XYZ, still);
        Run {
            segment: of.segment.clone(),
            motion: motion.expect("a motion"),
            touches: touches.collect(),
            readings: readings.collect(),
        }
    }

    #[test]
    fn a_touch_that_one_run_lacks_is_lacking_in_their_differences_alone() {
        let mut session = rig::circles(&rig::machine(), &[50.0], 1);
        let of = session.runs.remove(0);
        for lacks in [vec![], vec![0], vec![2], vec![5], vec![1, 4]] {
            session.runs = vec![cycle(&of, &[], 2.0), cycle(&of, &lacks, 2.006)];
            let rows = Rows::new(&session, &[0, 1], 60, |_| true);
            assert_eq!(super::super::groups(&session, &rows), [[0, 1]], "{lacks:?}");
            let blocks: Vec<&Block> = rows.blocks.iter().collect();
            let both = shared(&session, &blocks);
            assert_eq!(both[0].len(), FACES.len() - lacks.len());
            let values = |run: usize| -> Vec<f64> {
                let row = |row: &usize| session.runs[run].readings[*row].deviation;
                both[run].iter().map(row).collect()
            };
            assert_eq!(values(0), values(1), "{lacks:?}");
        }
        session.runs = vec![cycle(&of, &[], 2.0), cycle(&of, &[0, 1, 2, 3], 2.0)];
        let rows = Rows::new(&session, &[0, 1], 60, |_| true);
        assert_eq!(super::super::groups(&session, &rows).len(), 2);
    }
}
