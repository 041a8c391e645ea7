//! Moves the axes as a pass would: straight lines and circles with ramps of speed, stops, touches.
//!
//! # Model
//!
//! Speed rises by the acceleration limit a to the feed f and falls again (a way shorter than f2/a never reaches f):
//!
//! ```text
//!   T = L / f + f / a,   s(t) = a t2/2,  f (t - f/2a),  L - a (T - t)2/2   (1)
//! ```
//!
//! A circle begins before its start and ends behind its end by the way that the ramp takes, so that the turn
//! itself is run at one feed. Of a line that is read while it moves counts what is at its feed and settled, as it does
//! of one that was recorded.
//!
//! # Holds when
//! The control holds the feed between ramps; jerk limits round the ramps' corners only.

use machine::MachineFile;
use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;
use twin::simulate::plate_axes;
use twin::{Channel, Instrument, Motion, Reading, Run, Touch};

use super::{Pass, PlannedTouch};
use crate::search::rows::count;
use crate::session::HOLDS_FEED_S;

/// Ticks that a pass is simulated with, at most about.
const TICKS: f64 = 1400.0;
/// Rest before a pass, s.
const REST_S: f64 = 0.2;
/// Clearance of a touch, mm.
const CLEARANCE_MM: f64 = 2.0;

/// Where the axes are, tick by tick.
struct Course {
    step_s: f64,
    acceleration_mm_s2: f64,
    time_s: Vec<f64>,
    position: PerAxis<Vec<f64>>,
    axes: AxisSet,
    at: PerAxis<f64>,
    read: Vec<usize>,
    touches: Vec<Touch>,
}

impl Course {
    fn new(
        start_s: f64,
        step_s: f64,
        acceleration_mm_s2: f64,
        at: PerAxis<f64>,
        axes: AxisSet,
    ) -> Self {
        let mut course = Self {
            step_s,
            acceleration_mm_s2,
            time_s: vec![start_s],
            position: PerAxis::default(),
            axes,
            at,
            read: vec![],
            touches: vec![],
        };
        for axis in axes.iter() {
            course.position[axis].push(at[axis]);
        }
        course.wait(REST_S, false);
        course
    }

    fn tick(&mut self, is_read: bool) {
        let last = self.time_s[self.time_s.len() - 1];
        self.time_s.push(last + self.step_s);
        for axis in self.axes.iter() {
            self.position[axis].push(self.at[axis]);
        }
        if is_read {
            self.read.push(self.time_s.len() - 1);
        }
    }

    fn wait(&mut self, seconds: f64, is_read: bool) {
        for _ in 0..ticks(seconds, self.step_s) {
            self.tick(is_read);
        }
    }

    /// (1) along a straight line, read at its feed or not at all.
    fn go(&mut self, to: Vector3<f64>, feed_mm_s: f64, is_read: bool) {
        let from = self.at.xyz();
        let way = (to - from).norm();
        if way < 1e-9 {
            return;
        }
        let (total_s, place) = ramped(way, feed_mm_s, self.acceleration_mm_s2);
        let n = ticks(total_s, self.step_s);
        let ramp_s = feed_mm_s / self.acceleration_mm_s2;
        let at_feed_s = ramp_s + HOLDS_FEED_S..=total_s - ramp_s;
        for k in 1..=n {
            let t_s = count(k) * self.step_s;
            let here = from + (to - from) * (place(t_s) / way);
            for (index, axis) in Axis::LINEAR.into_iter().enumerate() {
                self.at[axis] = here[index];
            }
            self.tick(is_read && at_feed_s.contains(&t_s));
        }
    }

    /// A turn about a centre at one feed, with a ramp before and behind it.
    fn turn(
        &mut self,
        [u, v]: [Axis; 2],
        centre: Vector3<f64>,
        radius_mm: f64,
        feed_mm_s: f64,
        sense: Sense,
    ) {
        let signum = if sense == Sense::Clockwise { -1.0 } else { 1.0 };
        let lead = lead_rad(radius_mm, feed_mm_s, self.acceleration_mm_s2);
        let round = std::f64::consts::TAU;
        let (total_s, place) = ramped(
            (round + 2.0 * lead) * radius_mm,
            feed_mm_s,
            self.acceleration_mm_s2,
        );
        for k in 1..=ticks(total_s, self.step_s) {
            let angle = place(count(k) * self.step_s) / radius_mm - lead;
            let (sin, cos) = (signum * angle).sin_cos();
            self.at[u] = centre[u.index()] + radius_mm * cos;
            self.at[v] = centre[v.index()] + radius_mm * sin;
            self.tick((0.0..=round).contains(&angle));
        }
    }

    fn there_and_back(
        &mut self,
        [from, to]: [Vector3<f64>; 2],
        feed_mm_s: f64,
        stops: u32,
        dwell_s: f64,
    ) {
        let legs = stops.max(1);
        for (from, to) in [(from, to), (to, from)] {
            for leg in 1..=legs {
                let share = f64::from(leg) / f64::from(legs);
                self.go(from + (to - from) * share, feed_mm_s, stops == 0);
                self.wait(dwell_s, stops > 0);
            }
        }
    }

    fn touch(&mut self, touch: &PlannedTouch) {
        self.go(before(touch), RAPID_MM_S, false);
        self.go(Vector3::from(touch.at_mm), touch.feed_mm_s, false);
        let tick = self.time_s.len() - 1;
        self.touches.push(Touch {
            time_s: self.time_s[tick],
            feature_id: touch.feature_id.clone(),
            approach: Vector3::from(touch.approach),
            feed_mm_s: touch.feed_mm_s,
            position: self.at,
            tick: Some(tick),
        });
        self.go(before(touch), RAPID_MM_S, false);
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "durations are positive and far below 2^32 ticks"
)]
fn ticks(seconds: f64, step_s: f64) -> usize {
    (seconds / step_s).ceil().max(0.0) as usize
}

/// (1): its duration, and the place at a time.
fn ramped(way: f64, feed: f64, acceleration: f64) -> (f64, impl Fn(f64) -> f64) {
    let top = feed.min((way * acceleration).sqrt());
    let ramp = top / acceleration;
    let total = way / top + ramp;
    let place = move |t: f64| match t {
        t if t <= 0.0 => 0.0,
        t if t < ramp => 0.5 * acceleration * t * t,
        t if t < total - ramp => top * (t - 0.5 * ramp),
        t if t < total => way - 0.5 * acceleration * (total - t).powi(2),
        _ => way,
    };
    (total, place)
}

/// Angle that the ramp of a circle takes, with a little to spare.
fn lead_rad(radius_mm: f64, feed_mm_s: f64, acceleration_mm_s2: f64) -> f64 {
    0.5 * feed_mm_s.powi(2) / (acceleration_mm_s2 * radius_mm) + 0.1
}

/// Duration of a pass, s; `again` is that of a run of the session.
pub fn duration_s(pass: &Pass, machine: &MachineFile, again: impl Fn(usize) -> f64) -> f64 {
    let acceleration = acceleration_mm_s2(machine);
    REST_S
        + match pass {
            Pass::Circle {
                radius_mm,
                feed_mm_s,
                ..
            } => {
                let lead = lead_rad(*radius_mm, *feed_mm_s, acceleration);
                let way = (std::f64::consts::TAU + 2.0 * lead) * radius_mm;
                ramped(way, *feed_mm_s, acceleration).0
            }
            Pass::Line {
                from_mm,
                to_mm,
                feed_mm_s,
                stops,
                dwell_s,
                ..
            } => {
                let way = (Vector3::from(*to_mm) - Vector3::from(*from_mm)).norm();
                let legs = f64::from((*stops).max(1));
                2.0 * legs * (ramped(way / legs, *feed_mm_s, acceleration).0 + dwell_s)
            }
            Pass::Touches { touches, .. } => {
                let one = |touch: &PlannedTouch| {
                    CLEARANCE_MM / touch.feed_mm_s + CLEARANCE_MM / RAPID_MM_S + 1.0
                };
                touches.iter().map(one).sum()
            }
            Pass::Still { seconds, .. } | Pass::Warm { seconds, .. } => *seconds,
            Pass::Again { run } => again(*run),
        }
}

/// Feed between touches, mm/s.
const RAPID_MM_S: f64 = 50.0;

/// The least acceleration limit of the linear axes.
pub fn acceleration_mm_s2(machine: &MachineFile) -> f64 {
    let limits = Axis::LINEAR
        .into_iter()
        .filter_map(|axis| machine.linear(axis));
    limits
        .map(|entry| entry.acceleration_limit_mm_s2)
        .fold(f64::INFINITY, f64::min)
        .min(1e5)
}

/// What every pass of an experiment shares.
pub struct Frame<'f> {
    /// The machine.
    pub machine: &'f MachineFile,
    /// Where the axes rest that a pass does not move.
    pub rest: PerAxis<f64>,
    /// Channels that are read beside the pass' own: motors, scales.
    pub beside: Vec<Channel>,
    /// From the axes' point to the measured one, mm.
    pub tool_offset_mm: Vector3<f64>,
    /// Set-up and zero, new for every experiment.
    pub setup: u32,
    /// Shortest step of the motion, s.
    pub servo_s: f64,
}

/// The run that a pass would be, its readings zero; none where it reads nothing or repeats a run.
pub fn run(frame: &Frame<'_>, pass: &Pass, number: u32, start_s: f64) -> Option<Run> {
    let machine = frame.machine;
    let step_s = (duration_s(pass, machine, |_| 0.0) / TICKS).max(frame.servo_s);
    let acceleration = acceleration_mm_s2(machine);
    let begin = |at: Vector3<f64>| {
        let mut rest = frame.rest;
        for (index, axis) in Axis::LINEAR.into_iter().enumerate() {
            rest[axis] = at[index];
        }
        Course::new(start_s, step_s, acceleration, rest, machine.axis_set())
    };
    let (course, own) = moved(pass, acceleration, begin)?;
    finished(frame, pass, number, course, own)
}

/// The course of a pass and the channels of its own instrument.
fn moved(
    pass: &Pass,
    acceleration: f64,
    begin: impl Fn(Vector3<f64>) -> Course,
) -> Option<(Course, Vec<Channel>)> {
    Some(match pass {
        Pass::Circle {
            instrument,
            plane,
            centre_mm,
            radius_mm,
            feed_mm_s,
            sense,
        } => {
            let axes = plate_axes(*plane)?;
            let centre = Vector3::from(*centre_mm);
            let lead = lead_rad(*radius_mm, *feed_mm_s, acceleration);
            let mut course = begin(start_of_turn(axes, centre, *radius_mm, lead, *sense));
            course.turn(axes, centre, *radius_mm, *feed_mm_s, *sense);
            (course, along(*instrument, axes[0]))
        }
        Pass::Line {
            instrument,
            axis,
            from_mm,
            to_mm,
            feed_mm_s,
            stops,
            dwell_s,
            ..
        } => {
            let ends = [Vector3::from(*from_mm), Vector3::from(*to_mm)];
            let mut course = begin(ends[0]);
            course.there_and_back(ends, *feed_mm_s, *stops, *dwell_s);
            (course, along(*instrument, *axis))
        }
        Pass::Touches { touches, .. } => {
            let first = touches.first()?;
            let mut course = begin(before(first));
            for touch in touches {
                course.touch(touch);
            }
            (course, vec![Channel::Touch])
        }
        Pass::Still {
            instrument,
            axis,
            at_mm,
            seconds,
            ..
        } => {
            let mut course = begin(Vector3::from(*at_mm));
            course.wait(*seconds, true);
            (course, along(*instrument, *axis))
        }
        Pass::Warm { .. } | Pass::Again { .. } => return None,
    })
}

/// Where a turn begins its ramp.
fn start_of_turn(
    [u, v]: [Axis; 2],
    centre: Vector3<f64>,
    radius_mm: f64,
    lead: f64,
    sense: Sense,
) -> Vector3<f64> {
    let behind = if sense == Sense::Clockwise { 1.0 } else { -1.0 };
    let mut start = centre;
    start[u.index()] += radius_mm * lead.cos();
    start[v.index()] += radius_mm * behind * lead.sin();
    start
}

/// Clear of the surface that a touch meets.
fn before(touch: &PlannedTouch) -> Vector3<f64> {
    Vector3::from(touch.at_mm) - CLEARANCE_MM * Vector3::from(touch.approach)
}

fn along(instrument: Instrument, axis: Axis) -> Vec<Channel> {
    match instrument {
        Instrument::Length => vec![Channel::Length(axis)],
        Instrument::Radial => vec![Channel::Radial],
        _ => vec![Channel::GridU, Channel::GridV],
    }
}

fn finished(
    frame: &Frame<'_>,
    pass: &Pass,
    number: u32,
    course: Course,
    own: Vec<Channel>,
) -> Option<Run> {
    let mut motion = Motion::new(course.time_s, course.axes, course.position).ok()?;
    motion.follow(frame.machine);
    let read = |channel: &Channel, at: usize| Reading {
        channel: channel.clone(),
        at,
        fraction: 0.0,
        deviation: 0.0,
    };
    let mut readings = Vec::new();
    for channel in own.iter().chain(&frame.beside) {
        if *channel == Channel::Touch {
            readings.extend((0..course.touches.len()).map(|touch| read(channel, touch)));
        } else {
            readings.extend(course.read.iter().map(|tick| read(channel, *tick)));
        }
    }
    Some(Run {
        segment: segment(frame, pass, number),
        motion,
        touches: course.touches,
        readings,
    })
}

/// A segment that says nothing but its number and set-up.
fn empty(frame: &Frame<'_>, number: u32) -> TestSegment {
    TestSegment {
        at: Stamp::from_nanos(0),
        run: number,
        begin: true,
        kind: TestKind::Dwell,
        plane: TestPlane::None,
        centre_mm: Vector3::zeros(),
        radius_mm: 0.0,
        feed_mm_s: 0.0,
        sense: Sense::None,
        repeat: 0,
        stylus: String::new(),
        tool_offset_mm: frame.tool_offset_mm,
        stations: 0,
        zero_id: frame.setup,
        setup_id: frame.setup,
        cold: false,
        features: vec![],
        completed: true,
    }
}

fn segment(frame: &Frame<'_>, pass: &Pass, number: u32) -> TestSegment {
    let mut segment = empty(frame, number);
    match pass {
        Pass::Circle {
            plane,
            centre_mm,
            radius_mm,
            feed_mm_s,
            sense,
            ..
        } => {
            segment.kind = TestKind::Circle;
            segment.plane = *plane;
            segment.centre_mm = Vector3::from(*centre_mm);
            (segment.radius_mm, segment.feed_mm_s, segment.sense) =
                (*radius_mm, *feed_mm_s, *sense);
        }
        Pass::Line {
            plane,
            from_mm,
            to_mm,
            feed_mm_s,
            stops,
            ..
        } => {
            segment.kind = if *stops > 0 {
                TestKind::Positioning
            } else {
                TestKind::Line
            };
            segment.plane = *plane;
            segment.centre_mm = 0.5 * (Vector3::from(*from_mm) + Vector3::from(*to_mm));
            (segment.feed_mm_s, segment.stations) = (*feed_mm_s, *stops);
        }
        Pass::Touches { touches, stylus } => {
            segment.kind = TestKind::Touch;
            segment.feed_mm_s = touches.first().map_or(0.0, |touch| touch.feed_mm_s);
            segment.stylus.clone_from(stylus);
            segment.tool_offset_mm = Vector3::zeros();
        }
        Pass::Still { plane, at_mm, .. } => {
            segment.plane = *plane;
            segment.centre_mm = Vector3::from(*at_mm);
        }
        Pass::Warm { .. } | Pass::Again { .. } => {}
    }
    segment
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_a_short_way_never_reaches_its_feed_and_every_way_ends_at_its_end() {
        // 100 mm at 50 mm/s with 500 mm/s2: 2.1 s. 1 mm: two ramps of sqrt(1/500) s.
        let (total_s, place) = ramped(100.0, 50.0, 500.0);
        assert!((total_s - 2.1).abs() < 1e-12);
        assert!((place(0.1) - 2.5).abs() < 1e-12);
        assert!((place(1.05) - 50.0).abs() < 1e-12);
        assert!((place(total_s) - 100.0).abs() < 1e-12);
        let (total_s, place) = ramped(1.0, 50.0, 500.0);
        assert!((total_s - 2.0 * (1.0_f64 / 500.0).sqrt()).abs() < 1e-12);
        assert!((place(0.5 * total_s) - 0.5).abs() < 1e-12);
    }
    #[test]
    fn a_line_is_read_at_its_feed_and_not_where_it_turns() {
        let axes = AxisSet::EMPTY.with(Axis::X);
        let mut course = Course::new(0.0, 1e-3, 500.0, PerAxis::default(), axes);
        let ends = [Vector3::zeros(), Vector3::new(100.0, 0.0, 0.0)];
        course.there_and_back(ends, 50.0, 0, 0.5);
        let motion = Motion::new(course.time_s, axes, course.position).expect("a motion");
        let speed = |tick: &usize| motion.velocity[Axis::X][*tick];
        let is_at_feed = |tick: &usize| (speed(tick).abs() - 50.0).abs() < 0.5;
        assert!(course.read.iter().all(is_at_feed));
        // Each way lasts 2.1 s with two ramps of 0.1 s and what settles behind the first.
        for sign in [1.0, -1.0] {
            let way = course.read.iter().filter(|tick| sign * speed(tick) > 0.0);
            assert!((1840..=1860).contains(&way.count()));
        }
    }
}
