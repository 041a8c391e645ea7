//! Which readings of a run count: means at stops, or means of neighbours while it is in motion.

use std::ops::Range;

use machine::twin::Motion;
use machine::twin::simulate::plate_axes;
use metrology::Axis;
use metrology::sample::{TestKind, TestSegment};

use super::channels::Raw;

/// The command is on the circle when it is this close to it, mm.
const ON_CIRCLE_MM: f64 = 2e-3;
/// Share of the feed below which the command is still running in.
const AT_FEED: f64 = 0.98;
/// A command that changes by less stands, mm or rad.
const STANDSTILL: f64 = 1e-6;
/// Ticks further apart than this times the finest spacing are not at the full rate.
const FULL_RATE: f64 = 1.5;
/// Stops that make a run one that is measured at its stops, where its segment does not say so.
const LEAST_STOPS: usize = 3;

/// How the readings of a run are selected.
pub(super) enum Selection {
    /// Means over these ticks, each a settled stop.
    Stops(Vec<Range<usize>>),
    /// Ticks that count, one entry for each.
    Motion(Vec<bool>),
}

impl Selection {
    /// What a run asks for.
    pub(super) fn of(
        segment: &TestSegment,
        motion: &Motion,
        lead_in: usize,
        settle_s: f64,
    ) -> Self {
        let is_linear = matches!(segment.kind, TestKind::Positioning | TestKind::Diagonal);
        if segment.stations > 0 || is_linear {
            let stops = stops(motion, lead_in, settle_s);
            if segment.stations > 0 || stops.len() >= LEAST_STOPS {
                return Self::Stops(stops);
            }
        }
        let mut counts = at_full_rate(motion, lead_in);
        if segment.kind == TestKind::Circle {
            on_circle(segment, motion, &mut counts);
        } else if segment.kind != TestKind::Dwell {
            between_motions(motion, lead_in, &mut counts);
        }
        Self::Motion(counts)
    }

    /// Ticks in motion that count.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Stops(stops) => stops.len(),
            Self::Motion(counts) => counts.iter().filter(|counts| **counts).count(),
        }
    }

    /// Means of a channel; `block` neighbours of a run in motion make one.
    pub(super) fn apply(&self, series: &[Raw], block: usize) -> Vec<Raw> {
        match self {
            Self::Stops(stops) => stops
                .iter()
                .filter_map(|stop| {
                    let within = |raw: &&Raw| stop.contains(&index(raw.place));
                    mean(series.iter().filter(within), 1)
                })
                .collect(),
            Self::Motion(counts) => {
                let selected: Vec<&Raw> = series
                    .iter()
                    .filter(|raw| counts.get(index(raw.place)).is_some_and(|c| *c))
                    .collect();
                let Some(first) = selected.first().map(|raw| index(raw.place)) else {
                    return vec![];
                };
                let block_of = |raw: &&Raw| index(raw.place).saturating_sub(first) / block;
                let blocks = || selected.chunk_by(|a, b| block_of(a) == block_of(b));
                // An instrument may read less often than the axes are told.
                let whole = blocks().map(<[&Raw]>::len).max().unwrap_or(0);
                blocks()
                    .filter_map(|chunk| mean(chunk.iter().copied(), whole.div_ceil(2)))
                    .collect()
            }
        }
    }
}

/// Tick at or before a place.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a place is an index and a fraction"
)]
pub(super) fn index(place: f64) -> usize {
    place as usize
}

fn mean<'a>(raws: impl Iterator<Item = &'a Raw>, least: usize) -> Option<Raw> {
    let (mut place, mut deviation, mut n) = (0.0, 0.0, 0_usize);
    for raw in raws {
        place += raw.place;
        deviation += raw.deviation;
        n += 1;
    }
    (n >= least.max(1)).then(|| Raw {
        place: place / n as f64,
        deviation: deviation / n as f64,
    })
}

fn stands(motion: &Motion, k: usize) -> bool {
    let change = |axis: Axis| (motion.position[axis][k] - motion.position[axis][k - 1]).abs();
    motion.axes.iter().all(|axis| change(axis) < STANDSTILL)
}

/// Settled part of each stop after the first motion of the run.
fn stops(motion: &Motion, lead_in: usize, settle_s: f64) -> Vec<Range<usize>> {
    let mut stops = vec![];
    let mut since: Option<usize> = None;
    let mut has_moved = false;
    let mut close = |since: Option<usize>, end: usize| {
        let Some(begin) = since else { return };
        let settled_s = motion.time_s[begin] + settle_s;
        let first = (begin..end).find(|k| motion.time_s[*k] >= settled_s);
        stops.extend(first.map(|first| first..end));
    };
    for k in (lead_in + 1)..motion.len() {
        if stands(motion, k) {
            since = since.or_else(|| has_moved.then_some(k));
        } else {
            close(since.take(), k);
            has_moved = true;
        }
    }
    close(since, motion.len());
    stops
}

fn at_full_rate(motion: &Motion, lead_in: usize) -> Vec<bool> {
    let n = motion.len();
    let spacing = |k: usize| motion.time_s[k] - motion.time_s[k - 1];
    let mut spacings: Vec<f64> = ((lead_in + 1).max(1)..n).map(spacing).collect();
    if spacings.is_empty() {
        return vec![false; n];
    }
    let tenth = spacings.len() / 10;
    let (_, finest_s, _) = spacings.select_nth_unstable_by(tenth, f64::total_cmp);
    let limit_s = *finest_s * FULL_RATE;
    (0..n)
        .map(|k| k >= lead_in && k > 0 && spacing(k) <= limit_s)
        .collect()
}

fn on_circle(segment: &TestSegment, motion: &Motion, counts: &mut [bool]) {
    let Some(axes) = plate_axes(segment.plane) else {
        return;
    };
    for (k, counts) in counts.iter_mut().enumerate() {
        let place = axes.map(|a| {
            motion.position[a].get(k).copied().unwrap_or(0.0) - segment.centre_mm[a.index()]
        });
        let speed = axes.map(|a| motion.velocity[a].get(k).copied().unwrap_or(0.0));
        let is_on = (place[0].hypot(place[1]) - segment.radius_mm).abs() < ON_CIRCLE_MM;
        let is_at_feed = speed[0].hypot(speed[1]) >= AT_FEED * segment.feed_mm_s;
        *counts &= is_on && is_at_feed;
    }
}

fn between_motions(motion: &Motion, lead_in: usize, counts: &mut [bool]) {
    let moving = |k: &usize| !stands(motion, *k);
    let first = ((lead_in + 1).max(1)..motion.len()).find(moving);
    let last = ((lead_in + 1).max(1)..motion.len()).rev().find(moving);
    for (k, counts) in counts.iter_mut().enumerate() {
        *counts &= first.is_some_and(|first| k >= first) && last.is_some_and(|last| k <= last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::{AxisSet, PerAxis};

    /// 1 s at 0, then 10 mm in 1 s, 2 s at 10, and on by another 10 mm.
    fn stepping() -> Motion {
        let place = |t: f64| 10.0 * (t - 1.0).clamp(0.0, 1.0) + 10.0 * (t - 4.0).clamp(0.0, 1.0);
        let time_s: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.01).collect();
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = time_s.iter().map(|t| place(*t)).collect();
        Motion::new(time_s, AxisSet::EMPTY.with(Axis::X), position).expect("a motion")
    }

    #[test]
    fn a_stop_counts_after_it_has_settled_and_the_stand_before_the_test_does_not() {
        let motion = stepping();
        let stops = stops(&motion, 0, 0.3);
        assert_eq!(stops.len(), 2, "{stops:?}");
        assert!((motion.time_s[stops[0].start] - 2.3).abs() < 0.02);
        assert!((motion.time_s[stops[0].end - 1] - 4.0).abs() < 0.02);
    }

    #[test]
    fn an_instrument_that_reads_less_often_than_the_axes_is_kept_as_it_is() {
        let selection = Selection::Motion(vec![true; 40]);
        let raw = |place: f64| Raw {
            place,
            deviation: place,
        };
        let series = [raw(0.0), raw(11.0), raw(22.0), raw(33.0)];
        assert_eq!(selection.apply(&series, 3), series);
    }

    #[test]
    fn neighbours_are_averaged_at_their_middle_and_an_incomplete_block_is_left_out() {
        let selection = Selection::Motion(vec![true; 11]);
        let raw = |place: f64| Raw {
            place,
            deviation: 2.0 * place,
        };
        let series: Vec<Raw> = (0..11).map(|k| raw(f64::from(k))).collect();
        assert_eq!(selection.apply(&series, 5), [raw(2.0), raw(7.0)]);
    }
}
