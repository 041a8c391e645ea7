//! The first circle of a bag that was recorded with stops, reduced to stations as the grid encoder node does.
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

/// Looks for the circle while a bag is read.
#[derive(Debug, Default)]
pub struct Stationwise {
    stage: Option<GridEncoderStage>,
    kinematics: Option<Kinematics>,
    listens: bool,
    run: Option<u32>,
    found: Option<Recording>,
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
        self.listens && self.found.is_none()
    }

    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        let is_wanted = segment.kind == TestKind::Circle && segment.stations > 0;
        if segment.begin && is_wanted && self.found.is_none() && self.run.is_none() {
            self.run = Some(segment.run);
            self.listens = true;
        }
        if self.run == Some(segment.run) {
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
        let Some(stage) = self.stage.as_mut().filter(|_| self.listens) else {
            return;
        };
        if stage.step(at, input, &mut out).is_err() {
            // States of another machine than the file's: there is nothing to compare.
            self.listens = false;
        }
        for output in out {
            match output {
                Output::Recording(recording) => self.found = Some(*recording),
                Output::Diagnostic(Diagnostic::Refused { .. }) => self.run = None,
                _ => {}
            }
        }
    }

    /// The circle, where there was one.
    #[must_use]
    pub fn circle(self) -> Option<StationCircle> {
        Some(StationCircle {
            kinematics: self.kinematics?,
            recording: self.found?,
        })
    }
}
