//! Which readings of a run count: means at stops, or means of neighbours while it is in motion.

use std::ops::Range;

use metrology::Axis;
use metrology::sample::{TestKind, TestSegment};
use twin::Motion;
use twin::simulate::plate_axes;

use super::channels::Raw;

/// The command is on the circle when it is this close to it, mm.
const ON_CIRCLE_MM: f64 = 2e-3;
/// Share of the feed below which the command is still running in.
const AT_FEED: f64 = 0.98;
/// A test keeps its feed for so long where it reaches it at all, s.
pub(crate) const HOLDS_FEED_S: f64 = 0.05;
/// A command that changes by less stands, mm or rad.
const STANDSTILL: f64 = 1e-6;
/// Ticks further apart than this times the finest spacing are not at the full rate.
pub(super) const FULL_RATE: f64 = 1.5;
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
        } else if segment.kind == TestKind::Dwell {
            from_the_first(motion, lead_in, &mut counts);
        } else {
            between_motions(motion, lead_in, &mut counts);
            on_the_way_of_the_test(segment, motion, &mut counts);
        }
        Self::Motion(counts)
    }

    /// From the first tick that counts to the last.
    pub(super) fn span(&self) -> Range<usize> {
        let (first, last) = match self {
            Self::Stops(stops) => (stops.first().map(|s| s.start), stops.last().map(|s| s.end)),
            Self::Motion(counts) => {
                let last = counts.iter().rposition(|counts| *counts);
                (
                    counts.iter().position(|counts| *counts),
                    last.map(|k| k + 1),
                )
            }
        };
        first.unwrap_or(0)..last.unwrap_or(0)
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
            Self::Stops(stops) => {
                let at_stops = at_stops(series, stops).into_iter();
                at_stops
                    .filter_map(|raws| mean(raws.into_iter(), 1))
                    .collect()
            }
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

/// The readings of each stop, in their order. Stops follow one another, so each reading is looked for once.
fn at_stops<'r>(series: &'r [Raw], stops: &[Range<usize>]) -> Vec<Vec<&'r Raw>> {
    let mut of_stops = vec![vec![]; stops.len()];
    for raw in series {
        let tick = index(raw.place);
        let place = stops.partition_point(|stop| stop.end <= tick);
        if stops.get(place).is_some_and(|stop| stop.contains(&tick)) {
            of_stops[place].push(raw);
        }
    }
    of_stops
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

/// A log begins with its first row, however long nothing was written before it.
fn from_the_first(motion: &Motion, lead_in: usize, counts: &mut [bool]) {
    if counts.get(lead_in + 1).copied().unwrap_or(false) && lead_in < motion.len() {
        counts[lead_in] = true;
    }
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

/// From where the path is at the feed of the test for the first time to where it is for the last time: how the machine
/// comes there and goes away, faster than that, is not what is tested. Where the record of a run holds the end of
/// the one before, the part with more ticks that count is judged: those of the lead-in do not. Of a straight line only the passes at its feed count, once the loops have
/// settled: what a jump of the acceleration at its ends leaves is told by how well the loops are known, not by the path.
/// A test too short to reach its feed counts as a whole.
fn on_the_way_of_the_test(segment: &TestSegment, motion: &Motion, counts: &mut [bool]) {
    let speeds: Vec<f64> = (0..counts.len()).map(|k| speed(motion, k)).collect();
    let slack = (1.0 - AT_FEED) * segment.feed_mm_s;
    let is_at_feed = |k: &usize| (speeds[*k] - segment.feed_mm_s).abs() < slack;
    let ticks: Vec<usize> = (0..counts.len()).filter(is_at_feed).collect();
    let passes = ticks.chunk_by(|a, b| a + 1 == *b).filter_map(|pass| {
        let (first, last) = (*pass.first()?, *pass.last()?);
        let lasts = motion.time_s[last] - motion.time_s[first] >= HOLDS_FEED_S;
        lasts.then_some(first..last + 1)
    });
    let passes: Vec<Range<usize>> = passes.collect();
    let is_slower = |a: &Range<usize>, b: &Range<usize>| {
        let between = speeds.get(a.end..b.start).unwrap_or(&[]);
        let limit = segment.feed_mm_s + 5.0 * slack;
        between.iter().all(|speed| *speed < limit)
    };
    let counted = |pass: &Range<usize>| counts[pass.clone()].iter().filter(|one| **one).count();
    let at_feed = |part: &&[Range<usize>]| part.iter().map(counted).sum::<usize>();
    let Some(part) = passes.chunk_by(is_slower).max_by_key(at_feed) else {
        return;
    };
    let settled = |pass: &Range<usize>| {
        let since_s = motion.time_s[pass.start] + HOLDS_FEED_S;
        let first = pass.clone().find(|k| motion.time_s[*k] >= since_s);
        first.unwrap_or(pass.end)..pass.end
    };
    let judged: Vec<Range<usize>> = if is_straight(segment.kind) {
        part.iter().map(settled).collect()
    } else {
        let (first, last) = (&part[0], &part[part.len() - 1]);
        std::iter::once(first.start..last.end).collect()
    };
    for (k, counts) in counts.iter_mut().enumerate() {
        *counts &= judged.iter().any(|judged| judged.contains(&k));
    }
}

const fn is_straight(kind: TestKind) -> bool {
    use TestKind::{Diagonal, Line, Positioning, Spike};
    matches!(kind, Line | Spike | Positioning | Diagonal)
}

fn speed(motion: &Motion, k: usize) -> f64 {
    let of = |axis: Axis| motion.velocity[axis].get(k).copied().unwrap_or(0.0);
    Axis::LINEAR
        .map(of)
        .iter()
        .map(|v| v * v)
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use metrology::{AxisSet, PerAxis, Stamp};

    use super::*;

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

    /// Two scans at 10 mm/s with a rapid way back between; the first, of the lead-in, is 0.5 s longer.
    #[test]
    fn a_longer_run_in_the_lead_in_does_not_take_the_place_of_the_run() {
        let place = |t: f64| match t {
            t if t < 2.5 => 10.0 * t,
            t if t < 3.0 => 25.0 - 50.0 * (t - 2.5),
            t => 10.0 * (t - 3.0),
        };
        let time_s: Vec<f64> = (0..5000).map(|k| f64::from(k) * 1e-3).collect();
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = time_s.iter().map(|t| place(*t)).collect();
        let motion = Motion::new(time_s, AxisSet::EMPTY.with(Axis::X), position).expect("a motion");
        let segment = segment(TestKind::Line, 10.0);
        let span = Selection::of(&segment, &motion, 2600, 0.3).span();
        let [first_s, last_s] = [span.start, span.end - 1].map(|k| motion.time_s[k]);
        assert!(
            (first_s - 3.05).abs() < 5e-3 && last_s > 4.99,
            "{first_s} {last_s}"
        );
    }

    #[test]
    fn the_way_in_and_what_is_before_it_are_not_judged_and_a_turn_within_the_test_is() {
        // The end of the test before, in at 50 mm/s, 30 mm up and down again at 10 mm/s, out at 50 mm/s.
        let place = |t: f64| match t {
            t if t < 0.2 => 10.0 * t - 42.0,
            t if t < 1.0 => 50.0 * (t - 1.0),
            t if t < 4.0 => 10.0 * (t - 1.0),
            t if t < 7.0 => 30.0 - 10.0 * (t - 4.0),
            t => -50.0 * (t - 7.0),
        };
        let time_s: Vec<f64> = (0..8000).map(|k| f64::from(k) * 1e-3).collect();
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = time_s.iter().map(|t| place(*t)).collect();
        let motion = Motion::new(time_s, AxisSet::EMPTY.with(Axis::X), position).expect("a motion");
        let mut segment = segment(TestKind::Corner, 10.0);
        let span_s = |segment: &TestSegment| {
            let span = Selection::of(segment, &motion, 0, 0.3).span();
            [span.start, span.end - 1].map(|k| motion.time_s[k])
        };
        let [first_s, last_s] = span_s(&segment);
        assert!((first_s - 1.0).abs() < 3e-3 && (last_s - 7.0).abs() < 3e-3);
        segment.feed_mm_s = 50.0;
        let [first_s, last_s] = span_s(&segment);
        assert!(
            (first_s - 0.2).abs() < 3e-3 && last_s > 7.99,
            "slower motion is within a test"
        );
        segment.feed_mm_s = 30.0;
        let [first_s, last_s] = span_s(&segment);
        assert!(first_s < 3e-3 && last_s > 7.99, "it never had its feed");
    }

    #[test]
    fn of_a_straight_line_the_passes_at_its_feed_count_once_they_have_settled() {
        use TestKind::{Line, Positioning, Spike};
        // 30 mm up, a rest or none, and down again.
        for (kind, back_s) in [(Line, 5.0), (Line, 4.0), (Spike, 4.0), (Positioning, 4.0)] {
            let up = |t: f64| 10.0 * (t - 1.0).clamp(0.0, 3.0);
            let place = |t: f64| up(t) - 10.0 * (t - back_s).clamp(0.0, 3.0);
            let time_s: Vec<f64> = (0..9000).map(|k| f64::from(k) * 1e-3).collect();
            let mut position = PerAxis::<Vec<f64>>::default();
            position[Axis::X] = time_s.iter().map(|t| place(*t)).collect();
            let axes = AxisSet::EMPTY.with(Axis::X);
            let motion = Motion::new(time_s, axes, position).expect("a motion");
            let Selection::Motion(counts) = Selection::of(&segment(kind, 10.0), &motion, 0, 0.3)
            else {
                panic!("{kind:?} in motion");
            };
            for (k, counts) in counts.iter().enumerate() {
                let time_s = motion.time_s[k];
                let begun = |from: f64| time_s - from - HOLDS_FEED_S;
                let is_in = |from: f64| begun(from) > 3e-3 && time_s < from + 2.997;
                let is_out = |from: f64| begun(from) < -3e-3 || time_s > from + 3.003;
                assert!(*counts || !(is_in(1.0) || is_in(back_s)), "{time_s}");
                assert!(!(*counts && is_out(1.0) && is_out(back_s)), "{time_s}");
            }
        }
    }

    fn segment(kind: TestKind, feed_mm_s: f64) -> TestSegment {
        TestSegment {
            feed_mm_s,
            ..TestSegment::of_kind(kind, 1, Stamp::from_nanos(0))
        }
    }

    #[test]
    fn each_stop_has_the_mean_of_the_readings_within_it() {
        let raw = |place: f64| Raw {
            place,
            deviation: 3.0 * place,
        };
        let series: Vec<Raw> = (0..40).map(|k| raw(0.5 * f64::from(k))).collect();
        let backwards: Vec<Raw> = series.iter().rev().copied().collect();
        for stops in [
            vec![],
            vec![0..1, 1..2],
            vec![3..5, 5..9, 12..13],
            vec![0..20, 20..21],
            vec![2..2, 4..6, 30..40],
        ] {
            let within = |stop: &Range<usize>, series: &[Raw]| {
                let own = series.iter().filter(|raw| stop.contains(&index(raw.place)));
                mean(own, 1)
            };
            for series in [&series, &backwards] {
                let wanted: Vec<Raw> = stops.iter().filter_map(|s| within(s, series)).collect();
                let selection = Selection::Stops(stops.clone());
                assert_eq!(selection.apply(series, 1), wanted, "{stops:?}");
            }
        }
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
