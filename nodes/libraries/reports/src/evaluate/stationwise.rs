//! The circles of a bag that were recorded with stops, reduced to stations as the grid encoder node does.
//!
//! It is what the published separation works on, and the machine file in the bag says of which chain.

use grid_encoder::diagnostic::Diagnostic;
use grid_encoder::recording::Recording;
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::{Kinematics, MachineFile};
use metrology::Stage;
use metrology::sample::{AxisState, GridSample, TestKind, TestSegment};
use metrology::stamp::{Host, NANOS_PER_S, Span, Stamp};

/// A circle by its stations, and the machine that ran it.
#[derive(Debug)]
pub struct StationCircle {
    /// Chain of the machine file.
    pub kinematics: Kinematics,
    /// Its stations.
    pub recording: Recording,
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
                None => self.awaited.push(segment.run),
                Some(why) => self.refused.push((segment.run, why.to_owned())),
            }
        }
        if self.awaited.contains(&segment.run) {
            self.step(segment.at, Input::Segment(segment.clone()));
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: AxisState) {
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
        let of_recording = |recording| StationCircle {
            kinematics: kinematics.clone(),
            recording,
        };
        let found = self.found.into_iter().map(of_recording).collect();
        (found, self.refused)
    }
}

#[cfg(test)]
mod tests {
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
}
