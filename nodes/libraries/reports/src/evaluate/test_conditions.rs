//! Under which conditions the tests of a bag ran: when, how fast, after what, and what its thermometers read meanwhile.

use std::collections::BTreeMap;

use abbe_msgs::topics;
use metrology::Axis;
use metrology::sample::{ProbedPoint, TemperatureSample, TestKind, TestSegment};
use metrology::stamp::{Host, Span, Stamp};
use recorder::{Bag, Order};
use replayer::{Taken, reading};

use super::course::Course;
use super::imported::Imported;
use super::thermometer::{Dead, Watch};

/// Age of the last reading before a test that still counts for it: thermometers are read every few seconds to minutes.
const LONGEST_AGE: Span = Span::from_nanos(600_000_000_000);
/// Feeds closer than this share of the greater one are one: that of a touch is known to 0.2 %.
const SAME_FEED: f64 = 0.01;
/// Less production between tests is the way to a set-up, s.
const LEAST_PRODUCTION_S: f64 = 60.0;
/// Tests that touch.
const TOUCHING: [TestKind; 8] = [
    TestKind::Latency,
    TestKind::Block,
    TestKind::Touch,
    TestKind::Plane,
    TestKind::Bore,
    TestKind::Sphere,
    TestKind::Rotary,
    TestKind::RotaryVerification,
];

/// Readings of one thermometer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// The first one, °C.
    pub first_degc: f64,
    /// The last one, °C.
    pub last_degc: f64,
    /// The least, °C.
    pub least_degc: f64,
    /// The greatest, °C.
    pub greatest_degc: f64,
    /// How many.
    pub n: u32,
    /// What it shows since it stopped to measure, where that is among them.
    pub dead: Option<Dead>,
    sum_degc: f64,
}

/// Readings by name of the thermometer.
pub type Thermometers = BTreeMap<String, Readings>;

impl Readings {
    /// One reading.
    #[must_use]
    pub const fn new(degc: f64) -> Self {
        Self {
            first_degc: degc,
            last_degc: degc,
            least_degc: degc,
            greatest_degc: degc,
            n: 1,
            dead: None,
            sum_degc: degc,
        }
    }

    /// A later reading.
    pub fn add(&mut self, degc: f64) {
        self.join(Self::new(degc));
    }

    /// Later readings.
    fn join(&mut self, later: Self) {
        self.last_degc = later.last_degc;
        self.least_degc = self.least_degc.min(later.least_degc);
        self.greatest_degc = self.greatest_degc.max(later.greatest_degc);
        self.n = self.n.saturating_add(later.n);
        self.sum_degc += later.sum_degc;
    }

    /// Whether this is the least or the greatest reading.
    fn has(&self, degc: f64) -> bool {
        let ends = [self.least_degc, self.greatest_degc];
        ends.iter().any(|end| end.total_cmp(&degc).is_eq())
    }

    /// Mean, °C.
    #[must_use]
    pub fn mean_degc(&self) -> f64 {
        self.sum_degc / f64::from(self.n)
    }

    /// Greatest minus least, K.
    #[must_use]
    pub fn range_k(&self) -> f64 {
        self.greatest_degc - self.least_degc
    }
}

/// One test.
#[derive(Clone, Debug)]
struct Test {
    run: u32,
    thermometers: Thermometers,
    /// Positioning tables that were made meanwhile, by the axis of each.
    tables: Vec<Axis>,
}

/// The conditions of a bag's tests.
#[derive(Clone, Debug, Default)]
pub struct TestConditions {
    /// Begin of the first test and end of the last one.
    pub between: Option<(Stamp<Host>, Stamp<Host>)>,
    /// Whether a grid encoder was read during a test.
    pub has_grid: bool,
    /// Whether a length reference was read during a test.
    pub has_length: bool,
    /// Whether a test touched anything.
    pub has_touches: bool,
    /// Feeds of the tests in their order, each once, mm/s: those of programs, and those of touches in whole mm/min.
    pub feeds_mm_s: Vec<f64>,
    /// How long programs of production ran before the first measurement, s.
    pub production_before_s: f64,
    /// Later runs before which there was a minute of production or more, with all production of the bag until then, s.
    pub production_before_later: Vec<(u32, f64)>,
    /// From the first test to the last one.
    pub thermometers: Thermometers,
    /// What is stated of a table that was imported; none of a recording.
    pub imported: Option<Imported>,
    /// Readings of each thermometer over the whole bag, °C.
    pub courses: BTreeMap<String, Course<f64>>,
    tests: Vec<Test>,
    watches: BTreeMap<String, Watch>,
    latest: BTreeMap<String, (Stamp<Host>, f64)>,
    under_way: Option<TestSegment>,
    /// Production that has ended, s.
    produced_s: f64,
    /// When the production began that is under way; blocks are measured within it.
    produces_since: Option<Stamp<Host>>,
}

impl TestConditions {
    /// Reads the conditions of a bag alone.
    #[must_use]
    pub fn of(bag: &Bag) -> Self {
        let wanted = [
            topics::TEST_SEGMENT.name,
            topics::TEMPERATURE.base,
            topics::GRID_POSITION.name,
            topics::LENGTH_POSITION.name,
            topics::PROBE_POINT.name,
        ];
        let mut conditions = Self {
            imported: Imported::of(bag),
            ..Self::default()
        };
        reading::read(bag, Order::LogTime, &wanted, |mut taken| {
            conditions.message(&mut taken);
            if taken.is(&topics::TEST_SEGMENT)
                && let Some(segment) = taken.of(&topics::TEST_SEGMENT)
            {
                conditions.segment(&segment);
            }
        });
        conditions
    }

    /// Begin of the first test and end of the last one, ns since 1970; of a table without times its stated begin twice.
    #[must_use]
    pub fn nanos(&self) -> Option<(i64, i64)> {
        if let Some(table) = &self.imported {
            let begin = table.begin_nanos()?;
            if table.is_motion_made_up() {
                return Some((begin, begin));
            }
        }
        let (first, last) = self.between?;
        Some((first.nanos(), last.nanos()))
    }

    /// Any message but that of a test: what is read, and the readings of thermometers.
    pub fn message(&mut self, taken: &mut Taken<'_>) {
        if taken.is_named(topics::TEMPERATURE.base) {
            self.temperature(taken);
        } else if self.is_in_test() {
            self.has_grid |= taken.is(&topics::GRID_POSITION);
            self.has_length |= taken.is(&topics::LENGTH_POSITION);
            if taken.is(&topics::PROBE_POINT)
                && let Some(point) = taken.of(&topics::PROBE_POINT)
            {
                self.touch(&point);
            } else if taken.is(&topics::POSITIONING_TABLE)
                && let Some(table) = taken.of(&topics::POSITIONING_TABLE)
                && let Some(test) = self.tests.last_mut()
            {
                test.tables.push(table.axis);
            }
        }
    }

    /// A touch within a test: the programs of a cycle have several feeds, of which its begin states one.
    fn touch(&mut self, point: &ProbedPoint) {
        self.feed((point.feed_mm_s * 60.0).round() / 60.0);
    }

    fn feed(&mut self, feed_mm_s: f64) {
        let is_known = |known: &f64| (known - feed_mm_s).abs() < SAME_FEED * known.max(feed_mm_s);
        if feed_mm_s > 0.0 && feed_mm_s.is_finite() && !self.feeds_mm_s.iter().any(is_known) {
            self.feeds_mm_s.push(feed_mm_s);
        }
    }

    fn temperature(&mut self, taken: &mut Taken<'_>) {
        let Some(mut sample) = taken.of_member(&topics::TEMPERATURE) else {
            return;
        };
        if let Some(name) = topics::TEMPERATURE.member_of(taken.topic()) {
            name.clone_into(&mut sample.sensor);
            self.read(&sample);
        }
    }

    fn read(&mut self, sample: &TemperatureSample) {
        let (name, degc) = (&sample.sensor, sample.temperature_degc);
        self.latest.insert(name.clone(), (sample.at, degc));
        let course = self.courses.entry(name.clone()).or_default();
        course.add(sample.at, degc);
        self.watches.entry(name.clone()).or_default().add(degc);
        if self.between.is_some() {
            add(&mut self.thermometers, name, degc);
        }
        if self.is_in_test()
            && let Some(test) = self.tests.last_mut()
        {
            add(&mut test.thermometers, name, degc);
        }
    }

    /// Whether a test is under way; production does not count as a test.
    fn is_in_test(&self) -> bool {
        let segment = self.under_way.as_ref();
        segment.is_some_and(|segment| segment.kind != TestKind::Production)
    }

    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.kind == TestKind::Production {
            self.production(segment);
        } else if segment.begin {
            self.begin(segment);
        } else if self.under_way.take().is_some()
            && let Some((_, last)) = &mut self.between
        {
            *last = segment.at;
        }
    }

    fn production(&mut self, segment: &TestSegment) {
        self.under_way = segment.begin.then(|| segment.clone());
        self.produced_s = self.produced_until_s(segment.at);
        self.produces_since = segment.begin.then_some(segment.at);
    }

    /// All production until then, s.
    fn produced_until_s(&self, at: Stamp<Host>) -> f64 {
        let since = self.produces_since.map(|since| (at - since).as_secs_f64());
        self.produced_s + since.unwrap_or(0.0)
    }

    fn count_production(&mut self, segment: &TestSegment) {
        let before_s = self.produced_until_s(segment.at);
        if self.between.is_none() {
            self.production_before_s = before_s;
            return;
        }
        let known = self.production_before_later.last();
        let known_s = known.map_or(self.production_before_s, |(_, known_s)| *known_s);
        if before_s - known_s >= LEAST_PRODUCTION_S {
            self.production_before_later.push((segment.run, before_s));
        }
    }

    fn begin(&mut self, segment: &TestSegment) {
        self.count_production(segment);
        let is_fresh =
            |(_, (at, _)): &(&String, &(Stamp<Host>, f64))| segment.at - *at <= LONGEST_AGE;
        let latest = self.latest.iter().filter(is_fresh);
        let thermometers: Thermometers = latest
            .map(|(name, (_, degc))| (name.clone(), Readings::new(*degc)))
            .collect();
        let (first, _) = *self.between.get_or_insert_with(|| {
            self.thermometers.clone_from(&thermometers);
            (segment.at, segment.at)
        });
        self.between = Some((first, segment.at));
        self.has_touches |= TOUCHING.contains(&segment.kind);
        self.feed(segment.feed_mm_s);
        self.tests.push(Test {
            run: segment.run,
            thermometers,
            tables: vec![],
        });
        self.under_way = Some(segment.clone());
    }

    /// Thermometers that stopped to measure.
    pub fn dead(&self) -> impl Iterator<Item = (&String, Dead)> {
        let watches = self.watches.iter();
        watches.filter_map(|(name, watch)| Some((name, watch.dead()?)))
    }

    /// What the thermometers read during tests, by the numbers of their runs.
    #[must_use]
    pub fn during(&self, runs: &[u32]) -> Thermometers {
        let mut joined = Thermometers::new();
        for test in self.tests.iter().filter(|test| runs.contains(&test.run)) {
            for (name, readings) in &test.thermometers {
                match joined.get_mut(name) {
                    Some(known) => known.join(*readings),
                    None => {
                        joined.insert(name.clone(), *readings);
                    }
                }
            }
        }
        for (name, dead) in self.dead() {
            if let Some(readings) = joined.get_mut(name) {
                readings.dead = Some(dead).filter(|dead| readings.has(dead.degc));
            }
        }
        joined
    }

    /// How many positioning tables of an axis were made during tests, by the numbers of their runs.
    #[must_use]
    pub fn tables_during(&self, runs: &[u32], axis: Axis) -> usize {
        let tests = self.tests.iter().filter(|test| runs.contains(&test.run));
        let tables = tests.flat_map(|test| &test.tables);
        tables.filter(|of| **of == axis).count()
    }

    /// Takes what thermometers read during a run.
    #[cfg(test)]
    pub(crate) fn thermometers_of_run(&mut self, run: u32, thermometers: Thermometers) {
        self.tests.push(Test {
            run,
            thermometers,
            tables: vec![],
        });
    }
}

fn add(thermometers: &mut Thermometers, name: &str, degc: f64) {
    match thermometers.get_mut(name) {
        Some(known) => known.add(degc),
        None => {
            thermometers.insert(name.to_owned(), Readings::new(degc));
        }
    }
}

#[cfg(test)]
mod tests {
    use metrology::sample::{Correction, Rejection};
    use metrology::{AxisSet, PerAxis};
    use nalgebra::Vector3;

    use super::*;

    fn segment(at_s: i64, run: u32, begin: bool, kind: TestKind) -> TestSegment {
        TestSegment {
            begin,
            feed_mm_s: 100.0,
            zero_id: 1,
            setup_id: 1,
            completed: !begin,
            ..TestSegment::of_kind(kind, run, Stamp::from_nanos(at_s * 1_000_000_000))
        }
    }

    fn reading(at_s: i64, temperature_degc: f64) -> TemperatureSample {
        TemperatureSample {
            at: Stamp::from_nanos(at_s * 1_000_000_000),
            sensor: "bed".to_owned(),
            temperature_degc,
            variance_k2: 0.0,
        }
    }

    #[test]
    fn feeds_of_touches_are_among_those_of_the_test() {
        // As a bag of the scenario five_axis has them: 60 mm/min in the begin of the latency cycle, 120 in the next one.
        let mut conditions = TestConditions::default();
        conditions.segment(&segment_at_feed(1, TestKind::Latency, 60.0));
        for feed_mm_min in [60.0, 119.813, 240.0, 480.188, 120.187, 480.0, f64::NAN] {
            conditions.touch(&touch(feed_mm_min));
        }
        conditions.segment(&segment_at_feed(2, TestKind::Rotary, 120.0));
        conditions.touch(&touch(120.015));
        let mm_min: Vec<f64> = { conditions.feeds_mm_s.iter() }
            .map(|feed| (feed * 60.0 * 1e6).round() / 1e6)
            .collect();
        assert_eq!(mm_min, [60.0, 120.0, 240.0, 480.0]);
    }

    fn segment_at_feed(run: u32, kind: TestKind, feed_mm_min: f64) -> TestSegment {
        TestSegment {
            feed_mm_s: feed_mm_min / 60.0,
            ..segment(0, run, true, kind)
        }
    }

    fn touch(feed_mm_min: f64) -> ProbedPoint {
        ProbedPoint {
            received_at: Stamp::from_nanos(0),
            feature_id: "top".to_owned(),
            axes_at_contact: PerAxis::default(),
            axes: AxisSet::XYZ,
            point_in_machine_mm: Vector3::zeros(),
            point_in_workpiece_mm: Vector3::zeros(),
            applied_latency_s: 0.0,
            correction: Correction::None,
            standard_uncertainty_mm: 0.0,
            approach: -Vector3::z(),
            feed_mm_s: feed_mm_min / 60.0,
            rejection: Rejection::None,
            sequence: 0,
        }
    }

    #[test]
    fn what_production_between_two_tests_warms_up_is_of_neither() {
        let mut conditions = TestConditions::default();
        let mut during = |run, kind, begin_s: i64, degc: [f64; 2]| {
            conditions.segment(&segment(begin_s, run, true, kind));
            for (at_s, degc) in [10, 20].into_iter().zip(degc) {
                conditions.read(&reading(begin_s + at_s, degc));
            }
            conditions.segment(&segment(begin_s + 30, run, false, kind));
        };
        during(1, TestKind::Positioning, 0, [20.0, 20.2]);
        during(2, TestKind::Production, 1_000, [26.0, 30.0]);
        during(3, TestKind::Positioning, 2_000, [24.0, 23.0]);
        let mean_and_range = |run| {
            let bed = conditions.during(&[run])["bed"];
            (bed.mean_degc(), bed.range_k())
        };
        let [first, last] = [mean_and_range(1), mean_and_range(3)];
        assert!(
            (first.0 - 20.1).abs() < 1e-12 && (first.1 - 0.2).abs() < 1e-12,
            "{first:?}"
        );
        assert!(
            (last.0 - 23.5).abs() < 1e-12 && (last.1 - 1.0).abs() < 1e-12,
            "{last:?}"
        );
        assert!(conditions.during(&[2]).is_empty());
    }

    #[test]
    fn a_test_has_the_readings_of_its_time_and_the_last_one_before_it() {
        let mut conditions = TestConditions::default();
        conditions.segment(&segment(0, 1, true, TestKind::Production));
        conditions.read(&reading(10, 30.0));
        conditions.segment(&segment(600, 1, false, TestKind::Production));
        conditions.read(&reading(610, 21.0));
        conditions.segment(&segment(615, 2, true, TestKind::Positioning));
        conditions.read(&reading(620, 22.0));
        conditions.read(&reading(630, 20.5));
        conditions.segment(&segment(635, 2, false, TestKind::Positioning));
        conditions.read(&reading(640, 25.0));
        // The last reading is older than ten minutes.
        conditions.segment(&segment(2_000, 3, true, TestKind::Positioning));
        conditions.segment(&segment(2_010, 3, false, TestKind::Positioning));
        let bed = conditions.during(&[2])["bed"];
        assert_eq!((bed.first_degc, bed.last_degc, bed.n), (21.0, 20.5, 3));
        assert_eq!((bed.least_degc, bed.greatest_degc), (20.5, 22.0));
        assert!((bed.mean_degc() - 63.5 / 3.0).abs() < 1e-12);
        assert!(conditions.during(&[3]).is_empty());
        assert_eq!(conditions.during(&[2, 3])["bed"], bed);
        // The bag as a whole: without the production, with what came between the tests.
        let all = conditions.thermometers["bed"];
        assert_eq!((all.first_degc, all.last_degc, all.n), (21.0, 25.0, 4));
        assert!((conditions.production_before_s - 600.0).abs() < 1e-9);
        assert_eq!(conditions.production_before_later, []);
        for s in 0..6 {
            conditions.read(&reading(2_020 + s, 0.0));
        }
        conditions.segment(&segment(2_030, 4, true, TestKind::Positioning));
        conditions.segment(&segment(2_040, 4, false, TestKind::Positioning));
        assert_eq!(conditions.during(&[2])["bed"].dead, None);
        let dead = conditions.during(&[2, 4])["bed"].dead.unwrap();
        assert_eq!((dead.before_degc, dead.degc, dead.n), (Some(25.0), 0.0, 6));
        assert_eq!(conditions.feeds_mm_s, [100.0]);
        let (first, last) = conditions.between.unwrap();
        assert_eq!(last - first, Span::from_nanos(1_425_000_000_000));
    }

    #[test]
    fn production_before_later_tests_is_counted_and_so_is_that_around_a_test() {
        let mut conditions = TestConditions::default();
        let mut one = |second, run, begin, kind| {
            conditions.segment(&segment(second, run, begin, kind));
        };
        // The second test is preceded by the way to its set-up.
        for (run, begin_s, end_s, kind) in [
            (1, 0, 10, TestKind::Positioning),
            (7, 12, 18, TestKind::Production),
            (2, 20, 30, TestKind::Positioning),
        ] {
            one(begin_s, run, true, kind);
            one(end_s, run, false, kind);
        }
        // An hour, of which the last ten minutes follow a block that is measured meanwhile.
        one(100, 3, true, TestKind::Production);
        one(3_100, 4, true, TestKind::Block);
        one(3_110, 4, false, TestKind::Block);
        one(3_700, 3, false, TestKind::Production);
        one(3_710, 5, true, TestKind::Positioning);
        one(3_720, 5, false, TestKind::Positioning);
        one(3_730, 6, true, TestKind::Positioning);
        assert!(conditions.production_before_s.abs() < 1e-9);
        let later = conditions.production_before_later;
        assert_eq!(later, [(4, 3_006.0), (5, 3_606.0)]);
    }
}
