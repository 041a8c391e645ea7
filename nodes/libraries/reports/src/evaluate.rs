//! What tests a bag holds, as the evaluations of ISO 230 take them.
//!
//! A bag is read once, in the order of time; what is kept is no more than the readings of its tests.

use abbe_msgs::topics;
use machine::MachineFile;
use metrology::sample::{
    AxisCompensation, AxisState, BlockMeasurement, GeometryModel, PositioningTable, ProbedFeature,
    ProbedPoint, TestSegment,
};
use recorder::{Bag, Loss, LossReason};
use replayer::{Reading, Taken, reading};

pub mod angular;
mod belonging;
pub mod budget;
pub mod circle_reading;
pub mod circles;
mod clashes;
pub mod correction;
pub mod course;
pub mod drift;
pub mod imported;
pub mod limits;
pub mod linear;
mod not_evaluated;
mod outside;
pub mod paths;
pub mod stationwise;
pub mod stops;
mod strays;
pub mod test_conditions;
pub mod thermometer;

use crate::machine_defaults;
use crate::machine_of_bag;
use angular::{RotaryRuns, RotaryTest};
use belonging::Belonging;
pub use belonging::BrokenOff;
use circles::{CircleRecording, Circles};
use clashes::Clashes;
use drift::{Drift, Drifts};
use imported::Imported;
use linear::{LinearRuns, LinearTest};
pub use not_evaluated::NotEvaluated;
use outside::Outside;
use paths::{PathRecording, Paths};
use stationwise::{StationCircle, Stationwise};
use stops::{StopRuns, Stops};
use strays::Strays;
use test_conditions::TestConditions;

/// Topics that evaluations read.
const WANTED: [&str; 15] = [
    topics::AXES_STATE.name,
    topics::GRID_POSITION.name,
    topics::LENGTH_POSITION.name,
    topics::COMPENSATION.name,
    topics::TEST_SEGMENT.name,
    topics::PROBE_POINT.name,
    // Touches are taken as the probe's node corrected them; of triggers of another clock it makes none.
    topics::PROBE_TRIGGER.name,
    topics::PROBE_FEATURE.name,
    topics::BLOCKS_MEASUREMENT.name,
    topics::GEOMETRY_MODEL.name,
    topics::GEOMETRY_ROTARY.name,
    topics::POSITIONING_TABLE.name,
    topics::ANGLE_POSITION.name,
    topics::TEMPERATURE.base,
    topics::MACHINE.base,
];

/// Offsets below this are none, mm.
const NOTHING_MM: f64 = 1e-7;

/// Whether compensation moves an axis.
pub(crate) fn acts(compensation: &AxisCompensation) -> bool {
    let mut offsets = compensation.total.0.iter();
    offsets.any(|offset| offset.abs() > NOTHING_MM)
}

/// The tests of a bag, and what was computed from them while it was recorded.
#[derive(Debug, Default)]
pub struct Tests {
    /// Circles over a grid encoder, or with a ballbar.
    pub circles: Vec<CircleRecording>,
    /// The circles with stops, for the published separation.
    pub station_circles: Vec<StationCircle>,
    /// Lines, corners and arcs over a grid encoder.
    pub paths: Vec<PathRecording>,
    /// Positioning runs and diagonals.
    pub linear: Vec<LinearTest>,
    /// Positioning runs of rotary axes.
    pub rotary_positioning: Vec<RotaryTest>,
    /// Displacements and temperatures over hours.
    pub drift: Drift,
    /// Stops of verifications along one axis.
    pub stops: Vec<Stops>,
    /// Touches that were used, each with the test it belongs to.
    pub touches: Vec<(TestSegment, ProbedPoint)>,
    /// Fitted shapes.
    pub features: Vec<ProbedFeature>,
    /// Block measurements.
    pub blocks: Vec<BlockMeasurement>,
    /// The last geometric model of the linear axes.
    pub geometry: Option<GeometryModel>,
    /// The last geometric model of the rotary axes.
    pub rotary: Option<GeometryModel>,
    /// The last positioning table of each axis.
    pub tables: Vec<PositioningTable>,
    /// Runs that the machine did not complete: nothing of them is evaluated.
    pub broken_off: Vec<BrokenOff>,
    /// Runs that were measured and cannot be evaluated.
    pub not_evaluated: Vec<NotEvaluated>,
    /// Under which conditions the tests ran.
    pub conditions: TestConditions,
    /// The machine file of the bag, where it can be read.
    pub machine: Option<MachineFile>,
    /// What that file leaves to defaults, as [`machine_defaults::of`] writes it.
    pub left_out: Vec<String>,
    /// What of the bag was read, lost and left out.
    pub reading: Reading,
}

/// Everything that collects while a bag is read.
#[derive(Default)]
struct Collected {
    tests: Tests,
    circles: Circles,
    stationwise: Stationwise,
    paths: Paths,
    linear: LinearRuns,
    angular: RotaryRuns,
    drifts: Drifts,
    stops: StopRuns,
    belonging: Belonging,
    strays: Strays,
    segment: Option<TestSegment>,
    outside: Outside,
    clashes: Clashes,
}

impl Tests {
    /// Reads a bag; what cannot be used is left out and counted.
    pub fn of(bag: &Bag) -> Self {
        let recorded = Self::read(bag, false);
        // Begins, ends or readings came late, or bear another clock's stamps: what was read decides. Of readings stops alone can.
        let values: fn(&Self) -> usize = if recorded.reading.are_segments_off {
            Self::values
        } else if recorded.reading.are_readings_off {
            Self::values_of_stops
        } else {
            return recorded;
        };
        let stamped = Self::read(bag, true);
        if values(&stamped) > values(&recorded) {
            stamped
        } else {
            recorded
        }
    }

    /// How many values the figures count.
    fn values(&self) -> usize {
        let circles = self.circles.iter().map(|it| it.points.len());
        let paths = self.paths.iter().map(|it| it.points.len());
        self.values_of_stops() + circles.chain(paths).sum::<usize>()
    }

    /// The same of positioning tests and diagonals.
    fn values_of_stops(&self) -> usize {
        let linear = self.linear.iter();
        let linear = linear.flat_map(|it| it.up_mm.iter().chain(&it.down_mm));
        let rotary = self.rotary_positioning.iter();
        let rotary = rotary.flat_map(|it| it.up_rad.iter().chain(&it.down_rad));
        linear.chain(rotary).map(Vec::len).sum()
    }

    fn read(bag: &Bag, are_all_by_stamp: bool) -> Self {
        let machine = machine_of_bag::of(bag);
        let unreadable = machine.as_ref().err().map(ToString::to_string);
        let machine = machine.ok().flatten().map(|(machine, text)| {
            let left_out = machine_defaults::of(&machine, &text);
            (machine, left_out)
        });
        let (machine, left_out) = machine.unzip();
        let mut collected = Collected {
            stationwise: Stationwise::new(machine.as_ref()),
            belonging: Belonging::of(has_grid(bag)),
            ..Collected::default()
        };
        collected.tests.machine = machine;
        let reading = reading::read_by_stamp(bag, &WANTED, are_all_by_stamp, |mut taken| {
            collected.message(&mut taken);
        });
        let mut tests = collected.tests;
        tests.reading = reading;
        tests.conditions.imported = Imported::of(bag);
        tests.lose_machine(bag, unreadable);
        let runs = collected.belonging.finish(&mut tests.reading.account);
        collected.outside.finish(&mut tests.reading.account);
        (tests.broken_off, tests.not_evaluated) = (runs.broken_off, runs.not_evaluated);
        tests.circles = collected.circles.recordings();
        let (circles, reasons) = collected.stationwise.circles();
        tests.station_circles = circles;
        tests.paths = collected.paths.recordings();
        tests.linear = collected.linear.tests();
        tests.rotary_positioning = collected.angular.tests();
        tests.drift = collected.drifts.drift();
        tests.drift.temperatures_left_out = temperatures_left_out(&tests.reading);
        tests.stops = collected.stops.stops();
        tests.left_out = left_out.unwrap_or_default();
        let mut all = collected.clashes.runs();
        tests.drop_runs(&all);
        all.extend(reasons);
        tests.name_not_evaluated(runs.measured, &all);
        tests
    }

    /// Takes out what was read in runs whose readings contradict each other.
    fn drop_runs(&mut self, clashing: &[(u32, String)]) {
        let is_sound = |run: u32| clashing.iter().all(|(other, _)| *other != run);
        self.circles.retain(|it| is_sound(it.segment.run));
        self.station_circles.retain(|it| is_sound(it.recording.run));
        self.paths.retain(|it| is_sound(it.segment.run));
        self.drift.logs.retain(|it| is_sound(it.run));
    }

    /// Counts a machine file that is no machine file; one that the bag itself cannot give is among its losses already.
    fn lose_machine(&mut self, bag: &Bag, unreadable: Option<String>) {
        let is_counted = |loss: &Loss| matches!(loss.reason, LossReason::Attachment { .. });
        let losses = &mut self.reading.losses;
        if let Some(what) = unreadable
            && !losses.iter().any(is_counted)
        {
            losses.push(Loss {
                file: bag.path().to_owned(),
                at_byte: 0,
                reason: LossReason::Attachment { what },
                messages_read: 0,
            });
        }
    }
}

/// Whether a bag has readings of a grid encoder.
fn has_grid(bag: &Bag) -> bool {
    let mut read = bag.topics().iter().filter(|it| it.message_count > 0);
    read.any(|it| it.topic.ends_with(topics::GRID_POSITION.name))
}

/// Readings of thermometers that are left out.
fn temperatures_left_out(reading: &Reading) -> u64 {
    let topics = reading.account.topics.iter();
    let thermometers = topics.filter(|it| topics::TEMPERATURE.member_of(&it.topic).is_some());
    let left_out = thermometers.flat_map(|it| &it.left_out);
    left_out.map(|it| it.messages).sum()
}

impl Collected {
    fn message(&mut self, taken: &mut Taken<'_>) {
        if !self.is_first_temperature(taken) {
            return;
        }
        let is_under_way = self.segment.is_some();
        self.outside.message(taken, is_under_way);
        self.tests.conditions.message(taken);
        if taken.is(&topics::AXES_STATE) {
            let is_needed = is_under_way || self.stationwise.listens();
            let state = is_needed.then(|| self.state(taken)).flatten();
            if let Some(state) = state {
                self.belonging.axes(&state, taken);
                self.circles.axes(&state);
                self.paths.axes(&state);
                self.linear.axes(&state);
                self.angular.axes(&state);
                self.drifts.axes(&state);
                self.stops.axes(&state);
                self.stationwise.axes(state);
            }
        } else if taken.is(&topics::TEST_SEGMENT) {
            let segment = taken.of(&topics::TEST_SEGMENT);
            let segment = segment.and_then(|it| self.belonging.segment(it, taken));
            segment.into_iter().for_each(|it| self.test(it));
        } else if taken.is(&topics::GRID_POSITION) && is_under_way {
            let sample = taken.of(&topics::GRID_POSITION);
            let sample = sample.filter(|it| self.belonging.grid(it, taken));
            if let Some(sample) = sample.filter(|it| self.clashes.grid(it, taken)) {
                self.circles.grid(&sample);
                self.paths.grid(&sample);
                self.stationwise.grid(sample);
            }
        } else if taken.is(&topics::LENGTH_POSITION) && is_under_way {
            let sample = taken.of(&topics::LENGTH_POSITION);
            let sample = sample.filter(|it| self.belonging.length(it, taken));
            if let Some(sample) = sample.filter(|it| self.clashes.length(it, taken)) {
                self.circles.length(&sample);
                self.linear.length(&sample);
                self.drifts.length(&sample);
            }
        } else if taken.is(&topics::ANGLE_POSITION) && is_under_way {
            let sample = taken.of(&topics::ANGLE_POSITION);
            if let Some(sample) = sample.filter(|it| self.belonging.angle(it, taken)) {
                self.angular.angle(&sample);
            }
        } else if taken.is(&topics::COMPENSATION) && is_under_way {
            if let Some(offsets) = taken.of(&topics::COMPENSATION) {
                self.belonging.hold(taken);
                self.compensation(&offsets);
            }
        } else {
            self.result(taken);
        }
    }

    /// Whether a message is no second temperature of one thermometer and stamp that differs from the first.
    fn is_first_temperature(&mut self, taken: &mut Taken<'_>) -> bool {
        if !taken.is_named(topics::TEMPERATURE.base) {
            return true;
        }
        let Some(mut sample) = taken.of_member(&topics::TEMPERATURE) else {
            return true;
        };
        if let Some(sensor) = topics::TEMPERATURE.member_of(taken.topic()) {
            sensor.clone_into(&mut sample.sensor);
        }
        self.clashes.temperature(&sample, taken)
    }

    /// An axis state; one that the machine of the machine file cannot be in is left out and counted.
    fn state(&mut self, taken: &mut Taken<'_>) -> Option<AxisState> {
        let state = taken.of(&topics::AXES_STATE)?;
        let machine = self.tests.machine.as_ref();
        let Some((reason, why)) = self.strays.why_not(machine, &state) else {
            return Some(state);
        };
        taken.leave_out(reason, || why);
        None
    }

    fn test(&mut self, segment: TestSegment) {
        if segment.begin {
            self.strays.begin();
        }
        self.tests.conditions.segment(&segment);
        self.circles.segment(&segment);
        self.paths.segment(&segment);
        self.stationwise.segment(&segment);
        self.linear.segment(&segment);
        self.angular.segment(&segment);
        self.drifts.segment(&segment);
        self.stops.segment(&segment);
        self.clashes.segment(&segment);
        self.segment = segment.begin.then_some(segment);
    }

    fn compensation(&mut self, compensation: &AxisCompensation) {
        let is_acting = acts(compensation);
        self.circles.compensation(is_acting);
        self.linear.compensation(is_acting);
        self.stops.compensation(is_acting);
    }

    fn result(&mut self, taken: &mut Taken<'_>) {
        let tests = &mut self.tests;
        if taken.is_named(topics::TEMPERATURE.base) {
            let sample = taken.of_member(&topics::TEMPERATURE);
            let sensor = topics::TEMPERATURE.member_of(taken.topic());
            if let Some((mut sample, sensor)) = sample.zip(sensor) {
                sensor.clone_into(&mut sample.sensor);
                self.drifts.temperature(&sample);
            }
        } else if taken.is_named(topics::MACHINE.base) {
            let value = taken.of_member(&topics::MACHINE);
            value.iter().for_each(|value| self.drifts.value(value));
        } else if taken.is(&topics::PROBE_POINT) {
            let point = taken.of(&topics::PROBE_POINT);
            let segment = self.segment.clone();
            tests.touches.extend(segment.zip(point));
        } else if taken.is(&topics::PROBE_FEATURE) {
            tests.features.extend(taken.of(&topics::PROBE_FEATURE));
        } else if taken.is(&topics::BLOCKS_MEASUREMENT) {
            tests.blocks.extend(taken.of(&topics::BLOCKS_MEASUREMENT));
        } else if taken.is(&topics::GEOMETRY_MODEL) {
            let model = taken.of(&topics::GEOMETRY_MODEL);
            tests.geometry = model.or(tests.geometry.take());
        } else if taken.is(&topics::GEOMETRY_ROTARY) {
            let model = taken.of(&topics::GEOMETRY_ROTARY);
            tests.rotary = model.or(tests.rotary.take());
        } else if taken.is(&topics::POSITIONING_TABLE)
            && let Some(table) = taken.of(&topics::POSITIONING_TABLE)
        {
            tests.tables.retain(|known| known.axis != table.axis);
            tests.tables.push(table);
        }
    }
}
