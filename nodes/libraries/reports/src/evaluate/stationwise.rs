//! The circles of a bag that were recorded with stops, reduced to stations as the grid encoder node does.
//!
//! It is what the published separation works on, and the machine file in the bag says of which chain.

use grid_encoder::diagnostic::Diagnostic;
use grid_encoder::recording::Recording;
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::{Kinematics, MachineFile};
use metrology::Stage;
use metrology::sample::{AxisState, GridSample, TestKind, TestSegment};
use metrology::stamp::{Host, Stamp};

/// A circle by its stations, and the machine that ran it.
#[derive(Debug)]
pub struct StationCircle {
    /// Chain of the machine file.
    pub kinematics: Kinematics,
    /// Its stations.
    pub recording: Recording,
}

/// Looks for the circles while a bag is read.
#[derive(Debug, Default)]
pub struct Stationwise {
    stage: Option<GridEncoderStage>,
    kinematics: Option<Kinematics>,
    /// Runs that are under way or not reduced yet.
    awaited: Vec<u32>,
    found: Vec<Recording>,
}

impl Stationwise {
    /// For the machine of a bag; finds nothing where it has no plate or no chain that can be read.
    #[must_use]
    pub fn new(machine: Option<&MachineFile>) -> Self {
        let stage = |file| GridEncoderStage::new(&GridEncoderConfig::default(), file).ok();
        Self {
            stage: machine.and_then(stage),
            kinematics: machine.and_then(|file| Kinematics::new(file).ok()),
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
        if segment.begin && is_wanted && self.stage.is_some() {
            self.awaited.push(segment.run);
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
        let Some(stage) = self.stage.as_mut().filter(|_| is_needed) else {
            return;
        };
        if stage.step(at, input, &mut out).is_err() {
            // States of another machine than the file's: there is nothing to compare.
            self.stage = None;
            self.awaited.clear();
        }
        for output in out {
            match output {
                Output::Recording(recording) => {
                    self.awaited.retain(|run| *run != recording.run);
                    self.found.push(*recording);
                }
                Output::Diagnostic(Diagnostic::Refused { run, .. }) => {
                    self.awaited.retain(|awaited| *awaited != run);
                }
                _ => {}
            }
        }
    }

    /// The circles, in the order of their runs.
    #[must_use]
    pub fn circles(self) -> Vec<StationCircle> {
        let Some(kinematics) = self.kinematics else {
            return Vec::new();
        };
        let of_recording = |recording| StationCircle {
            kinematics: kinematics.clone(),
            recording,
        };
        self.found.into_iter().map(of_recording).collect()
    }
}
