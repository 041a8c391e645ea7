//! The node's computation: axis states and models in, offsets and diagnostics out.

use std::convert::Infallible;

use machine::MachineFile;
use metrology::drift::DriftRefusal;
use metrology::sample::{
    AxisCompensation, AxisState, GeometryModel, PositioningTable, TestSegment, ThermalModel,
};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, Host, Machine, PerAxis, Stage, Stamp, check_between};
use nalgebra::Vector3;

use crate::axis_state::{AxisState as Compensated, LetGo, Wanted};
use crate::config::AxisCompensationConfig;
use crate::diagnostic::Diagnostic;
use crate::error::AxisCompensationError;
use crate::geometric::{Geometric, GeometrySource};
use crate::limiter::Limits;
use crate::model_gate::{GateLimits, ModelGate};
use crate::parts::{PartRefusal, Parts};
use crate::positioning::dual_loop::DualLoop;
use crate::pulses::PulseTrain;
use crate::span_watch::SpanWatch;

mod dual;
mod geometry;
mod remarks;

/// What the stage is told.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "a box would allocate at every servo tick"
)]
pub enum Input {
    /// One servo tick's positions.
    State(AxisState),
    /// A new thermal model.
    Model(Box<ThermalModel>),
    /// A new geometry model.
    Geometry(GeometrySource, Box<GeometryModel>),
    /// A test begins or ends.
    Segment(Box<TestSegment>),
    /// Compensation on or off.
    Enable(bool),
    /// The node may act, or is to come to rest and say when it has.
    Active(bool),
    /// Fade to zero and say when it is done.
    Shutdown,
    /// Time went on.
    Tick,
}

/// What it says.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "a box would allocate at every servo tick"
)]
pub enum Output {
    /// Offsets to add to the commands.
    Compensation(AxisCompensation),
    /// A condition.
    Diagnostic(Diagnostic),
    /// A positioning table that was learned or refreshed.
    Table(Box<PositioningTable>),
    /// After [`Input::Active`] with false: nothing is added any more, and nothing is published until it may act again.
    AtRest,
    /// After [`Input::Shutdown`]: nothing is added any more, the node may stop.
    FadedOut,
}

/// The compensation of one machine.
#[derive(Clone, Debug)]
pub struct AxisCompensationStage {
    axes: AxisSet,
    states: PerAxis<Option<Compensated>>,
    trains: PerAxis<PulseTrain>,
    positioning: PerAxis<Option<DualLoop>>,
    geometric: Option<Geometric>,
    refused: PerAxis<Option<PartRefusal>>,
    gate: ModelGate,
    spans: PerAxis<SpanWatch>,
    servo_period_s: f64,
    gap: Span,
    enabled: bool,
    activity: Activity,
    shutdown: Shutdown,
    controller_at: Option<Stamp<Machine>>,
    heard_at: Option<Stamp<Host>>,
    driven_at: Option<Stamp<Host>>,
    is_stale: bool,
    model_in_doubt: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Activity {
    Active,
    /// Fading to rest.
    Ending,
    Inactive,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shutdown {
    No,
    Fading,
    Done,
}

/// Drifts of X, Y and Z where they stand, mm.
type Drifts = [Result<f64, DriftRefusal>; 3];

/// How long the offsets acted since the last tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Elapsed {
    /// Nothing to go by, or no time at all: they stay.
    Nothing,
    /// This long, s.
    Step(f64),
    /// Too long to call it one tick: they stood.
    Gap,
}

impl AxisCompensationStage {
    /// A stage for `machine`, at rest at zero, that may act at once.
    ///
    /// # Errors
    /// When a parameter is outside its limits or an axis is no linear axis of the machine.
    pub fn new(
        config: &AxisCompensationConfig,
        machine: &MachineFile,
    ) -> Result<Self, AxisCompensationError> {
        config.check(machine)?;
        let pulse_um = positive(
            "control.pulse_equivalent_um",
            machine.control.pulse_equivalent_um,
        )?;
        let pulse_mm = pulse_um * 1e-3;
        let train =
            PulseTrain::new(pulse_mm).expect("a pulse from 1e-6 to 1e6 µm was just checked");
        let servo_period_s =
            positive("control.servo_period_ms", machine.control.servo_period_ms)? * 1e-3;
        let let_go = LetGo {
            hold_s: config.hold_s,
            fade_s: config.fade_s,
            shutdown_fade_s: config.shutdown_fade_s,
        };
        let states = PerAxis::from_fn(|axis| {
            config.axes.get(&axis).map(|limits| {
                let limits = Limits {
                    size: limits.size_limit_um * 1e-3,
                    rate: limits.rate_limit_um_per_s * 1e-3,
                    acceleration: limits.acceleration_limit_um_per_s2 * 1e-3,
                };
                Compensated::new(limits, let_go, pulse_mm)
            })
        });
        let mut positioning = PerAxis::<Option<DualLoop>>::default();
        for (&axis, own) in &config.positioning {
            positioning[axis] = Some(DualLoop::new(axis, own, machine, train.pulse_fm())?);
        }
        let geometric = config
            .geometry
            .as_ref()
            .map(|own| Geometric::new(own, machine, config.extrapolate));
        Ok(Self {
            axes: config.axes.keys().copied().collect(),
            states,
            refused: PerAxis::default(),
            gate: ModelGate::new(gate_limits(config, machine)),
            spans: PerAxis::default(),
            trains: PerAxis::from_fn(|_| train),
            positioning,
            geometric: geometric.transpose()?,
            servo_period_s,
            gap: Span::from_secs_f64(config.gap_s),
            enabled: config.enabled,
            activity: Activity::Active,
            shutdown: Shutdown::No,
            controller_at: None,
            heard_at: None,
            driven_at: None,
            is_stale: false,
            model_in_doubt: false,
        })
    }

    /// The same, but it acts only once [`Input::Active`] says so.
    #[must_use]
    pub fn inactive(mut self) -> Self {
        self.activity = Activity::Inactive;
        self
    }

    fn state(&mut self, at: Stamp<Host>, state: &AxisState, out: &mut Vec<Output>) {
        let elapsed = self.elapsed(at, state.controller_at, out);
        self.controller_at = Some(state.controller_at);
        self.heard_at = Some(at);
        self.is_stale = false;
        let commanded_mm = Vector3::from_fn(|row, _| {
            let axis = Axis::LINEAR[row];
            if state.axes.contains(axis) {
                state.commanded[axis]
            } else {
                f64::NAN
            }
        });
        self.read_axes(at, state, elapsed, out);
        if let Some(geometric) = &mut self.geometric {
            let known = |axis| {
                if state.axes.contains(axis) {
                    state.commanded[axis]
                } else {
                    f64::NAN
                }
            };
            geometric.observe(&PerAxis::from_fn(known));
        }
        self.drive(at, Some(&commanded_mm), elapsed, out);
    }

    /// Time since the last state by the controller's own clock, which is the one the axes move by.
    fn elapsed(&self, at: Stamp<Host>, now: Stamp<Machine>, out: &mut Vec<Output>) -> Elapsed {
        let Some(last) = self.controller_at else {
            return self.elapsed_on_host(at);
        };
        let span = now - last;
        match span.nanos() {
            0 => Elapsed::Nothing,
            i64::MIN..0 => {
                let by_s = -span.as_secs_f64();
                out.push(Output::Diagnostic(Diagnostic::ClockWentBack { by_s }));
                Elapsed::Step(self.servo_period_s)
            }
            _ if span > self.gap => {
                let gap_s = span.as_secs_f64();
                out.push(Output::Diagnostic(Diagnostic::Gap { gap_s }));
                Elapsed::Gap
            }
            _ => Elapsed::Step(span.as_secs_f64()),
        }
    }

    /// Time since the offsets last moved by the host's clock, for when the controller is silent.
    fn elapsed_on_host(&self, at: Stamp<Host>) -> Elapsed {
        match self.driven_at.map(|driven_at| at - driven_at) {
            Some(span) if span > self.gap => Elapsed::Gap,
            Some(span) if span.nanos() > 0 => Elapsed::Step(span.as_secs_f64()),
            _ => Elapsed::Nothing,
        }
    }

    /// Moves every axis on and publishes.
    fn drive(
        &mut self,
        at: Stamp<Host>,
        commanded_mm: Option<&Vector3<f64>>,
        elapsed: Elapsed,
        out: &mut Vec<Output>,
    ) {
        self.driven_at = Some(at);
        let mut message = AxisCompensation {
            at,
            axes: self.axes,
            total: PerAxis::default(),
            thermal: PerAxis::default(),
            geometric: PerAxis::default(),
            positioning: PerAxis::default(),
            pulses: PerAxis::default(),
            remainder: PerAxis::default(),
            state: PerAxis::default(),
        };
        let thermal = commanded_mm.map(|p_mm| self.gate.drifts_mm(p_mm, at));
        for axis in Axis::ALL {
            let Some(mut compensated) = self.states[axis] else {
                continue;
            };
            let (parts, wanted) = self.wanted(axis, thermal.as_ref());
            if let (Wanted::Offset(_), Some(p_mm)) = (wanted, commanded_mm) {
                self.watch_span(axis, p_mm, out);
            }
            let before = compensated;
            match elapsed {
                Elapsed::Nothing => {}
                Elapsed::Step(dt_s) => compensated.step(wanted, dt_s),
                Elapsed::Gap => compensated.freeze(),
            }
            self.states[axis] = Some(compensated);
            self.remark(axis, &before, &compensated, wanted, out);
            let train = &mut self.trains[axis];
            train
                .follow(compensated.offset())
                .expect("an offset inside the size limit is some millimetres at most");
            message.total[axis] = compensated.offset();
            message.thermal[axis] = parts.thermal;
            message.geometric[axis] = parts.geometric;
            message.positioning[axis] = parts.positioning;
            message.pulses[axis] = train.pulses();
            message.remainder[axis] = train.remainder_mm();
            message.state[axis] = compensated.state();
        }
        if self.activity != Activity::Inactive {
            out.push(Output::Compensation(message));
        }
        self.report_faded_out(out);
    }

    /// The parts of one axis' offset; `thermal`: the drifts where the axes stand, none while that is not known. A part of which nothing was ever said is zero beside another.
    fn parts(&self, axis: Axis, thermal: Option<&Drifts>) -> Result<Parts, PartRefusal> {
        let dual_loop = self.positioning[axis]
            .as_ref()
            .filter(|_| thermal.is_some());
        let positioning = dual_loop.map_or(Ok(None), DualLoop::offset_mm)?;
        let adds_thermal = dual_loop.is_none_or(DualLoop::adds_thermal);
        let geometric = self
            .geometric
            .as_ref()
            .filter(|_| thermal.is_some())
            .map_or(Ok(None), |geometric| geometric.offset_mm(axis))
            .map_err(|source| PartRefusal::Geometric { source })?;
        let thermal = thermal
            .filter(|_| adds_thermal)
            .and_then(|drifts| drifts.get(axis.index()).copied())
            .unwrap_or(Err(DriftRefusal::NotModelled { axis }));
        let speaks = geometric.is_some() || positioning.is_some();
        let thermal = match thermal {
            Err(DriftRefusal::NotModelled { .. }) if speaks => 0.0,
            thermal => thermal?,
        };
        let parts = Parts {
            thermal,
            geometric: geometric.unwrap_or_default(),
            positioning: positioning.unwrap_or_default(),
        };
        match parts.are_finite() {
            true => Ok(parts),
            false => Err(PartRefusal::NotFinite { axis }),
        }
    }

    fn wanted(&self, axis: Axis, thermal: Option<&Drifts>) -> (Parts, Wanted) {
        let parts = self.parts(axis, thermal);
        let may_act = self.activity == Activity::Active && self.shutdown == Shutdown::No;
        let is_on = self.enabled && may_act;
        match parts {
            Ok(parts) if is_on => (parts, Wanted::Offset(parts.sum())),
            Ok(parts) => (parts, Wanted::Nothing),
            Err(refusal) if is_on => (Parts::default(), Wanted::Refused(refusal)),
            Err(_) => (Parts::default(), Wanted::Nothing),
        }
    }

    /// Without axis states there is no tick: say so, and let ticks of the host drive a last fade.
    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        // A host clock that went back must not make a silence look short or a last fade wait.
        self.heard_at = self.heard_at.map(|heard_at| heard_at.min(at));
        self.driven_at = self.driven_at.map(|driven_at| driven_at.min(at));
        self.publish_tables(at, out);
        let silence = self.heard_at.map(|heard_at| at - heard_at);
        if silence.is_some_and(|silence| silence <= self.gap) {
            return;
        }
        if let (Some(silence), false) = (silence, self.is_stale) {
            self.is_stale = true;
            out.push(Output::Diagnostic(Diagnostic::StatesStale {
                silence_s: silence.as_secs_f64(),
            }));
        }
        if self.shutdown == Shutdown::Fading || self.activity == Activity::Ending {
            let elapsed = self.elapsed_on_host(at);
            // The next state must not count this time again.
            self.controller_at = None;
            self.drive(at, None, elapsed, out);
        }
    }

    fn shut_down(&mut self, out: &mut Vec<Output>) {
        if self.shutdown == Shutdown::No {
            self.shutdown = Shutdown::Fading;
            for state in self.states.0.iter_mut().flatten() {
                state.hasten();
            }
            out.push(Output::Diagnostic(Diagnostic::ShuttingDown));
            self.report_faded_out(out);
        }
    }

    /// Activated, or deactivated, which fades as an end does; either may come while the other is under way.
    fn act(&mut self, active: bool, out: &mut Vec<Output>) {
        let states = self.states.0.iter_mut().flatten();
        if active {
            self.activity = Activity::Active;
            if self.shutdown == Shutdown::No {
                states.for_each(Compensated::take_time);
            }
            return;
        }
        if self.activity == Activity::Active {
            self.activity = Activity::Ending;
            states.for_each(Compensated::hasten);
            self.report_faded_out(out);
        } else if self.activity == Activity::Inactive {
            out.push(Output::AtRest);
        }
    }

    fn report_faded_out(&mut self, out: &mut Vec<Output>) {
        let all_off = self.states.0.iter().flatten().all(Compensated::is_off);
        if self.activity == Activity::Ending && all_off {
            self.activity = Activity::Inactive;
            out.push(Output::AtRest);
        }
        if self.shutdown == Shutdown::Fading && all_off {
            self.shutdown = Shutdown::Done;
            out.push(Output::FadedOut);
        }
    }
}

fn gate_limits(config: &AxisCompensationConfig, machine: &MachineFile) -> GateLimits {
    GateLimits {
        physical_rate_mm_s: config.physical_rate_um_per_min * 1e-3 / 60.0,
        margin_mm: config.jump_margin_um * 1e-3,
        expanded_uncertainty_mm: config.expanded_uncertainty_limit_um * 1e-3,
        policy: config.extrapolate,
        // An axis that the machine does not have goes nowhere.
        travel_mm: Axis::LINEAR.map(|axis| {
            let travel_mm = machine.linear(axis).map(|entry| entry.travel_mm);
            travel_mm.map_or((0.0, 0.0), |[lower_mm, upper_mm]| (lower_mm, upper_mm))
        }),
    }
}

fn positive(key: &str, value: f64) -> Result<f64, AxisCompensationError> {
    check_between(key, value, (1e-6, 1e6))?;
    Ok(value)
}

impl Stage for AxisCompensationStage {
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
        match input {
            Input::State(state) => self.state(at, &state, out),
            Input::Model(model) => self.model(at, *model, out),
            Input::Geometry(source, model) => self.geometry(source, *model, out),
            Input::Segment(segment) => self.segment(at, &segment, out),
            Input::Enable(enabled) => {
                if enabled != self.enabled {
                    self.enabled = enabled;
                    out.push(Output::Diagnostic(Diagnostic::Enabled { enabled }));
                }
            }
            Input::Active(active) => self.act(active, out),
            Input::Shutdown => self.shut_down(out),
            Input::Tick => self.tick(at, out),
        }
        Ok(())
    }
}
