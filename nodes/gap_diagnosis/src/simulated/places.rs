//! What a simulator's run shows at the places of a recorded one.
//!
//! # Model
//!
//! With a and b neighbouring readings of the simulator, the place p of a recorded reading lies between them where its foot
//! on the way from a to b does, and no further from it than a chord from its arc. The value there is
//!
//! ```text
//!   y(p) = y_a + f (y_b - y_a),   f = (p - a).(b - a) / |b - a|^2          (1)
//! ```
//!
//! only where every moving axis last went the same way at p, a and b: nothing is interpolated across a reversal, and a
//! place that is passed to and fro is found on the pass of its own direction. At a reading of the simulator itself that
//! reading is enough. Places are looked for onwards from the last one that was found, so that the second turn of a circle
//! is that of the simulator's second turn.
//!
//! Runs that stand are compared at one time since the first reading, there is no other place; touches with those of one
//! feature from one side, at one feed and place, the k-th with the k-th.

use metrology::{Axis, AxisSet};
use twin::{Channel, Reading, Run, Touch};

use super::Reason;
use super::runs::same_feed;
use crate::preflight::ROTARY_ARM_MM;
use crate::session::log;

/// A place within it of a reading is at the reading, mm.
const NEAR_MM: f64 = 0.05;
/// How far a place may be off the way between two readings, share of that way: that of an arc of 14 degrees over its chord.
const STEP_BOW: f64 = 0.03;
/// Readings further apart than this many of the usual spacing have nothing between them.
const MOST_SPACINGS: f64 = 3.0;
/// Ways between readings that are tried onwards before all are.
const AHEAD: usize = 8;
/// Cosine of approaches that are one.
const ONE_SIDE: f64 = 0.999;
/// Touches within it are at one place, mm (at the arm above).
const SAME_TOUCH_MM: f64 = 0.5;

/// Position of an axis at a reading that is no touch, mm or rad.
pub(super) fn at(run: &Run, reading: &Reading, axis: Axis) -> f64 {
    let position = &run.motion.position[axis];
    let Some(here) = position.get(reading.at) else {
        return 0.0;
    };
    let next = position.get(reading.at + 1).unwrap_or(here);
    here + (next - here) * reading.fraction
}

/// What the simulator shows at each reading of a recorded run, in their order, mm (K, rad); `moving` are the axes that move.
pub(super) fn values(real: &Run, simulated: &Run, moving: AxisSet) -> Vec<Result<f64, Reason>> {
    let mut all = vec![Err(Reason::Channel); real.readings.len()];
    let mut channels: Vec<&Channel> = real.readings.iter().map(|one| &one.channel).collect();
    channels.sort();
    channels.dedup();
    for channel in channels {
        let wanted = of_channel(real, channel);
        let read = of_channel(simulated, channel);
        if read.is_empty() {
            continue;
        }
        let found = if *channel == Channel::Touch {
            by_touch((real, &wanted), (simulated, &read))
        } else if moving.is_empty() {
            by_time((real, &wanted), (simulated, &read))
        } else {
            by_place((real, &wanted), (simulated, &read), moving)
        };
        for (place, value) in wanted.into_iter().zip(found) {
            all[place] = value;
        }
    }
    all
}

/// Places of the readings of a channel in a run's list.
fn of_channel(run: &Run, channel: &Channel) -> Vec<usize> {
    let all = run.readings.iter().enumerate();
    let own = all.filter(|(_, reading)| reading.channel == *channel);
    own.map(|(place, _)| place).collect()
}

/// Some readings of a run.
type Readings<'a> = (&'a Run, &'a [usize]);

fn by_time(
    (real, wanted): Readings<'_>,
    (simulated, read): Readings<'_>,
) -> Vec<Result<f64, Reason>> {
    let times_s = |run: &Run, places: &[usize]| -> Vec<f64> {
        let all = places.iter().map(|k| run.time_of(&run.readings[*k]));
        let all: Vec<f64> = all.map(|time_s| time_s.unwrap_or(0.0)).collect();
        let first_s = all.first().copied().unwrap_or(0.0);
        all.iter().map(|time_s| time_s - first_s).collect()
    };
    let of_simulator_s = times_s(simulated, read);
    let deviation = |k: &usize| simulated.readings[*k].deviation;
    let values: Vec<f64> = read.iter().map(deviation).collect();
    let value = |time_s: f64| -> Result<f64, Reason> {
        let between = log::between(&of_simulator_s, time_s).ok_or(Reason::OffPath)?;
        Ok(between.value(&values))
    };
    times_s(real, wanted).into_iter().map(value).collect()
}

fn by_touch(
    (real, wanted): Readings<'_>,
    (simulated, read): Readings<'_>,
) -> Vec<Result<f64, Reason>> {
    let touch = |run: &Run, k: usize| run.touches.get(run.readings[k].at).cloned();
    let all: Vec<Option<Touch>> = wanted.iter().map(|k| touch(real, *k)).collect();
    let others = read
        .iter()
        .map(|k| (touch(simulated, *k), &simulated.readings[*k]));
    let others: Vec<(Option<Touch>, &Reading)> = others.collect();
    let is_same = |a: &Touch, b: &Option<Touch>| b.as_ref().is_some_and(|b| same_touch(a, b));
    let value = |(index, one): (usize, &Option<Touch>)| -> Result<f64, Reason> {
        let one = one.as_ref().ok_or(Reason::Touch)?;
        let before = all[..index]
            .iter()
            .filter(|other| is_same(one, other))
            .count();
        let same: Vec<&Reading> = others
            .iter()
            .filter(|(other, _)| is_same(one, other))
            .map(|(_, reading)| *reading)
            .collect();
        let own = same.get(before).or(same.last()).ok_or(Reason::Touch)?;
        Ok(own.deviation)
    };
    all.iter().enumerate().map(value).collect()
}

fn same_touch(a: &Touch, b: &Touch) -> bool {
    let off_mm = |axis: Axis| (a.position[axis] - b.position[axis]).abs() * arm_mm(axis);
    let mut axes = Axis::LINEAR.iter().chain(&Axis::ROTARY);
    a.feature_id == b.feature_id
        && a.approach.dot(&b.approach) >= ONE_SIDE
        && same_feed(a.feed_mm_s, b.feed_mm_s)
        && axes.all(|axis| off_mm(*axis) <= SAME_TOUCH_MM)
}

fn by_place(
    (real, wanted): Readings<'_>,
    (simulated, read): Readings<'_>,
    moving: AxisSet,
) -> Vec<Result<f64, Reason>> {
    let point = |run: &Run, k: &usize| Point::of(run, &run.readings[*k], moving);
    let mut path = Path::new(read.iter().map(|k| point(simulated, k)).collect());
    wanted.iter().map(|k| path.value(&point(real, k))).collect()
}

/// Of an angle its arc at an arm, of a length itself.
const fn arm_mm(axis: Axis) -> f64 {
    if axis.is_linear() { 1.0 } else { ROTARY_ARM_MM }
}

/// A reading on a path; of axes that do not move nothing.
struct Point {
    at_mm: [f64; 6],
    /// Direction in which each axis last went; zero where it did not before.
    sense: [i8; 6],
    deviation: f64,
}

impl Point {
    fn of(run: &Run, reading: &Reading, moving: AxisSet) -> Self {
        let mut point = Self {
            at_mm: [0.0; 6],
            sense: [0; 6],
            deviation: reading.deviation,
        };
        for axis in moving.iter() {
            let sense = run.motion.sense[axis].get(reading.at);
            point.at_mm[axis.index()] = at(run, reading, axis) * arm_mm(axis);
            point.sense[axis.index()] = sense.copied().unwrap_or(0);
        }
        point
    }

    /// Whether no axis last went one way here and the other way there.
    fn goes_as(&self, other: &Self) -> bool {
        let mut senses = self.sense.iter().zip(&other.sense);
        senses.all(|(a, b)| a * b >= 0)
    }

    fn to(&self, other: &Self) -> [f64; 6] {
        std::array::from_fn(|k| other.at_mm[k] - self.at_mm[k])
    }
}

fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The readings of a simulator's run, in time.
struct Path {
    points: Vec<Point>,
    usual_mm: f64,
    /// Where the last place was found.
    last: usize,
}

impl Path {
    fn new(points: Vec<Point>) -> Self {
        let way_mm = |pair: &[Point]| {
            let way = pair[0].to(&pair[1]);
            dot(&way, &way).sqrt()
        };
        let mut ways_mm: Vec<f64> = points.windows(2).map(way_mm).collect();
        ways_mm.retain(|way_mm| *way_mm > NEAR_MM * 1e-3);
        let middle = ways_mm.len() / 2;
        let usual_mm = if ways_mm.is_empty() {
            0.0
        } else {
            *ways_mm.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        Self {
            points,
            usual_mm,
            last: 0,
        }
    }

    /// (1) at a place.
    fn value(&mut self, place: &Point) -> Result<f64, Reason> {
        let ways = self.points.len().saturating_sub(1).max(1);
        let ahead = self.last..ways.min(self.last + AHEAD);
        let mut lacks = Reason::OffPath;
        for way in ahead.chain(0..ways) {
            match self.between(way, place) {
                Ok(found) => {
                    self.last = way;
                    return Ok(self.nearer(way + 1, place, found));
                }
                Err(reason) => lacks = lacks.max(reason),
            }
        }
        Err(lacks)
    }

    /// The value found on a way, or that of the next one where the place is a little beyond the first and not beyond it.
    fn nearer(&self, next: usize, place: &Point, (value, outside_mm): (f64, f64)) -> f64 {
        let nearer = self.between(next, place).ok();
        let nearer = nearer.filter(|(_, of_next_mm)| *of_next_mm < outside_mm);
        nearer.map_or(value, |(value, _)| value)
    }

    /// (1) between a reading and the next, and how far outside of their way the place is, mm.
    fn between(&self, way: usize, place: &Point) -> Result<(f64, f64), Reason> {
        let a = self.points.get(way).ok_or(Reason::OffPath)?;
        let b = self.points.get(way + 1).unwrap_or(a);
        let (along, there) = (a.to(b), a.to(place));
        let square = dot(&along, &along);
        let way_mm = square.sqrt();
        let share = if square > 0.0 {
            dot(&there, &along) / square
        } else {
            0.0
        };
        let before_mm = -share * way_mm;
        let beyond_mm = (share - 1.0) * way_mm;
        let foot = share.clamp(0.0, 1.0);
        let off: [f64; 6] = std::array::from_fn(|k| there[k] - along[k] * foot);
        let off_mm = dot(&off, &off).sqrt();
        if before_mm.max(beyond_mm) > NEAR_MM || off_mm > NEAR_MM + STEP_BOW * way_mm {
            return Err(Reason::OffPath);
        }
        let outside_mm = before_mm.max(beyond_mm).max(0.0);
        let goes = [a, b].map(|end| end.goes_as(place));
        let is_wide = way_mm > MOST_SPACINGS * self.usual_mm.max(NEAR_MM);
        if goes == [true, true] && a.goes_as(b) && !is_wide {
            let value = a.deviation + (b.deviation - a.deviation) * foot;
            return Ok((value, outside_mm));
        }
        let ends = [
            (foot * way_mm, goes[0], a),
            ((1.0 - foot) * way_mm, goes[1], b),
        ];
        let mut near = ends
            .iter()
            .filter(|(off_mm, goes, _)| *goes && *off_mm <= NEAR_MM);
        if let Some((_, _, end)) = near.next() {
            return Ok((end.deviation, outside_mm));
        }
        Err(if goes == [true, true] && is_wide {
            Reason::Hole
        } else {
            Reason::Direction
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::rows::count;

    fn point(x_mm: f64, sense: i8, deviation: f64) -> Point {
        let mut point = Point {
            at_mm: [0.0; 6],
            sense: [0; 6],
            deviation,
        };
        (point.at_mm[0], point.sense[0]) = (x_mm, sense);
        point
    }

    /// Stops every 10 mm from 0 to 50 and back, 1 um a mm upwards and 0.1 mm beyond that downwards.
    fn there_and_back() -> Path {
        let up = (0..6).map(|k| point(10.0 * count(k), 1, 0.01 * count(k)));
        let down = (0..6)
            .rev()
            .map(|k| point(10.0 * count(k), -1, 0.01 * count(k) + 0.1));
        Path::new(up.chain(down).collect())
    }

    #[test]
    fn a_place_is_found_on_the_pass_of_its_own_direction() {
        let mut path = there_and_back();
        for (x_mm, sense, wanted) in [
            (25.0, 1, 0.025),
            (25.0, -1, 0.125),
            (50.0, 1, 0.05),
            (50.0, -1, 0.15),
            (0.0, 1, 0.0),
            (5.0, 0, 0.005),
        ] {
            let value = path.value(&point(x_mm, sense, 0.0)).expect("on the path");
            assert!((value - wanted).abs() < 1e-12, "{x_mm} {sense}: {value}");
        }
    }

    #[test]
    fn what_lies_off_the_path_in_a_hole_or_only_on_the_other_pass_has_its_reason() {
        let mut path = there_and_back();
        assert_eq!(path.value(&point(51.0, 1, 0.0)), Err(Reason::OffPath));
        let mut aside = point(25.0, 1, 0.0);
        aside.at_mm[1] = 2.0;
        assert_eq!(path.value(&aside), Err(Reason::OffPath));
        let mut up = Path::new((0..6).map(|k| point(10.0 * count(k), 1, 0.0)).collect());
        assert_eq!(up.value(&point(25.0, -1, 0.0)), Err(Reason::Direction));
        let far = [0.0, 10.0, 20.0, 60.0, 70.0];
        let mut holed = Path::new(far.map(|x_mm| point(x_mm, 1, 0.0)).into());
        assert_eq!(holed.value(&point(40.0, 1, 0.0)), Err(Reason::Hole));
        assert_eq!(holed.value(&point(60.0, 1, 0.0)), Ok(0.0));
    }

    #[test]
    fn nothing_is_interpolated_across_a_reversal() {
        // A turn at 10 mm between two readings of the simulator.
        let mut path = Path::new(vec![
            point(7.0, 1, 0.0),
            point(9.5, 1, 0.0),
            point(9.0, -1, 0.1),
            point(6.5, -1, 0.1),
        ]);
        assert_eq!(path.value(&point(9.2, -1, 0.0)), Err(Reason::Direction));
        assert_eq!(path.value(&point(9.2, 1, 0.0)), Ok(0.0));
        assert_eq!(path.value(&point(9.0, -1, 0.0)), Ok(0.1));
    }
}
