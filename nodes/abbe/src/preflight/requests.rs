//! The block cycles that the thermal model of a scenario asks for during production.
//!
//! The stage is that of the run, with its parameters; what it is given is foreseen: blocks that stand still, so that no
//! drift is predicted and no jump has to be confirmed, and the temperatures of [`super::warming`]. Left are the requests
//! of its period and of pauses of production. Those of drift and of a thermometer's slope depend on the real machine's
//! heat, which nobody knows before: a run can have more cycles than are foreseen.

use anyhow::{Context, Result};
use machine::MachineFile;
use metrology::sample::{
    BlockMeasurement, FacePosition, LatencyShare, TemperatureSample, TestKind, TestSegment,
    UpdateRequest,
};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, PerAxis, Stage};
use thermal_model::{Input, Output, ThermalModelConfig, ThermalModelStage};

/// Time between two looks at the update rule, as the node has it.
const LOOK: Span = Span::from_nanos(1_000_000_000);
/// Uncertainty of a face where the machine file states no repeatability, mm.
const FACE_MM: f64 = 1e-3;

/// The thermal model of a scenario, at a rehearsal.
pub struct Requests {
    stage: ThermalModelStage,
    machine: MachineFile,
    look_at: Stamp<Host>,
    touched_at: Option<Stamp<Host>>,
    out: Vec<Output>,
}

impl Requests {
    /// For a scenario's parameters.
    ///
    /// # Errors
    /// When the model cannot be made for this machine.
    pub fn new(config: &ThermalModelConfig, machine: &MachineFile) -> Result<Self> {
        let mut config = config.clone();
        // The slopes of assumed temperatures say nothing of the real spindle's.
        config.load.sensor.clear();
        let stage = ThermalModelStage::new(config, machine).context("thermal_model")?;
        Ok(Self {
            stage,
            machine: machine.clone(),
            look_at: Stamp::from_nanos(0),
            touched_at: None,
            out: Vec::new(),
        })
    }

    /// A touch was made.
    pub const fn touched(&mut self, now: Stamp<Host>) {
        self.touched_at = Some(now);
    }

    /// A temperature was read.
    pub fn temperature(&mut self, now: Stamp<Host>, sample: TemperatureSample) {
        self.step(now, Input::Temperature(sample));
    }

    /// A test began or ended; the end of a block cycle brings what a machine without drift would measure.
    pub fn segment(&mut self, now: Stamp<Host>, segment: &TestSegment) {
        let is_measured = segment.kind == TestKind::Block && !segment.begin && segment.completed;
        self.step(now, Input::Segment(segment.clone()));
        if !is_measured {
            return;
        }
        for block in self.measured(now, segment) {
            self.step(now, Input::Block(block));
        }
    }

    /// Time passes: what is asked for.
    pub fn tick(&mut self, now: Stamp<Host>) -> Option<UpdateRequest> {
        if now >= self.look_at {
            self.look_at = now + LOOK;
            self.step(now, Input::Tick);
        }
        let mut requests = self.out.drain(..).filter_map(|output| match output {
            Output::UpdateRequest(request) => Some(request),
            _ => None,
        });
        requests.next_back()
    }

    fn step(&mut self, now: Stamp<Host>, input: Input) {
        let Ok(()) = self.stage.step(now, input, &mut self.out);
    }

    /// The blocks of a cycle where the machine file has them.
    fn measured(&self, now: Stamp<Host>, segment: &TestSegment) -> Vec<BlockMeasurement> {
        let at = self.touched_at.unwrap_or(now);
        let repeatability_mm = self.machine.probe.repeatability_um / 1e3;
        let uncertainty_mm = if repeatability_mm > 0.0 {
            repeatability_mm
        } else {
            FACE_MM
        };
        let blocks = self.machine.blocks.iter();
        let touched = blocks.filter(|block| segment.features.contains(&block.id));
        let measured = touched.map(|block| {
            let mut faces = PerAxis::default();
            for (axis, position_mm) in Axis::LINEAR.into_iter().zip(block.corner_mm) {
                faces[axis] = Some(FacePosition {
                    position_mm,
                    standard_uncertainty_mm: uncertainty_mm,
                    at,
                    latency: LatencyShare::default(),
                });
            }
            BlockMeasurement {
                at,
                block_id: block.id.clone(),
                faces,
                cold: segment.cold,
                run: segment.run,
            }
        });
        measured.collect()
    }
}
