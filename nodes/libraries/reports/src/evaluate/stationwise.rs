//! The circles of a bag that were recorded with stops, reduced to stations as the grid encoder node does.
//!
//! It is what the published separation works on, and the machine file in the bag says of which chain.

use std::collections::BTreeMap;

use grid_encoder::diagnostic::Diagnostic;
use grid_encoder::recording::{Fixture, Place, Recording};
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::{Kinematics, MachineFile};
use metrology::Stage;
use metrology::sample::{AxisState, GridSample, TestKind, TestSegment};
use metrology::stamp::{Host, NANOS_PER_S, Span, Stamp};
use nalgebra::Vector3;

/// A circle by its stations, and the machine that ran it.
#[derive(Debug)]
pub struct StationCircle {
    /// Chain of the machine file.
    pub kinematics: Kinematics,
    /// Its stations.
    pub recording: Recording,
    /// Those of the same circle in the other sense, where it was run.
    pub other_sense: Option<Recording>,
    /// The longest rest between the first and the last one; none: nothing rested.
    pub longest_rest: Option<Span>,
}

/// Commands closer than this are one place, mm.
const SAME_MM: f64 = 1e-6;

/// Rests of the command in the run that is under way: where, since when and until when.
#[derive(Debug, Default)]
struct Rests(Vec<(Vector3<f64>, Stamp<Host>, Stamp<Host>)>);

impl Rests {
    fn axes(&mut self, state: &AxisState) {
        let (place_mm, at) = (state.commanded.xyz(), state.received_at);
        match self.0.last_mut() {
            Some((known_mm, _, until)) if (*known_mm - place_mm).amax() < SAME_MM => *until = at,
            // A place of one state was passed.
            Some(last) if last.1 == last.2 => *last = (place_mm, at, at),
            _ => self.0.push((place_mm, at, at)),
        }
    }

    /// Before the first way and behind the last one the machine may stand for any time.
    fn longest(&self) -> Option<Span> {
        let rests = self.0.iter().map(|(_, since, until)| *until - *since);
        let rests: Vec<Span> = rests.filter(|rest| *rest > Span::default()).collect();
        let within = rests.len().saturating_sub(1);
        rests.get(1..within)?.iter().max().copied()
    }
}

/// Why stops of a circle give no stations.
const NO_MACHINE: &str = "the bag has no machine file, which would state the chain and the plate: evaluate the bag as it was recorded, with its attachments";
const NO_PLATE: &str = "the machine file has no grid_encoder, or a chain that cannot be used";
const OTHER_AXES: &str = "the axis states lack an axis of the machine file";

/// How long after its end a run is waited for, s.
const LONGEST_WAIT_S: i64 = 3_600;

/// Looks for the circles while a bag is read.
#[derive(Debug, Default)]
pub struct Stationwise {
    stage: Option<GridEncoderStage>,
    kinematics: Option<Kinematics>,
    /// Runs that are under way or not reduced yet.
    awaited: Vec<u32>,
    /// Runs that give no stations, with the reasons.
    refused: Vec<(u32, String)>,
    /// Why no run can be reduced.
    lacks: Option<&'static str>,
    /// The latest stamp.
    newest: Stamp<Host>,
    found: Vec<Recording>,
    /// Of the run that is under way.
    rests: Option<Rests>,
    longest_rests: BTreeMap<u32, Span>,
}

impl Stationwise {
    /// For the machine of a bag; finds nothing where it has no plate or no chain that can be read.
    #[must_use]
    pub fn new(machine: Option<&MachineFile>) -> Self {
        let stage = |file| GridEncoderStage::new(&GridEncoderConfig::default(), file).ok();
        let stage = machine.and_then(stage);
        let lacks = match (machine, &stage) {
            (_, Some(_)) => None,
            (Some(_), None) => Some(NO_PLATE),
            (None, None) => Some(NO_MACHINE),
        };
        Self {
            stage,
            kinematics: machine.and_then(|file| Kinematics::new(file).ok()),
            lacks,
            ..Self::default()
        }
    }

    /// Whether it still looks at readings.
    #[must_use]
    pub fn listens(&self) -> bool {
        !self.awaited.is_empty()
    }

    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        let is_wanted = segment.kind == TestKind::Circle && segment.stations > 0;
        if segment.begin && is_wanted {
            match self.lacks {
                None => {
                    self.awaited.push(segment.run);
                    self.rests = Some(Rests::default());
                }
                Some(why) => self.refused.push((segment.run, why.to_owned())),
            }
        } else if let Some(rests) = self.rests.take() {
            let longest = rests.longest().map(|rest| (segment.run, rest));
            self.longest_rests.extend(longest);
        }
        if self.awaited.contains(&segment.run) {
            self.step(segment.at, Input::Segment(segment.clone()));
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: AxisState) {
        if let Some(rests) = &mut self.rests {
            rests.axes(&state);
        }
        self.step(state.received_at, Input::State(state));
    }

    /// One reading.
    pub fn grid(&mut self, sample: GridSample) {
        self.step(sample.at, Input::Reading(sample));
    }

    fn step(&mut self, at: Stamp<Host>, input: Input) {
        let mut out = Vec::new();
        let is_needed = !self.awaited.is_empty();
        self.newest = self.newest.max(at);
        let Some(stage) = self.stage.as_mut().filter(|_| is_needed) else {
            return;
        };
        if stage.step(at, input, &mut out).is_err() {
            // States of another machine than the file's: there is nothing to compare.
            self.stage = None;
            self.lacks = Some(OTHER_AXES);
            let refused = self.awaited.drain(..);
            self.refused
                .extend(refused.map(|run| (run, OTHER_AXES.to_owned())));
        }
        for output in out {
            match output {
                Output::Recording(recording) => {
                    self.awaited.retain(|run| *run != recording.run);
                    self.found.push(*recording);
                }
                Output::Diagnostic(Diagnostic::Refused { run, refusal }) => {
                    self.awaited.retain(|awaited| *awaited != run);
                    self.refused.push((run, refusal.to_string()));
                }
                _ => {}
            }
        }
    }

    /// The circles, in the order of their runs; and the runs that give none, with the reasons.
    #[must_use]
    pub fn circles(mut self) -> (Vec<StationCircle>, Vec<(u32, String)>) {
        // The recording may end with the last run.
        let end = self.newest + Span::from_nanos(LONGEST_WAIT_S * NANOS_PER_S);
        self.step(end, Input::Tick);
        let Some(kinematics) = self.kinematics else {
            return (Vec::new(), self.refused);
        };
        let of_recording = |recording: &Recording| StationCircle {
            kinematics: kinematics.clone(),
            longest_rest: self.longest_rests.get(&recording.run).copied(),
            other_sense: { self.found.iter() }
                .find(|other| is_in_the_other_sense(&recording.place, &other.place))
                .cloned(),
            recording: recording.clone(),
        };
        let found = self.found.iter().map(of_recording).collect();
        (found, self.refused)
    }
}

/// Whether both are one circle under one set-up, in different senses.
fn is_in_the_other_sense(place: &Place, other: &Place) -> bool {
    let fixture = Fixture {
        zero_id: other.fixture.zero_id,
        ..place.fixture
    };
    let turned = Place {
        sense: other.sense,
        fixture,
        ..*place
    };
    place.sense != other.sense && turned == *other
}

#[cfg(test)]
mod tests {
    use metrology::{AxisSet, PerAxis};

    use super::*;

    fn circle(begin: bool) -> TestSegment {
        TestSegment {
            begin,
            stations: 72,
            radius_mm: 50.0,
            plane: metrology::sample::TestPlane::Xy,
            ..TestSegment::of_kind(TestKind::Circle, 3, Stamp::from_nanos(1))
        }
    }

    #[test]
    fn a_circle_that_gives_no_stations_is_named_with_the_reason() {
        let text = include_str!("../../../../../launch_configs/gap_first/machine.yaml");
        let machine = MachineFile::parse(text, "m").unwrap();
        assert!(machine.grid_encoder.is_some());
        let mut bare = machine.clone();
        bare.grid_encoder = None;
        for (machine, words) in [
            (None, "the bag has no machine file"),
            (Some(&bare), "the machine file has no grid_encoder"),
            // The recording ends with the run.
            (Some(&machine), "no readings"),
        ] {
            let mut stations = Stationwise::new(machine);
            stations.segment(&circle(true));
            stations.segment(&circle(false));
            let (found, refused) = stations.circles();
            assert!(found.is_empty());
            let reasons: Vec<&str> = refused.iter().map(|(_, why)| why.as_str()).collect();
            assert!(refused.iter().all(|(run, _)| *run == 3), "{refused:?}");
            assert!(reasons.join("; ").contains(words), "{refused:?}");
        }
    }

    #[test]
    fn the_rest_at_a_station_is_that_of_the_program() {
        let mut rests = Rests::default();
        let mut now_ms: i64 = 0;
        let mut at = |x_mm: f64, rest_ms: i64| {
            for _ in 0..=rest_ms / 20 {
                let mut commanded = PerAxis::default();
                commanded[metrology::Axis::X] = x_mm;
                let stamp = Stamp::from_nanos(now_ms * 1_000_000);
                let controller = Stamp::from_nanos(now_ms * 1_000_000);
                rests.axes(&AxisState::standing(
                    stamp,
                    controller,
                    AxisSet::XYZ,
                    commanded,
                ));
                now_ms += 20;
            }
        };
        // Ten seconds before the circle, a second at each station, and on the way one state at a place.
        at(-1.0, 10_000);
        for station in 1..=5 {
            at(f64::from(station) - 0.5, 0);
            at(f64::from(station), 1000);
        }
        at(6.0, 30_000);
        assert_eq!(rests.longest(), Some(Span::from_nanos(1_000_000_000)));
        assert_eq!(Rests::default().longest(), None);
    }
}
