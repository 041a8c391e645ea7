//! A shift as the samples that a recorder gets: a bag as of any other machine.
//!
//! On circles the states come every 20 ms and the bar is read in between, on approaches every 10 ms; in production
//! once a second, in rest every two.

use std::f64::consts::TAU;

use metrology::sample::{
    AxisState, LengthSample, ProbeTrigger, Sense, TemperatureSample, TestKind, TestPlane,
    TestSegment,
};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::super::ballbar::LETTERS;
use super::super::dice::heavy;
use super::super::heat::KEPT_S;
use super::super::layout::START_S;
use super::timetable::{AHEAD_RAD, CENTRE_MM, Cycle, Entry, Timetable, Touched, Turn};
use super::warmth::{Warmth, at};
use crate::measurement::Sample;

/// Spacing of states on circles, on approaches, in production, at rest, s.
const TICK_S: f64 = 0.02;
const APPROACH_TICK_S: f64 = 0.01;
const PRODUCTION_TICK_S: f64 = 1.0;
const REST_TICK_S: f64 = 2.0;
/// The same on the way from one touch to the next: more than a quarter of a second is a hole in a motion.
const WAY_TICK_S: f64 = 0.2;
/// Ball, stand-off and feed of a touch, mm and mm/s.
pub const BALL_MM: f64 = 3.0;
const STANDOFF_MM: f64 = 2.0;
const TOUCH_FEED_MM_S: f64 = 2.0;
/// How far from the corner a face is touched, mm.
pub const INSET_MM: f64 = 6.0;
/// Noise of a thermometer, K.
const THERMOMETER_NOISE_K: f64 = 0.02;
/// Ways of X, Y and Z in production about the middle, mm, and their speeds at full load, mm/s.
const STROKES_MM: [f64; 3] = [180.0, 140.0, 60.0];
const SPEEDS_MM_S: [f64; 3] = [110.0, 90.0, 30.0];

/// The samples of a session with their instants.
pub type Samples = Vec<(Stamp<Host>, Sample)>;

/// A session that is written.
struct Written<'s> {
    table: &'s Timetable,
    samples: Samples,
    place_mm: [f64; 3],
    now_s: f64,
    touches: u32,
}

/// Samples of a shift whose readings are given: of the circles, then of the touches, µm.
pub fn samples(
    random: &mut Pcg64Mcg,
    table: &Timetable,
    warmth: &Warmth,
    readings_um: &[f64],
) -> Samples {
    let mut written = Written {
        table,
        samples: vec![],
        place_mm: CENTRE_MM,
        now_s: 0.0,
        touches: 0,
    };
    let circles: usize = table.turns().map(|turn| turn.circle.angles.len()).sum();
    let (of_circles, of_touches) = readings_um.split_at(circles);
    let (mut radial, mut touched) = (of_circles.iter(), of_touches.iter());
    written.state(0.0);
    for entry in &table.entries {
        match entry {
            Entry::Turn(turn) => written.turn(turn, &mut radial),
            Entry::Cycle(cycle) => written.cycle(cycle, &mut touched),
            Entry::Production(run, span_s) => written.production(*run, *span_s, &warmth.axis_load),
        }
    }
    written.rest(table.end_s() + 10.0);
    written.temperatures(random, warmth);
    let mut samples = written.samples;
    samples.sort_by_key(|(at, _)| *at);
    samples
}

fn stamp(at_s: f64) -> Stamp<Host> {
    let start = i64::try_from(START_S).unwrap_or(0);
    Stamp::from_nanos(start * 1_000_000_000) + Span::from_secs_f64(at_s)
}

fn on_axes(place_mm: &[f64; 3]) -> PerAxis<f64> {
    PerAxis::from_fn(|axis| place_mm.get(axis.index()).copied().unwrap_or(0.0))
}

impl Written<'_> {
    fn put(&mut self, at_s: f64, sample: Sample) {
        self.samples.push((stamp(at_s), sample));
    }

    /// A state at a later instant.
    fn state(&mut self, at_s: f64) {
        let at = stamp(at_s);
        let same = Stamp::from_nanos(at.nanos());
        let state = AxisState::standing(at, same, AxisSet::XYZ, on_axes(&self.place_mm));
        self.now_s = at_s;
        self.put(at_s, Sample::State(state));
    }

    /// Stands until an instant.
    fn rest(&mut self, until_s: f64) {
        while self.now_s + 1.5 * REST_TICK_S < until_s {
            self.state(self.now_s + REST_TICK_S);
        }
        self.state(until_s);
    }

    /// Goes evenly to a place until an instant.
    fn go(&mut self, to_mm: [f64; 3], until_s: f64) {
        let (from_mm, from_s) = (self.place_mm, self.now_s);
        let steps = ((until_s - from_s) / WAY_TICK_S).ceil().max(1.0);
        for step in 1..=steps as usize {
            let share = step as f64 / steps;
            self.place_mm = [0, 1, 2].map(|k| from_mm[k] + share * (to_mm[k] - from_mm[k]));
            self.state(from_s + share * (until_s - from_s));
        }
    }

    fn segment(&mut self, mut segment: TestSegment, [from_s, to_s]: [f64; 2]) {
        segment.at = stamp(from_s);
        self.put(from_s, Sample::Segment(segment.clone()));
        segment.at = stamp(to_s);
        segment.begin = false;
        self.put(to_s, Sample::Segment(segment));
    }

    fn turn(&mut self, turn: &Turn, radial_um: &mut std::slice::Iter<'_, f64>) {
        let circle = &turn.circle;
        let sense = if circle.is_ccw { 1.0 } else { -1.0 };
        let [begin_s, end_s] = turn.span_s;
        let first = circle.angles.first().copied().unwrap_or(0.0) - sense * AHEAD_RAD;
        let rate = circle.feed_mm_s / circle.radius_mm;
        let to = |angle: f64| {
            let mut place_mm = CENTRE_MM;
            place_mm[circle.axes[0]] += circle.radius_mm * angle.cos();
            place_mm[circle.axes[1]] += circle.radius_mm * angle.sin();
            place_mm
        };
        self.place_mm = to(first);
        self.rest(begin_s - 0.5 * TICK_S);
        let segment = TestSegment {
            plane: [TestPlane::Xy, TestPlane::Yz, TestPlane::Zx][turn.plane],
            centre_mm: Vector3::from(CENTRE_MM),
            radius_mm: circle.radius_mm,
            feed_mm_s: circle.feed_mm_s,
            sense: if circle.is_ccw {
                Sense::CounterClockwise
            } else {
                Sense::Clockwise
            },
            repeat: turn.visit - 1,
            zero_id: 3 * turn.visit + turn.plane as u32,
            ..TestSegment::of_kind(TestKind::Circle, turn.run, stamp(begin_s))
        };
        self.segment(segment, [begin_s, end_s + 0.5]);
        let ticks = ((TAU + AHEAD_RAD) / rate / TICK_S).ceil() as usize;
        for tick in 0..=ticks {
            self.place_mm = to(first + sense * rate * TICK_S * tick as f64);
            self.state(begin_s + TICK_S * tick as f64);
        }
        let axis = Axis::LINEAR[circle.axes[0]];
        for (angle, radial_um) in circle.angles.iter().zip(radial_um) {
            let at_s = begin_s + (angle - first).abs() / rate;
            let length = LengthSample {
                at: stamp(at_s),
                axis,
                displacement_mm: circle.radius_mm + 1e-3 * radial_um,
                zero_id: 3 * turn.visit + turn.plane as u32,
            };
            self.put(at_s, Sample::Length(length));
        }
    }

    fn cycle(&mut self, cycle: &Cycle, touched_um: &mut std::slice::Iter<'_, f64>) {
        let faces = |id: &str| LETTERS.map(|letter| format!("{id}.{}", letter.to_lowercase()));
        let segment = TestSegment {
            feed_mm_s: TOUCH_FEED_MM_S,
            stylus: "a".to_owned(),
            features: self
                .table
                .blocks
                .iter()
                .flat_map(|block| faces(block.id))
                .collect(),
            ..TestSegment::of_kind(TestKind::Block, cycle.run, stamp(cycle.span_s[0]))
        };
        self.rest(cycle.span_s[0] - 1.0);
        self.segment(segment, cycle.span_s);
        for (touch, off_um) in cycle.touches.iter().zip(touched_um) {
            self.touch(touch, *off_um);
        }
        self.rest(cycle.span_s[1]);
    }

    fn touch(&mut self, touch: &Touched, off_um: f64) {
        let block = &self.table.blocks[touch.block];
        let sense = block.senses[touch.axis];
        let mut contact_mm = [0, 1, 2].map(|k| block.corner_mm[k] + INSET_MM * block.senses[k]);
        // A tip that is ahead meets the face where its axis reads less.
        contact_mm[touch.axis] = block.corner_mm[touch.axis] - BALL_MM * sense - 1e-3 * off_um;
        let approach_s = STANDOFF_MM / TOUCH_FEED_MM_S;
        let ticks = (approach_s / APPROACH_TICK_S).round() as usize;
        let before = |left_s: f64| {
            let mut place_mm = contact_mm;
            place_mm[touch.axis] -= sense * TOUCH_FEED_MM_S * left_s;
            place_mm
        };
        self.go(
            before(approach_s),
            touch.at_s - approach_s - APPROACH_TICK_S,
        );
        for tick in 0..=ticks {
            let left_s = approach_s - APPROACH_TICK_S * tick as f64;
            self.place_mm = before(left_s);
            self.state(touch.at_s - left_s);
        }
        let mut approach = Vector3::zeros();
        approach[touch.axis] = sense;
        self.touches += 1;
        let trigger = ProbeTrigger {
            received_at: stamp(touch.at_s),
            controller_at: Stamp::from_nanos(stamp(touch.at_s).nanos()),
            feature_id: format!("{}.{}", block.id, LETTERS[touch.axis].to_lowercase()),
            approach,
            feed_mm_s: TOUCH_FEED_MM_S,
            axes: AxisSet::XYZ,
            latched: on_axes(&contact_mm),
            sequence: self.touches,
        };
        self.put(touch.at_s, Sample::Trigger(trigger));
        // Back to the stand-off, and up beside the block.
        self.go(before(approach_s), touch.at_s + 0.5);
        let mut above_mm = self.place_mm;
        above_mm[2] = (block.corner_mm[2] + 40.0).max(above_mm[2]);
        self.go(above_mm, touch.at_s + 1.5);
    }

    /// Axes that go to and fro, faster where the load is higher.
    fn production(&mut self, run: u32, span_s: [f64; 2], load: &[f64]) {
        self.rest(span_s[0] - 1.0);
        let segment = TestSegment::of_kind(TestKind::Production, run, stamp(span_s[0]));
        self.segment(segment, span_s);
        let mut ways_mm = [0.0; 3];
        while self.now_s + PRODUCTION_TICK_S < span_s[1] {
            let load = load.get(self.now_s as usize).copied().unwrap_or(0.0);
            for k in 0..3 {
                ways_mm[k] += load * SPEEDS_MM_S[k] * PRODUCTION_TICK_S;
                let turns = (ways_mm[k] / (4.0 * STROKES_MM[k]) + 0.25).fract();
                let zigzag = 1.0 - 4.0 * (turns - 0.5).abs();
                self.place_mm[k] = CENTRE_MM[k] - STROKES_MM[k] * zigzag;
            }
            self.state(self.now_s + PRODUCTION_TICK_S);
        }
    }

    fn temperatures(&mut self, random: &mut Pcg64Mcg, warmth: &Warmth) {
        let every_s = KEPT_S * f64::from([1_u8, 3][random.random_range(0..2)]);
        for thermometer in &warmth.thermometers {
            let mut at_s = 1.0;
            while at_s < self.table.end_s() {
                let degc = at(&thermometer.degc, at_s) + THERMOMETER_NOISE_K * heavy(random);
                let sample = TemperatureSample {
                    at: stamp(at_s),
                    sensor: thermometer.id.to_owned(),
                    temperature_degc: (100.0 * degc).round() / 100.0,
                    variance_k2: 0.0,
                };
                self.put(at_s, Sample::Temperature(sample));
                at_s += every_s;
            }
        }
    }
}
