//! Readings of a session, thinned to stations along the path.
//!
//! # Model
//!
//! A thousand readings a second of a smooth error say no more than a few hundred a circle. A station is a
//! length of the commanded path (cut where an axis turns round); a row is the mean of the readings of one
//! channel in it, and the same mean is taken of what the twin predicts:
//!
//! ```text
//!   y_i = 1/m sum_k y_k,   A_i = 1/m sum_k A_k,   k in station i          (1)
//! ```
//!
//! A touch is a row of its own. A single reading that stands off both its neighbours by far more than they
//! differ elsewhere is an outlier and left out; readings that are no numbers as well; both are counted.
//!
//! # Holds when
//! Within a station an effect changes little, or its mean is all that is wanted of it.

use std::collections::BTreeMap;

use metrology::Axis;
use metrology::sample::TestKind;
use twin::{Channel, Run, Session};

/// Station of a run: the same for repeats.
pub type Station = (u32, u32);

/// One row: the mean of some readings of one channel.
#[derive(Clone, Debug)]
pub struct Row {
    /// Where on the path.
    pub station: Station,
    /// Tick of the middle reading (of a touch: the nearest), where there is one.
    pub tick: Option<usize>,
    /// Touch, for the touch channel.
    pub touch: Option<usize>,
    /// Readings in it, places in the run's list.
    pub readings: Vec<usize>,
}

/// Rows of one channel of one run.
#[derive(Clone, Debug)]
pub struct Block {
    /// Place of the run in the session.
    pub run: usize,
    /// The channel.
    pub channel: Channel,
    /// First row in the stack of all.
    pub start: usize,
    /// Its rows, in time.
    pub rows: Vec<Row>,
    /// Readings that were left out.
    pub dropped: usize,
}

impl Block {
    /// The rows' places in the stack.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.start..self.start + self.rows.len()
    }
}

/// All rows of some runs.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Blocks, in the order of runs and channels.
    pub blocks: Vec<Block>,
    /// Number of rows.
    pub len: usize,
}

impl Rows {
    /// Thins the readings of the runs that are wanted, of the channels that are wanted.
    pub fn new(
        session: &Session,
        wanted: &[usize],
        stations: usize,
        keep: impl Fn(&Channel) -> bool,
    ) -> Self {
        let mut rows = Self::default();
        for &run in wanted {
            for (channel, readings) in channels_of(&session.runs[run]) {
                if !keep(&channel) {
                    continue;
                }
                let block = thin(
                    &session.runs[run],
                    run,
                    channel,
                    &readings,
                    stations,
                    rows.len,
                );
                rows.len += block.rows.len();
                if !block.rows.is_empty() {
                    rows.blocks.push(block);
                }
            }
        }
        rows
    }

    /// Takes the mean (1) of one value per reading of a run, into the stack.
    pub fn average(&self, run: usize, per_reading: &[f64], stack: &mut [f64]) {
        for block in self.blocks.iter().filter(|block| block.run == run) {
            for (row, sum) in block.rows.iter().zip(&mut stack[block.range()]) {
                let total: f64 = row.readings.iter().map(|k| per_reading[*k]).sum();
                *sum = total / count(row.readings.len());
            }
        }
    }
}

/// Variance of the readings of each row of a block about the line through the rows beside it, of one value per reading; none of rows
/// with one reading.
pub fn variances_within(block: &Block, per_reading: &[f64]) -> Vec<Option<f64>> {
    let mean = |values: &mut dyn Iterator<Item = f64>, n: usize| values.sum::<f64>() / count(n);
    let centre = |row: &Row| {
        let n = row.readings.len();
        let place = mean(&mut row.readings.iter().map(|k| count(*k)), n);
        (
            place,
            mean(&mut row.readings.iter().map(|k| per_reading[*k]), n),
        )
    };
    let centres: Vec<(f64, f64)> = block.rows.iter().map(centre).collect();
    let of_row = |at: usize| {
        let readings = &block.rows[at].readings;
        if readings.len() < 2 {
            return None;
        }
        let (before, after) = (
            centres[at.saturating_sub(1)],
            centres[(at + 1).min(centres.len() - 1)],
        );
        let way = after.0 - before.0;
        let slope = if way > 0.0 {
            (after.1 - before.1) / way
        } else {
            0.0
        };
        let (place, middle) = centres[at];
        let about = |k: &usize| per_reading[*k] - middle - slope * (count(*k) - place);
        let squares: f64 = readings.iter().map(|k| about(k).powi(2)).sum();
        Some(squares / count(readings.len() - 1))
    };
    (0..block.rows.len()).map(of_row).collect()
}

/// A count as a real number.
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^52")]
pub fn count(n: usize) -> f64 {
    n as f64
}

fn channels_of(run: &Run) -> BTreeMap<Channel, Vec<usize>> {
    let mut channels = BTreeMap::<Channel, Vec<usize>>::new();
    for (k, reading) in run.readings.iter().enumerate() {
        channels.entry(reading.channel.clone()).or_default().push(k);
    }
    channels
}

fn thin(
    run: &Run,
    index: usize,
    channel: Channel,
    readings: &[usize],
    stations: usize,
    start: usize,
) -> Block {
    let good = without_outliers(run, readings, channel == Channel::Touch);
    let dropped = readings.len() - good.len();
    let rows = if channel == Channel::Touch {
        good.iter().map(|k| touch_row(run, *k)).collect()
    } else {
        path_rows(run, &good, stations)
    };
    Block {
        run: index,
        channel,
        start,
        rows,
        dropped,
    }
}

fn touch_row(run: &Run, reading: usize) -> Row {
    let touch = run.readings[reading].at;
    Row {
        station: (u32::try_from(touch).unwrap_or(u32::MAX), 0),
        tick: run.touches[touch].tick,
        touch: Some(touch),
        readings: vec![reading],
    }
}

fn path_rows(run: &Run, readings: &[usize], stations: usize) -> Vec<Row> {
    let (Some(first), Some(last)) = (readings.first(), readings.last()) else {
        return vec![];
    };
    let (first, last) = (run.readings[*first].at, run.readings[*last].at);
    let path = Path::new(run, first, last, stations);
    let mut rows = Vec::<Row>::new();
    for &k in readings {
        let station = path.station(run.readings[k].at);
        match rows.last_mut() {
            Some(row) if row.station == station => row.readings.push(k),
            _ => rows.push(Row {
                station,
                tick: None,
                touch: None,
                readings: vec![k],
            }),
        }
    }
    for row in &mut rows {
        row.tick = Some(run.readings[row.readings[row.readings.len() / 2]].at);
    }
    rows
}

/// Stations along the commanded path of the readings.
struct Path {
    first: usize,
    stations: Vec<Station>,
}

impl Path {
    fn new(run: &Run, first: usize, last: usize, stations: usize) -> Self {
        let motion = &run.motion;
        let (mut ways, turns) = ways_and_turns(run, first, last);
        let way = ways[ways.len() - 1];
        let (turns, length) = if way < STANDING_MM {
            for (place, tick) in ways.iter_mut().zip(first..) {
                *place = motion.time_s[tick] - motion.time_s[first];
            }
            (counted(&turns), ways[ways.len() - 1] / count(stations))
        } else {
            let ends = END_SHARE * way..(1.0 - END_SHARE) * way;
            let inside = turns.iter().zip(&ways);
            let inside = inside.map(|(is_turn, place)| *is_turn && ends.contains(place));
            let turns = counted(&inside.collect::<Vec<_>>());
            let length = station_mm(run, way, turns[turns.len() - 1], stations);
            (turns, length)
        };
        let station = |place: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a place is positive and a path has below 2^32 stations"
            )]
            let at = (place / length.max(f64::MIN_POSITIVE) + 1e-6) as u32;
            at
        };
        let stations = ways.iter().zip(&turns).map(|(w, t)| (station(*w), *t));
        Self {
            first,
            stations: stations.collect(),
        }
    }

    fn station(&self, tick: usize) -> Station {
        let at = tick.saturating_sub(self.first).min(self.stations.len() - 1);
        self.stations[at]
    }
}

/// Way since the first tick, mm, and whether an axis turns round at a tick.
fn ways_and_turns(run: &Run, first: usize, last: usize) -> (Vec<f64>, Vec<bool>) {
    let motion = &run.motion;
    let mut way = 0.0;
    let (mut ways, mut turns) = (vec![0.0], vec![false]);
    for tick in first + 1..=last {
        let mut squared = 0.0;
        let mut is_turn = false;
        for axis in motion.axes.iter() {
            let weight = if axis.is_linear() { 1.0 } else { ROTARY_ARM_MM };
            let position = &motion.position[axis];
            squared += ((position[tick] - position[tick - 1]) * weight).powi(2);
            is_turn |= motion.sense[axis][tick] != motion.sense[axis][tick - 1];
        }
        way += squared.sqrt();
        ways.push(way);
        turns.push(is_turn);
    }
    (ways, turns)
}

/// Turns up to each tick.
fn counted(turns: &[bool]) -> Vec<u32> {
    let add = |sum: &mut u32, is_turn: &bool| {
        *sum += u32::from(*is_turn);
        Some(*sum)
    };
    turns.iter().scan(0, add).collect()
}

/// A turn of an axis within this share of the way from either end of a run does not count. Circles measured in motion begin or end
/// where an axis turns, and repeats may differ by a tick there.
const END_SHARE: f64 = 0.01;
/// Arm at which a turn of a rotary axis counts as way.
const ROTARY_ARM_MM: f64 = 100.0;
/// A path shorter than this is standing still.
const STANDING_MM: f64 = 0.05;

/// Length of a station: a part of the circumference, or of one pass.
fn station_mm(run: &Run, way_mm: f64, turns: u32, stations: usize) -> f64 {
    let radius_mm = run.segment.radius_mm;
    if radius_mm > 0.0 && matches!(run.segment.kind, TestKind::Circle | TestKind::Arc) {
        return std::f64::consts::TAU * radius_mm / count(stations);
    }
    let passes = (f64::from(turns) + 1.0).min(8.0);
    way_mm / (count(stations) * passes)
}

/// Readings that are numbers and do not stand alone.
fn without_outliers(run: &Run, readings: &[usize], is_touch: bool) -> Vec<usize> {
    let numbers: Vec<usize> = readings
        .iter()
        .copied()
        .filter(|k| run.readings[*k].deviation.is_finite())
        .collect();
    if is_touch || numbers.len() < 20 {
        return numbers;
    }
    let value = |k: usize| run.readings[numbers[k]].deviation;
    let bend = |k: usize| value(k) - 0.5 * (value(k - 1) + value(k + 1));
    let mut sizes: Vec<f64> = (1..numbers.len() - 1).map(|k| bend(k).abs()).collect();
    let middle = sizes.len() / 2;
    sizes.select_nth_unstable_by(middle, f64::total_cmp);
    let limit = 12.0 * 1.4826 * sizes[middle];
    let alone = |k: usize| {
        k > 0
            && k + 1 < numbers.len()
            && bend(k).abs() > limit
            && (value(k - 1) - value(k + 1)).abs() < 0.25 * bend(k).abs()
    };
    (0..numbers.len())
        .filter(|k| limit <= 0.0 || !alone(*k))
        .map(|k| numbers[k])
        .collect()
}

/// Position of the axes at a row (mm, rad).
pub fn position(run: &Run, row: &Row, axis: Axis) -> f64 {
    match (row.touch, row.tick) {
        (Some(touch), _) => run.touches[touch].position[axis],
        (None, Some(tick)) => run.motion.position[axis].get(tick).copied().unwrap_or(0.0),
        (None, None) => 0.0,
    }
}

/// Time of a row, seconds since the session's start.
pub fn time_s(run: &Run, row: &Row) -> f64 {
    match (row.touch, row.tick) {
        (Some(touch), _) => run.touches[touch].time_s,
        (None, Some(tick)) => run.motion.time_s.get(tick).copied().unwrap_or(0.0),
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use metrology::sample::TestSegment;
    use metrology::{AxisSet, PerAxis, Stamp};
    use twin::{Motion, Reading};

    use super::*;

    /// A turn of a circle from an angle on, read at every tick.
    fn turn(from_rad: f64) -> Run {
        let ticks = 1200;
        let angle = |tick: usize| from_rad + std::f64::consts::TAU * count(tick) / count(ticks);
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = (0..=ticks).map(|tick| 83.0 * angle(tick).cos()).collect();
        position[Axis::Y] = (0..=ticks).map(|tick| 83.0 * angle(tick).sin()).collect();
        position[Axis::Z] = vec![30.0; ticks + 1];
        let time_s = (0..=ticks).map(|tick| 0.004 * count(tick)).collect();
        let reading = |at: usize| Reading {
            channel: Channel::GridU,
            at,
            fraction: 0.0,
            deviation: 1e-3 * angle(at).sin(),
        };
        Run {
            segment: TestSegment {
                radius_mm: 83.0,
                ..TestSegment::of_kind(TestKind::Circle, 1, Stamp::from_nanos(0))
            },
            motion: Motion::new(time_s, AxisSet::XYZ, position).expect("a turn"),
            touches: vec![],
            readings: (0..=ticks).map(reading).collect(),
        }
    }

    /// Measured in motion, a circle that begins where X turns has a tick before the turn, or none.
    #[test]
    fn turns_that_begin_a_tick_before_and_after_an_axis_turns_share_their_stations() {
        let mut session = Session::default();
        session.runs.extend([-0.003, 0.003].map(turn));
        let rows = Rows::new(&session, &[0, 1], 180, |_| true);
        let stations = |block: &Block| -> BTreeSet<Station> {
            block.rows.iter().map(|row| row.station).collect()
        };
        let [one, other] = [0, 1].map(|k| stations(&rows.blocks[k]));
        let shared = one.intersection(&other).count();
        assert!(
            shared + 4 >= one.len() && one.len() > 180,
            "{shared} of {}",
            one.len()
        );
    }

    #[test]
    fn readings_on_a_line_have_no_variance_within_their_rows() {
        let row = |first: usize| Row {
            station: (u32::try_from(first).expect("few"), 0),
            tick: None,
            touch: None,
            readings: (first..first + 5).collect(),
        };
        let block = Block {
            run: 0,
            channel: Channel::GridU,
            start: 0,
            rows: (0..20).step_by(5).map(row).collect(),
            dropped: 0,
        };
        let line: Vec<f64> = (0..20).map(|k| 0.3 * count(k) - 2.0).collect();
        let within = variances_within(&block, &line);
        assert!(within.iter().all(|v| v.is_some_and(|v| v < 1e-20)));
        // One up, one down about the line: 4 of 5 readings off by 1, over 4.
        let shaken: Vec<f64> = line
            .iter()
            .zip([1.0, -1.0, 0.0, 1.0, -1.0].iter().cycle())
            .map(|(line, off)| line + off)
            .collect();
        let within = variances_within(&block, &shaken);
        assert!(
            within
                .iter()
                .all(|v| v.is_some_and(|v| (v - 1.0).abs() < 1e-12)),
            "{within:?}"
        );
    }
}
