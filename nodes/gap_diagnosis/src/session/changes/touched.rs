//! Touches that repeat each other over the session, one series for each place that is touched.
//!
//! A machine that warms moves touches smoothly, and much further than they scatter. Steps of touches are therefore looked for
//! beside as many powers of time as their number allows, and must leave less than the best lagged thermometer does.

use machine::cycle::FeatureId;
use nalgebra::{DMatrix, DVector};
use twin::{Channel, Session, Touch};

use super::series::{Point, Series};
use crate::noise::repeats;
use crate::search::rows::{Block, Rows, time_s};

/// Lags that a thermometer is tried with, s.
const LAGS_S: [f64; 3] = [0.0, 900.0, 3600.0];
/// Most series of touches that steps are looked for in.
const MOST_SERIES: usize = 48;
/// What a move may leave of the steps of what moved, as a share of the largest.
const MOST_OF_A_MOVE: f64 = 0.1;
/// The same, over what its touches scatter by.
const MOST_DEVIATIONS_OF_A_MOVE: f64 = 4.0;

/// Powers of time that so many touches of one place leave out.
pub(super) fn powers(touches: usize) -> usize {
    (touches.saturating_sub(1) / 4).min(3)
}

/// One series for each touch of a group of repeats, under each set-up.
pub(super) fn of_group(
    session: &Session,
    (group, own): (usize, &[usize]),
    rows: &Rows,
    raw: &[f64],
    warmings: &[Vec<f64>],
) -> Vec<Series> {
    let blocks: Vec<&Block> = own.iter().map(|place| &rows.blocks[*place]).collect();
    let matches = repeats::matched(session, &blocks);
    let set_up = |block: &Block| session.runs[block.run].segment.setup_id;
    let mut set_ups: Vec<u32> = blocks.iter().map(|block| set_up(block)).collect();
    set_ups.sort_unstable();
    set_ups.dedup();
    let of = |row: usize, wanted: u32| {
        let point = |at: usize| {
            let block = blocks[at];
            let place = matches[at][row].filter(|_| set_up(block) == wanted)?;
            let value_mm = raw[block.start + place];
            value_mm.is_finite().then(|| Point {
                group,
                run: block.run,
                time_s: time_s(&session.runs[block.run], &block.rows[place]),
                value_mm,
            })
        };
        let points: Vec<Point> = (0..blocks.len()).filter_map(point).collect();
        let first = &blocks[0].rows[row];
        let touch = first
            .touch
            .and_then(|at| session.runs[blocks[0].run].touches.get(at));
        let heat = |warming: &Vec<f64>| -> Vec<f64> {
            let at = |point: &Point| session.history.at(warming, point.time_s);
            points.iter().map(at).collect()
        };
        let by_heat = warmings.iter().map(heat);
        let is_whole = |column: &Vec<f64>| column.iter().all(|value| value.is_finite());
        Series {
            channel: Channel::Touch,
            touch: touch.cloned(),
            is_shared: false,
            powers: powers(points.len()),
            by_heat: by_heat.filter(is_whole).collect(),
            points,
        }
    };
    (0..blocks[0].rows.len())
        .flat_map(|row| set_ups.iter().map(move |set_up| (row, *set_up)))
        .map(|(row, set_up)| of(row, set_up))
        .collect()
}

/// What every thermometer shows since the session began, with each lag.
pub(super) fn warmings(session: &Session) -> Vec<Vec<f64>> {
    let history = &session.history;
    let of = |sensor: &String| {
        let warming_k = history.warming_k(sensor).unwrap_or_default();
        let lagged = move |lag_s: f64| {
            if lag_s > 0.0 {
                history.lagged_temperature(&warming_k, lag_s)
            } else {
                warming_k.clone()
            }
        };
        LAGS_S.map(lagged)
    };
    history.temperature_degc.keys().flat_map(of).collect()
}

/// The series that steps are looked for in: of many touches those that a single step explains best.
pub(super) fn most_telling(all: Vec<Series>, boundaries: &[usize]) -> Vec<Series> {
    let is_touch = |own: &Series| own.channel == Channel::Touch;
    let (touches, mut others): (Vec<Series>, Vec<Series>) = all.into_iter().partition(is_touch);
    let gain = |own: &Series| {
        let gains = boundaries.iter().map(|at| own.gain(&[*at]));
        gains.fold(0.0, f64::max)
    };
    if touches.len() <= MOST_SERIES {
        others.extend(touches);
        return others;
    }
    let mut ranked: Vec<(f64, Series)> = touches.into_iter().map(|own| (gain(&own), own)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    others.extend(ranked.into_iter().take(MOST_SERIES).map(|(_, own)| own));
    others
}

/// Block, sphere or bore that a touch is of.
fn owner(touch: &Touch) -> &str {
    FeatureId::parse(&touch.feature_id).map_or(&touch.feature_id, |id| id.owner())
}

/// Whether the steps of the touches that show one are those of a single block or artefact that moved, d in
///
/// ```text
///   step of a touch = a . d,   a its approach                              (1)
/// ```
///
/// A reference point that shifts, or heat, moves whatever is touched; where there is one thing only, they are the same.
pub(super) fn is_of_one_that_moved(
    all: &[Series],
    shown: &[&Series],
    steps: &[usize],
    at: usize,
) -> bool {
    let mut owners: Vec<&str> = { shown.iter() }
        .filter_map(|own| own.touch.as_ref().map(owner))
        .collect();
    owners.sort_unstable();
    owners.dedup();
    let [one] = owners[..] else {
        return false;
    };
    let is_own = |own: &&Series| own.touch.as_ref().is_some_and(|touch| owner(touch) == one);
    let of_owner = all.iter().filter(is_own);
    let of_owner: Vec<&Series> = of_owner
        .filter(|own| own.around(steps[at]).is_some())
        .collect();
    let sizes: Vec<f64> = { of_owner.iter() }
        .map(|own| own.sizes_mm(steps, at).first().copied().unwrap_or(0.0))
        .collect();
    let approach = |row: usize, axis: usize| {
        of_owner[row]
            .touch
            .as_ref()
            .map_or(0.0, |touch| touch.approach[axis])
    };
    if sizes.is_empty() {
        return false;
    }
    let sizes = DVector::from_vec(sizes);
    let approaches = DMatrix::from_fn(sizes.len(), 3, approach);
    let svd = approaches.clone().svd(true, true);
    let Ok(moved) = svd.solve(&sizes, 1e-6) else {
        return false;
    };
    let left = &sizes - approaches * moved;
    let scatter_mm = { of_owner.iter() }.map(|own| own.deviation_mm(steps));
    let scatter_mm = scatter_mm.fold(0.0, f64::max);
    let most_mm = MOST_OF_A_MOVE * sizes.amax();
    left.amax() <= most_mm.max(MOST_DEVIATIONS_OF_A_MOVE * scatter_mm)
}

impl Series {
    /// What the best of the lagged thermometers leaves, as a sum of squares; without one everything.
    pub(super) fn left_by_heat(&self) -> f64 {
        let columns = self.by_heat.iter().cloned();
        let left = columns.map(|column| self.left(vec![column.into()]).0);
        left.fold(f64::INFINITY, f64::min)
    }

    /// Powers of time from one on, scaled to the session.
    pub(super) fn smooth(&self, powers: std::ops::RangeInclusive<usize>) -> Vec<DVector<f64>> {
        let times = || self.points.iter().map(|point| point.time_s);
        let first = times().fold(f64::INFINITY, f64::min);
        let last = times().fold(f64::NEG_INFINITY, f64::max);
        let scaled = |t: f64| (t - first) / (last - first).max(f64::MIN_POSITIVE) * 2.0 - 1.0;
        let column = |power: usize| {
            let power = i32::try_from(power).unwrap_or(1);
            self.by_group(&move |p: &Point| scaled(p.time_s).powi(power))
        };
        powers.flat_map(column).collect()
    }
}

#[cfg(test)]
mod tests {
    use metrology::PerAxis;
    use nalgebra::Vector3;

    use super::*;
    use crate::search::rows::count;

    /// Twelve touches along each of some approaches, that step by so much at the seventh.
    fn stepped(features: &[(&str, [f64; 3], f64)]) -> Vec<Series> {
        let of = |(feature, approach, size_mm): &(&str, [f64; 3], f64)| {
            let touch = Touch {
                time_s: 0.0,
                feature_id: (*feature).to_owned(),
                approach: Vector3::from(*approach),
                feed_mm_s: 2.0,
                position: PerAxis::default(),
                tick: None,
            };
            let point = |run: usize| {
                let off = if run.is_multiple_of(2) { 1e-5 } else { -1e-5 };
                Point {
                    group: 0,
                    run,
                    time_s: 1200.0 * count(run),
                    value_mm: off + if run >= 6 { *size_mm } else { 0.0 },
                }
            };
            Series {
                channel: Channel::Touch,
                touch: Some(touch),
                points: (0..12).map(point).collect(),
                is_shared: false,
                powers: powers(12),
                by_heat: vec![],
            }
        };
        features.iter().map(of).collect()
    }

    fn moved(all: &[Series]) -> bool {
        let shown: Vec<&Series> = all
            .iter()
            .filter(|own| own.size_mm(&[6], 0) > 1e-3)
            .collect();
        is_of_one_that_moved(all, &shown, &[6], 0)
    }

    #[test]
    fn eq1_a_block_moves_for_itself_and_a_smaller_ball_does_not() {
        let block = |size_mm: f64| {
            stepped(&[
                ("block_1.x", [1.0, 0.0, 0.0], 0.0),
                ("block_1.y", [0.0, -1.0, 0.0], size_mm),
                ("block_1.z", [0.0, 0.0, -1.0], 0.5 * size_mm),
                ("block_2.y", [0.0, 1.0, 0.0], 0.0),
            ])
        };
        assert!(moved(&block(5e-3)));
        let ball = |sizes_mm: [f64; 3]| {
            stepped(&[
                ("sphere_1.1", [1.0, 0.0, 0.0], sizes_mm[0]),
                ("sphere_1.2", [-1.0, 0.0, 0.0], sizes_mm[1]),
                ("sphere_1.3", [0.0, 0.0, -1.0], sizes_mm[2]),
            ])
        };
        assert!(moved(&ball([4e-3, -4e-3, 2e-3])), "the sphere moved");
        assert!(
            !moved(&ball([4e-3, 4e-3, 4e-3])),
            "the stylus' ball is smaller"
        );
        let two = [
            ("block_1.y", [0.0, 1.0, 0.0], 4e-3),
            ("block_2.y", [0.0, -1.0, 0.0], -4e-3),
        ];
        assert!(!moved(&stepped(&two)), "the axis counts from another place");
    }
}
