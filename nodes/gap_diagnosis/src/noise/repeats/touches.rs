//! Touches that repeat each other, within a run and between runs.

use std::collections::BTreeMap;

use metrology::Axis;
use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use twin::{Run, Session, Touch};

use super::{Contrasts, POSE_RAD, weights};
use crate::noise::MIN_NOISE_ROWS;
use crate::search::rows::{Block, Row, count, time_s};

/// Touches whose axes stood further apart, mm, are of two places; latency, drift and compensation move less.
const SAME_PLACE_MM: f64 = 1.0;
/// Greatest difference of the directions of two approaches that are one.
const SAME_APPROACH: f64 = 0.01;
/// Greatest difference of two feeds that are one, as a share: they are measured.
const SAME_MEASURED_FEED: f64 = 0.02;

/// Fewest surfaces and differences that show which surface differs more than the others.
const FEWEST_SURFACES: usize = 3;
const FEWEST_DIFFERENCES: usize = 3;
/// Chance that noise of a surface has more than what is still noise, and by how much surfaces may differ beside.
const CHANCE_OF_A_SURFACE: f64 = 1e-4;
const MOST_BESIDE: f64 = 4.0;

/// Mean of so many squares over that of the middle surface from which it is not noise.
fn most_of_middle(squares: usize) -> f64 {
    let law = ChiSquared::new(count(squares)).ok();
    law.map_or(f64::INFINITY, |law| {
        MOST_BESIDE * law.inverse_cdf(1.0 - CHANCE_OF_A_SURFACE) / law.inverse_cdf(0.5)
    })
}

/// Less than this is rounding of numbers, mm.
const LEAST_DIGIT_MM: f64 = 1e-9;

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

/// The least that neighbouring values differ by at all: one digit, where they are rounded.
pub(crate) fn digit_mm(series: impl Iterator<Item = Vec<f64>>) -> f64 {
    let steps = series.flat_map(|own| {
        let apart = own.windows(2).map(|two| (two[1] - two[0]).abs());
        apart.filter(|mm| *mm > LEAST_DIGIT_MM).collect::<Vec<_>>()
    });
    let least = steps.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// Rows and differences of touches without those of surfaces that differ far more than most: something of its own happens there, as
/// where a block creeps in its clamp.
/// `digit_mm` is the least that readings of one place differ by, where they are rounded: surfaces whose last digit stands still are
/// no measure of the others.
pub(super) fn of_noise(
    (run, block): (&Run, &Block),
    rows: &[usize],
    values: Vec<Vec<f64>>,
    digit_mm: f64,
) -> (Vec<usize>, Vec<Vec<f64>>) {
    let surface = |row: &usize| {
        let label = touch_of(run, &block.rows[*row]).map(label);
        label.map(|own| (own.feature, own.approach[..3].to_vec()))
    };
    let mut surfaces = BTreeMap::<_, Vec<usize>>::new();
    for (place, row) in rows.iter().enumerate() {
        surfaces.entry(surface(row)).or_default().push(place);
    }
    let square = |place: &usize| values.iter().map(|own| own[*place].powi(2)).sum::<f64>();
    let mean = |places: &Vec<usize>| {
        places.iter().map(square).sum::<f64>() / count(places.len() * values.len().max(1))
    };
    let mut ranked: Vec<f64> = surfaces.values().map(mean).collect();
    ranked.sort_by(f64::total_cmp);
    if ranked.len() < FEWEST_SURFACES || values.len() < FEWEST_DIFFERENCES {
        return (rows.to_vec(), values);
    }
    let middle = ranked[(ranked.len() - 1) / 2].max(digit_mm.powi(2) / 12.0);
    let is_noise =
        |places: &&Vec<usize>| mean(places) <= most_of_middle(places.len() * values.len()) * middle;
    let mut kept: Vec<usize> = surfaces
        .values()
        .filter(is_noise)
        .flatten()
        .copied()
        .collect();
    if kept.len() * values.len() < MIN_NOISE_ROWS {
        return (rows.to_vec(), values);
    }
    kept.sort_unstable();
    let of = |own: &Vec<f64>| kept.iter().map(|place| own[*place]).collect();
    let values = values.iter().map(of).collect();
    (kept.iter().map(|place| rows[*place]).collect(), values)
}

/// Whether two touches meet one place alike.
pub fn is_same_touch(a: &Touch, b: &Touch) -> bool {
    let off = |axis: &Axis| (a.position[*axis] - b.position[*axis]).abs();
    let feeds_mm_s = (a.feed_mm_s - b.feed_mm_s).abs();
    a.feature_id == b.feature_id
        && (a.approach - b.approach).norm() < SAME_APPROACH
        && (feeds_mm_s.is_nan() || feeds_mm_s <= SAME_MEASURED_FEED * a.feed_mm_s.abs())
        && Axis::LINEAR.iter().all(|axis| off(axis) < SAME_PLACE_MM)
        && Axis::ROTARY.iter().all(|axis| off(axis) < POSE_RAD)
}

/// By row of `block`: the row of `other` that repeats it, each at most once.
pub(super) fn matched(session: &Session, block: &Block, other: &Block) -> Vec<Option<usize>> {
    let (one, again) = (&session.runs[block.run], &session.runs[other.run]);
    let mut free = vec![true; other.rows.len()];
    let of = |row: &Row| {
        let touch = touch_of(one, row)?;
        let repeats = |k: &usize| {
            free[*k] && touch_of(again, &other.rows[*k]).is_some_and(|it| is_same_touch(touch, it))
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
    use crate::search::rows::Rows;

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

    /// A session of one cycle, its rows, and the places of all its faces.
    fn one_cycle() -> (Session, Rows, Vec<usize>) {
        let mut session = rig::circles(&rig::machine(), &[50.0], 1);
        session.runs = vec![cycle(&session.runs[0], &[], 2.0)];
        let rows = Rows::new(&session, &[0], 60, |_| true);
        (session, rows, (0..FACES.len()).collect())
    }

    #[test]
    fn a_surface_that_differs_far_more_than_the_others_is_not_in_the_noise() {
        let (session, rows, all) = one_cycle();
        let block = &rows.blocks[0];
        let values: Vec<Vec<f64>> = [1.0, -1.1, 0.9, 1.2]
            .iter()
            .map(|own| vec![*own, -0.8, 11.0 * own, 0.7, 1.1, -own])
            .collect();
        let (kept, left) = of_noise((&session.runs[0], block), &all, values.clone(), 0.0);
        assert_eq!(kept, [0, 1, 3, 4, 5]);
        assert!(left.iter().flatten().all(|own| own.abs() < 1.3), "{left:?}");
        let alike: Vec<Vec<f64>> = values
            .iter()
            .map(|own| own.iter().map(|v| v.signum()).collect())
            .collect();
        let (kept, left) = of_noise((&session.runs[0], block), &all, alike.clone(), 0.0);
        assert_eq!((kept, left), (all, alike));
    }

    #[test]
    fn surfaces_whose_last_digit_stands_still_are_no_measure_of_the_others() {
        let (session, rows, all) = one_cycle();
        let block = &rows.blocks[0];
        // Two micrometres a digit: one surface lies between two digits, the others do not.
        let values: Vec<Vec<f64>> = [1.0, -1.0, 1.0, 1.0]
            .iter()
            .map(|own| vec![1e-3 * own, 0.0, 0.0, 0.0, 0.0, 0.0])
            .collect();
        let of_digit =
            |digit_mm: f64| of_noise((&session.runs[0], block), &all, values.clone(), digit_mm).0;
        assert_eq!(of_digit(2e-3), all);
        assert_eq!(of_digit(0.0), all[1..]);
        let rounded = [vec![0.0, 2e-3, 0.0, 4e-3], vec![2e-3; 4]];
        assert!((digit_mm(rounded.into_iter()) - 2e-3).abs() < 1e-12);
    }
}
