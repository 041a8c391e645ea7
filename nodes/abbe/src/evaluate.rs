//! What tests a bag holds, as the evaluations of ISO 230 take them.
//!
//! A bag is read once, in the order of time; what is kept is no more than the readings of its tests.

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Wire, from_cdr};
use anyhow::Result;
use machine::MachineFile;
use metrology::sample::{
    AxisCompensation, BlockMeasurement, GeometryModel, PositioningTable, ProbedFeature,
    ProbedPoint, TestSegment,
};
use recorder::{Bag, Event, Loss, Order};

pub mod budget;
pub mod circles;
pub mod limits;
pub mod linear;
pub mod stationwise;
pub mod stops;

use circles::{CircleRecording, Circles};
use linear::{LinearRuns, LinearTest};
use stationwise::{StationCircle, Stationwise};
use stops::{StopRuns, Stops};

/// Offsets below this are none, mm.
const NOTHING_MM: f64 = 1e-7;

/// The tests of a bag, and what was computed from them while it was recorded.
#[derive(Debug, Default)]
pub struct Tests {
    /// Circles over a grid encoder, or with a ballbar.
    pub circles: Vec<CircleRecording>,
    /// The first circle with stops, for the published separation.
    pub station_circle: Option<StationCircle>,
    /// Positioning runs and diagonals.
    pub linear: Vec<LinearTest>,
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
    /// What of the bag could not be read.
    pub losses: Vec<Loss>,
}

/// Everything that collects while a bag is read.
#[derive(Default)]
struct Collected {
    tests: Tests,
    circles: Circles,
    stationwise: Stationwise,
    linear: LinearRuns,
    stops: StopRuns,
    segment: Option<TestSegment>,
}

impl Tests {
    /// Reads a bag.
    ///
    /// # Errors
    /// When a message of a known topic cannot be decoded.
    pub fn of(bag: &Bag) -> Result<Self> {
        let machine = machine_file(bag);
        let mut collected = Collected {
            stationwise: Stationwise::new(machine.as_ref()),
            ..Collected::default()
        };
        let mut messages = bag.messages(Order::LogTime);
        let names: Vec<String> = bag
            .topics()
            .iter()
            .map(|info| info.topic.trim_start_matches('/').to_owned())
            .collect();
        while let Some(event) = messages.next_event() {
            match event {
                Event::Message(message) => {
                    let name = names.get(message.topic.index()).map_or("", String::as_str);
                    collected.message(name, message.data)?;
                }
                Event::Loss(loss) => collected.tests.losses.push(loss),
            }
        }
        let mut tests = collected.tests;
        tests.circles = collected.circles.recordings();
        tests.station_circle = collected.stationwise.circle();
        tests.linear = collected.linear.tests();
        tests.stops = collected.stops.stops();
        Ok(tests)
    }
}

/// The machine file that a bag holds, where it can be read.
fn machine_file(bag: &Bag) -> Option<MachineFile> {
    let attached = bag.attachment("machine.yaml").ok().flatten()?;
    let text = String::from_utf8(attached.data).ok()?;
    MachineFile::parse(&text, "machine.yaml of the bag").ok()
}

/// Whether `name` is `topic`, in whatever namespace.
fn is<M: Message>(name: &str, topic: &Topic<M>) -> bool {
    name.strip_suffix(topic.name)
        .is_some_and(|space| space.is_empty() || space.ends_with('/'))
}

fn read<M: Message + Wire>(_: &Topic<M>, bytes: &[u8]) -> Result<M::Inner> {
    Ok(from_cdr::<M>(bytes)?.into_inner()?)
}

impl Collected {
    fn message(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        if is(name, &topics::AXES_STATE) {
            if self.segment.is_some() || self.stationwise.listens() {
                let state = read(&topics::AXES_STATE, bytes)?;
                self.circles.axes(&state);
                self.linear.axes(&state);
                self.stops.axes(&state);
                self.stationwise.axes(state);
            }
        } else if is(name, &topics::GRID_POSITION) {
            if self.segment.is_some() {
                let sample = read(&topics::GRID_POSITION, bytes)?;
                self.circles.grid(&sample);
                self.stationwise.grid(sample);
            }
        } else if is(name, &topics::LENGTH_POSITION) {
            if self.segment.is_some() {
                let sample = read(&topics::LENGTH_POSITION, bytes)?;
                self.circles.length(&sample);
                self.linear.length(&sample);
            }
        } else if is(name, &topics::COMPENSATION) {
            if self.segment.is_some() {
                self.compensation(&read(&topics::COMPENSATION, bytes)?);
            }
        } else if is(name, &topics::TEST_SEGMENT) {
            self.test(read(&topics::TEST_SEGMENT, bytes)?);
        } else {
            self.result(name, bytes)?;
        }
        Ok(())
    }

    fn test(&mut self, segment: TestSegment) {
        self.circles.segment(&segment);
        self.stationwise.segment(&segment);
        self.linear.segment(&segment);
        self.stops.segment(&segment);
        self.segment = segment.begin.then_some(segment);
    }

    fn compensation(&mut self, compensation: &AxisCompensation) {
        let acts = compensation
            .total
            .0
            .iter()
            .any(|offset| offset.abs() > NOTHING_MM);
        self.circles.compensation(acts);
        self.linear.compensation(acts);
        self.stops.compensation(acts);
    }

    fn result(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let tests = &mut self.tests;
        if is(name, &topics::PROBE_POINT) {
            let point = read(&topics::PROBE_POINT, bytes)?;
            let segment = self.segment.clone();
            tests
                .touches
                .extend(segment.map(|segment| (segment, point)));
        } else if is(name, &topics::PROBE_FEATURE) {
            tests.features.push(read(&topics::PROBE_FEATURE, bytes)?);
        } else if is(name, &topics::BLOCKS_MEASUREMENT) {
            tests.blocks.push(read(&topics::BLOCKS_MEASUREMENT, bytes)?);
        } else if is(name, &topics::GEOMETRY_MODEL) {
            tests.geometry = Some(read(&topics::GEOMETRY_MODEL, bytes)?);
        } else if is(name, &topics::GEOMETRY_ROTARY) {
            tests.rotary = Some(read(&topics::GEOMETRY_ROTARY, bytes)?);
        } else if is(name, &topics::POSITIONING_TABLE) {
            let table = read(&topics::POSITIONING_TABLE, bytes)?;
            tests.tables.retain(|known| known.axis != table.axis);
            tests.tables.push(table);
        }
        Ok(())
    }
}
