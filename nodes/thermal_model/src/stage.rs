//! The node's computation: events in, models, requests and diagnostics out.

use std::collections::VecDeque;
use std::convert::Infallible;

use machine::MachineFile;
use metrology::sample::{
    BlockMeasurement, TemperatureSample, TestKind, TestSegment, ThermalModel, UpdateRequest,
};
use metrology::stamp::Span;
use metrology::{Axis, Host, PerAxis, Stage, Stamp};

use crate::config::{Method, ThermalModelConfig};
use crate::cycle::{Cycle, FaceRefusal, is_useless};
use crate::diagnostic::Diagnostic;
use crate::drift_field;
use crate::error::ThermalModelError;
use crate::load::LoadWatch;
use crate::prediction::{Predictor, Record};
use crate::quarantine::Quarantine;
use crate::reference::Reference;
use crate::relaxation::Relaxation;
use crate::temperature::{Observed, Regression, Thermometers};
use crate::two_block::SlopeLimit;
use crate::update_rule::UpdateRule;

/// What the stage is told.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a few messages a second")]
pub enum Input {
    /// A block was measured.
    Block(BlockMeasurement),
    /// A temperature was read.
    Temperature(TemperatureSample),
    /// A test or production began or ended.
    Segment(TestSegment),
    /// Time went on; once a second is enough.
    Tick,
}

/// What it says.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a few messages a minute")]
pub enum Output {
    /// A model to use from now on.
    Model(ThermalModel),
    /// New block measurements are wanted.
    UpdateRequest(UpdateRequest),
    /// A condition.
    Diagnostic(Diagnostic),
}

/// The thermal model of one machine.
#[derive(Clone, Debug)]
pub struct ThermalModelStage {
    pub(crate) config: ThermalModelConfig,
    pub(crate) limits: PerAxis<SlopeLimit>,
    pub(crate) sensors: Vec<String>,
    pub(crate) reference: Reference,
    pub(crate) cycle: Option<Cycle>,
    pub(crate) segment_is_open: bool,
    pub(crate) quarantine: Quarantine,
    pub(crate) rule: UpdateRule,
    pub(crate) load: LoadWatch,
    pub(crate) load_changed_at: Option<Stamp<Host>>,
    pub(crate) thermometers: Thermometers,
    pub(crate) history: VecDeque<Observed>,
    pub(crate) record: Record,
    pub(crate) predictor: Predictor,
    pub(crate) relaxations: PerAxis<Option<Relaxation>>,
    pub(crate) regression: Option<Regression>,
    pub(crate) model: Option<ThermalModel>,
    pub(crate) axis_updated_at: PerAxis<Option<Stamp<Host>>>,
    pub(crate) sequence: u32,
    stale_reported: Vec<bool>,
    predicted_at: Option<Stamp<Host>>,
    now: Option<Stamp<Host>>,
}

impl ThermalModelStage {
    /// A stage for the blocks, axes and sensors of `machine`.
    ///
    /// # Errors
    /// When a parameter is outside its limits or the machine has not what the method needs.
    pub fn new(
        config: ThermalModelConfig,
        machine: &MachineFile,
    ) -> Result<Self, ThermalModelError> {
        config.check()?;
        check_blocks(&config, machine)?;
        let sensors: Vec<String> = machine
            .temperature_sensors
            .iter()
            .map(|s| s.id.clone())
            .collect();
        let load_sensor = sensors.iter().position(|s| *s == config.load.sensor);
        if load_sensor.is_none() && !config.load.sensor.is_empty() {
            return Err(ThermalModelError::UnknownSensor {
                key: "load.sensor",
                sensor: config.load.sensor.clone(),
                known: if sensors.is_empty() {
                    "none".to_owned()
                } else {
                    sensors.join(", ")
                },
            });
        }
        let error_mm = config.slope_error_limit_um * 1e-3;
        let mut limits = PerAxis::from_fn(|_| SlopeLimit {
            travel_mm: 0.0,
            error_mm,
        });
        for axis in Axis::LINEAR {
            let entry = machine
                .linear(axis)
                .ok_or(ThermalModelError::NoTravel { axis })?;
            limits[axis].travel_mm = entry.travel_mm[1] - entry.travel_mm[0];
        }
        let keep_s = config.temperature.window_s.max(2.0 * config.load.window_s);
        Ok(Self {
            limits,
            reference: Reference::new(&machine.blocks),
            cycle: None,
            segment_is_open: false,
            quarantine: Quarantine::new(config.physical_rate_um_per_min * 1e-3 / 60.0),
            rule: UpdateRule::new(&config),
            load: LoadWatch::new(&config.load, load_sensor),
            load_changed_at: None,
            thermometers: Thermometers::new(sensors.len(), keep_s),
            history: VecDeque::new(),
            record: Record::default(),
            predictor: Predictor::Hold,
            relaxations: PerAxis::default(),
            regression: None,
            model: None,
            axis_updated_at: PerAxis::default(),
            sequence: 0,
            stale_reported: vec![false; sensors.len()],
            predicted_at: None,
            now: None,
            sensors,
            config,
        })
    }

    /// The model in use.
    #[must_use]
    pub fn model(&self) -> Option<&ThermalModel> {
        self.model.as_ref()
    }

    /// When the drift was last measured; the cold reference counts.
    pub(crate) fn updated_at(&self) -> Option<Stamp<Host>> {
        self.history.back()?.faces.iter().map(|f| f.at).max()
    }

    /// Time never runs back inside: small disorder is ignored, a changed clock moves every instant
    /// kept, so that ages stay what they were.
    fn advance_clock(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) -> Stamp<Host> {
        let tolerance = Span::from_secs_f64(self.config.cycle.clock_tolerance_s);
        let now = match self.now {
            Some(last) if at < last && last - at <= tolerance => last,
            Some(last) if at < last => {
                let by_s = (last - at).as_secs_f64();
                out.push(Output::Diagnostic(Diagnostic::ClockWentBack { by_s }));
                self.shift(at - last, out);
                at
            }
            _ => at,
        };
        self.now = Some(now);
        now
    }

    fn shift(&mut self, by: Span, out: &mut Vec<Output>) {
        self.reference.shift(by);
        self.quarantine.shift(by);
        self.rule.shift(by);
        self.load.shift(by);
        self.thermometers.shift(by);
        for face in self.history.iter_mut().flat_map(|u| &mut u.faces) {
            face.at += by;
        }
        let instants = self.axis_updated_at.0.iter_mut().flatten();
        for at in instants
            .chain(&mut self.load_changed_at)
            .chain(&mut self.predicted_at)
        {
            *at += by;
        }
        if let Some(cycle) = &mut self.cycle {
            // Touches keep the stamps they came with; a cycle over a step of the clock is begun anew.
            cycle.closes_at += by;
            self.cycle = None;
        }
        if let Some(mut model) = self.model.take() {
            model.at += by;
            model.valid_from += by;
            model.valid_until += by;
            for drift in model.axes.0.iter_mut().flatten() {
                drift.measured_at += by;
            }
            self.publish(model, out);
        }
    }

    /// Numbers and publishes a model.
    pub(crate) fn publish(&mut self, mut model: ThermalModel, out: &mut Vec<Output>) {
        self.sequence = self.sequence.wrapping_add(1);
        model.sequence = self.sequence;
        self.model = Some(model.clone());
        out.push(Output::Model(model));
    }

    fn block(&mut self, now: Stamp<Host>, measured: &BlockMeasurement, out: &mut Vec<Output>) {
        let Some(block) = self.reference.index_of(&measured.block_id) else {
            out.push(Output::Diagnostic(Diagnostic::UnknownBlock {
                block_id: measured.block_id.clone(),
            }));
            return;
        };
        let is_other = |c: &Cycle| c.run != measured.run || c.cold != measured.cold;
        let not_after = now + Span::from_secs_f64(self.config.cycle.clock_tolerance_s);
        let n_blocks = self.reference.n_blocks();
        let closes_at = now + Span::from_secs_f64(self.config.cycle.window_s);
        let new = || Cycle::new(n_blocks, measured.run, measured.cold, closes_at);
        let not_before = self.not_before(measured.cold);
        if self.cycle.as_ref().is_none_or(is_other) && is_useless(measured, not_before, not_after) {
            let refused = new().add(block, measured, not_before, not_after);
            return refuse(measured, refused, out);
        }
        if self.cycle.as_ref().is_some_and(is_other) {
            self.close_cycle(now, out);
        }
        let not_before = self.not_before(measured.cold);
        let cycle = self.cycle.get_or_insert_with(new);
        cycle.closes_at = closes_at;
        let refused = cycle.add(block, measured, not_before, not_after);
        let is_complete = cycle.is_complete();
        refuse(measured, refused, out);
        if is_complete && !self.segment_is_open {
            self.close_cycle(now, out);
        }
    }

    /// When the faces of a measurement must have been touched at the earliest. What the reference was taken from and is
    /// told again must not replace it, with the other blocks missing.
    fn not_before(&self, is_cold: bool) -> Option<Stamp<Host>> {
        if is_cold {
            let taken_at = self.reference.taken_at();
            taken_at.map(|at| at + Span::from_nanos(1))
        } else {
            self.updated_at()
        }
    }

    fn temperature(&mut self, now: Stamp<Host>, sample: TemperatureSample, out: &mut Vec<Output>) {
        let sensor = sample.sensor;
        let Some(index) = self.sensors.iter().position(|s| *s == sensor) else {
            out.push(Output::Diagnostic(Diagnostic::UnknownSensor { sensor }));
            return;
        };
        if !sample.temperature_degc.is_finite() {
            out.push(Output::Diagnostic(Diagnostic::SensorNotFinite { sensor }));
            return;
        }
        self.thermometers.add(index, now, sample.temperature_degc);
        if std::mem::take(&mut self.stale_reported[index]) {
            out.push(Output::Diagnostic(Diagnostic::SensorBack { sensor }));
        }
    }

    fn segment(&mut self, now: Stamp<Host>, segment: &TestSegment, out: &mut Vec<Output>) {
        if let Some(change) = self.load.segment(segment) {
            self.load_changed(now, change, out);
        }
        if segment.kind != TestKind::Block {
            return;
        }
        self.segment_is_open = segment.begin;
        let late = now + Span::from_secs_f64(self.config.cycle.late_s);
        match &mut self.cycle {
            Some(cycle) if !segment.begin && cycle.is_complete() => self.close_cycle(now, out),
            Some(cycle) if !segment.begin => cycle.closes_at = late,
            _ => {}
        }
    }

    /// What was learnt about the approach to equilibrium no longer holds: stand still and ask.
    fn load_changed(
        &mut self,
        now: Stamp<Host>,
        change: crate::load::LoadChange,
        out: &mut Vec<Output>,
    ) {
        out.push(Output::Diagnostic(Diagnostic::LoadChanged { change }));
        self.rule.load_changed();
        self.load_changed_at = Some(now);
        self.relaxations = PerAxis::default();
        if self.predictor != Predictor::Relaxation {
            return;
        }
        self.predictor = Predictor::Hold;
        if let Some(mut model) = self.model.take() {
            let elapsed_s = (now - model.at).as_secs_f64();
            for axis in Axis::LINEAR {
                model.axes[axis] = model.axes[axis].map(|drift| {
                    drift_field::halted(&drift_field::advanced(axis, &drift, elapsed_s))
                });
            }
            model.at = now;
            self.publish(model, out);
        }
    }

    fn tick(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        if self.cycle.as_ref().is_some_and(|c| now >= c.closes_at) {
            self.close_cycle(now, out);
        }
        if let Some(change) = self.load.tick(now, &self.thermometers) {
            self.load_changed(now, change, out);
        }
        self.report_stale_sensors(now, out);
        let Some(updated_at) = self.updated_at() else {
            return;
        };
        if !self.segment_is_open {
            let due = self
                .rule
                .judge(now, updated_at, self.expected_drift_mm(now));
            out.extend(due.request.map(Output::UpdateRequest));
            out.extend(due.overdue_s.map(|elapsed_s| {
                Output::Diagnostic(Diagnostic::UpdateOverdue {
                    elapsed_s,
                    period_s: self.config.update_period_min * 60.0,
                })
            }));
        }
        let period = Span::from_secs_f64(self.config.temperature.publish_period_s);
        let is_time = self.predicted_at.is_none_or(|at| now - at >= period);
        if self.predictor == Predictor::Temperature && is_time {
            self.predicted_at = Some(now);
            self.publish_by_temperature(now, out);
        }
    }

    fn report_stale_sensors(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        for sensor in 0..self.sensors.len() {
            let Some(age_s) = self.thermometers.age_s(sensor, now) else {
                continue;
            };
            if age_s > self.config.temperature.stale_s && !self.stale_reported[sensor] {
                self.stale_reported[sensor] = true;
                out.push(Output::Diagnostic(Diagnostic::SensorStale {
                    sensor: self.sensors[sensor].clone(),
                    age_s,
                }));
            }
        }
    }
}

fn check_blocks(
    config: &ThermalModelConfig,
    machine: &MachineFile,
) -> Result<(), ThermalModelError> {
    let n_blocks = machine.blocks.len();
    let most = match config.method {
        Method::TwoBlock => 2,
        Method::NBlock => 1000,
    };
    if n_blocks < 2 || n_blocks > most {
        return Err(ThermalModelError::BlockCount {
            n_blocks,
            least: 2,
            most,
        });
    }
    for (index, block) in machine.blocks.iter().enumerate() {
        if machine.blocks[..index].iter().any(|b| b.id == block.id) {
            return Err(ThermalModelError::DuplicateBlock {
                block_id: block.id.clone(),
            });
        }
    }
    Ok(())
}

impl Stage for ThermalModelStage {
    type Input = Input;
    type Output = Output;
    /// Every input has an answer: what cannot be used is reported as a diagnostic.
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        let now = self.advance_clock(at, out);
        match input {
            Input::Block(measured) => self.block(now, &measured, out),
            Input::Temperature(sample) => self.temperature(now, sample, out),
            Input::Segment(segment) => self.segment(now, &segment, out),
            Input::Tick => self.tick(now, out),
        }
        Ok(())
    }
}

fn refuse(measured: &BlockMeasurement, refused: Vec<(Axis, FaceRefusal)>, out: &mut Vec<Output>) {
    out.extend(refused.into_iter().map(|(axis, reason)| {
        Output::Diagnostic(Diagnostic::FaceRefused {
            block_id: measured.block_id.clone(),
            axis,
            reason,
        })
    }));
}
