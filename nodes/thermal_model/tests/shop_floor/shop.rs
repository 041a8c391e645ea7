//! A machine whose readings drift as a test says, its blocks, and a probe that touches them.

use machine::MachineFile;
use metrology::sample::{
    BlockMeasurement, FacePosition, LatencyShare, TemperatureSample, ThermalModel, UpdateRequest,
};
use metrology::stamp::Span;
use metrology::{Axis, Host, PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use thermal_model::{Diagnostic, Input, Output, ThermalModelConfig, ThermalModelStage};

pub const U_MM: f64 = 3e-4;

pub fn machine() -> MachineFile {
    serde_saphyr::from_str(include_str!(
        "../../../../launch_configs/first_run/machine.yaml"
    ))
    .unwrap()
}

pub fn config(extra: &str) -> ThermalModelConfig {
    serde_saphyr::from_str(&format!(
        "{{method: two_block, update_period_min: 15.0, validity_min: 40.0, slope_error_limit_um: 3.0, \
         physical_rate_um_per_min: 3.0, drift_limit_um: 500.0{extra}}}"
    ))
    .unwrap()
}

pub struct Shop {
    pub stage: ThermalModelStage,
    pub machine: MachineFile,
    pub nanos: i64,
    pub run: u32,
    pub models: Vec<ThermalModel>,
    pub requests: Vec<UpdateRequest>,
    pub diagnostics: Vec<Diagnostic>,
}

impl Shop {
    pub fn new(config: ThermalModelConfig) -> Self {
        Self::on(config, machine())
    }

    pub fn on(config: ThermalModelConfig, machine: MachineFile) -> Self {
        Self {
            stage: ThermalModelStage::new(config, &machine).unwrap(),
            machine,
            nanos: 0,
            run: 0,
            models: Vec::new(),
            requests: Vec::new(),
            diagnostics: Vec::new(),
        }
    }

    pub fn now(&self) -> Stamp<Host> {
        Stamp::from_nanos(self.nanos)
    }

    pub fn wait_s(&mut self, seconds: f64) {
        self.nanos += Span::from_secs_f64(seconds).nanos();
    }

    pub fn step(&mut self, input: Input) {
        let mut out = Vec::new();
        self.stage.step(self.now(), input, &mut out).unwrap();
        for output in out {
            match output {
                Output::Model(m) => self.models.push(m),
                Output::UpdateRequest(r) => self.requests.push(r),
                Output::Diagnostic(d) => self.diagnostics.push(d),
            }
        }
    }

    pub fn tick(&mut self) {
        self.step(Input::Tick);
    }

    /// What the probe finds: `reading(axis, cold position)` per face of one block.
    pub fn measurement(
        &self,
        block: usize,
        cold: bool,
        mut reading: impl FnMut(Axis, Vector3<f64>) -> f64,
    ) -> BlockMeasurement {
        let entry = &self.machine.blocks[block];
        let mut faces = PerAxis::default();
        for axis in Axis::LINEAR {
            faces[axis] = Some(FacePosition {
                position_mm: reading(axis, Vector3::from(entry.corner_mm)),
                standard_uncertainty_mm: U_MM,
                at: self.now(),
                latency: LatencyShare::default(),
            });
        }
        BlockMeasurement {
            at: self.now(),
            block_id: entry.id.clone(),
            faces,
            cold,
            run: self.run,
        }
    }

    /// A whole cycle, all faces at one instant.
    pub fn cycle(&mut self, cold: bool, mut reading: impl FnMut(Axis, Vector3<f64>) -> f64) {
        self.run += 1;
        for block in 0..self.machine.blocks.len() {
            let measured = self.measurement(block, cold, &mut reading);
            self.step(Input::Block(measured));
        }
    }

    pub fn cold(&mut self) {
        self.cycle(true, |axis, corner| corner[axis.index()]);
    }

    pub fn temperature(&mut self, sensor: &str, temperature_degc: f64) {
        self.step(Input::Temperature(TemperatureSample {
            at: self.now(),
            sensor: sensor.to_owned(),
            temperature_degc,
            variance_k2: 0.0,
        }));
    }

    pub fn model(&self) -> &ThermalModel {
        self.models.last().unwrap()
    }
}
