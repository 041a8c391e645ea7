//! A stage, its clocks, and what is known of what it counts from.

use std::collections::BTreeSet;

use axis_compensation::limiter::Limits;
use axis_compensation::parts::PartRefusal;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Diagnostic, Input, Output};
use machine::MachineFile;
use metrology::drift::Extrapolate;
use metrology::sample::{AxisState, GeometryModel};
use metrology::{Axis, AxisSet, Host, Machine, PerAxis, Stage, Stamp};
use proptest::prelude::*;
use serde::Deserialize;

use crate::props::events::{Event, Heard};
use crate::props::geometry::{self, Content, Geometry};
use crate::props::messages::{model, segment};
use crate::props::watch::Watch;

const SERVO_S: f64 = 1e-3;

const POSITIONING: &str = "\
    X: {reading: refreshed_table, weight: 0.3, directions: apart, thermal_part: true, \
        measured_limit_um: 5000.0, measuring_feed_limit_mm_min: 60000.0, settle_s: 0.0, dwell_s: 0.01, \
        start_points_mm: [-50.0, -40.0, -30.0, -20.0, -10.0, 0.0], \
        start_deviations_um: [0.0, 50.0, -120.0, 3.0, 3.0, 10.0], \
        start_deviations_down_um: [0.0, -50.0, 20.0, 3.0, -3.0, 10.0]}, \
    Y: {reading: weighted_increments, weight: 0.2, directions: together, thermal_part: false, \
        measured_limit_um: 5000.0, measuring_feed_limit_mm_min: 60000.0, loop_cycle_s: 0.002, \
        start_points_mm: [-40.0, -20.0, 0.0, 20.0, 40.0], start_deviations_um: [0.0, 50.0, -20.0, 3.0, 3.0]}";

/// Three axes, two of them with a dual loop, without geometry.
pub fn three_axes(extrapolate: &str) -> Bench {
    let machine = include_str!("../../../../../launch_configs/first_run/machine.yaml");
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
    let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Y: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: {extrapolate}, \
         physical_rate_um_per_min: 3.0, jump_margin_um: 20.0, expanded_uncertainty_limit_um: 1000.0, hold_s: 0.1, fade_s: 0.2, gap_s: 0.2, positioning: {{{POSITIONING}}}}}"
    ))
    .unwrap();
    Bench::new(&config, machine, AxisSet::XYZ)
}

#[derive(Deserialize)]
struct ParameterFile {
    #[serde(rename = "/**")]
    of_all: NodeParameters,
}

#[derive(Deserialize)]
struct NodeParameters {
    #[serde(rename = "ros__parameters")]
    parameters: AxisCompensationConfig,
}

/// The scenario of the five-axis machine, switched on, with times of holding and fading short enough to end.
pub fn five_axes(extrapolate: Extrapolate) -> Bench {
    let machine = include_str!("../../../../../launch_configs/five_axis/machine.yaml");
    let file = include_str!("../../../../../launch_configs/five_axis/axis_compensation.yaml");
    let file: ParameterFile = serde_saphyr::from_str(file).unwrap();
    let config = AxisCompensationConfig {
        extrapolate,
        enabled: true,
        hold_s: 0.1,
        fade_s: 0.2,
        ..file.of_all.parameters
    };
    assert!(config.geometry.is_some());
    Bench::new(&config, machine, AxisSet::XYZ.with(Axis::A).with(Axis::C))
}

/// Both clocks and what the stage is known to count from.
pub struct Bench {
    pub stage: AxisCompensationStage,
    axes: AxisSet,
    pub host_nanos: i64,
    pub machine_nanos: i64,
    last_state: Option<i64>,
    last_driven: Option<i64>,
    sequence: u32,
    /// The last geometry model of each kind.
    offered: [Option<GeometryModel>; 2],
    /// States since the last that was answered.
    pub silent_states: u32,
    pub watch: Watch,
    /// What was said of geometry models and of poses.
    pub seen: BTreeSet<&'static str>,
}

impl Bench {
    fn new(config: &AxisCompensationConfig, machine: &str, axes: AxisSet) -> Self {
        let machine: MachineFile = serde_saphyr::from_str(machine).unwrap();
        let limits = PerAxis::from_fn(|axis| {
            config.axes.get(&axis).map(|own| Limits {
                size: own.size_limit_um * 1e-3,
                rate: own.rate_limit_um_per_s * 1e-3,
                acceleration: own.acceleration_limit_um_per_s2 * 1e-3,
            })
        });
        // At full rate an offset can stop within the time that counts as a gap.
        for own in limits.0.iter().flatten() {
            assert!(own.rate / own.acceleration <= config.gap_s);
        }
        Self {
            stage: AxisCompensationStage::new(config, &machine).unwrap(),
            axes,
            host_nanos: 0,
            machine_nanos: 0,
            last_state: None,
            last_driven: None,
            sequence: 0,
            offered: [None, None],
            silent_states: 0,
            watch: Watch::new(limits),
            seen: BTreeSet::new(),
        }
    }

    pub fn run(&mut self, event: &Event) -> Result<(), TestCaseError> {
        let Event::Sweep(sweep) = event else {
            return self.run_one(event);
        };
        for tick in 0..sweep.ticks {
            self.run_one(&sweep.state(tick))?;
        }
        Ok(())
    }

    fn run_one(&mut self, event: &Event) -> Result<(), TestCaseError> {
        let input = self.input(event);
        let by_state = matches!(input, Input::State(_));
        if input == Input::Tick {
            self.last_driven = self.last_driven.map(|last| last.min(self.host_nanos));
        }
        let mut out = Vec::new();
        let at = Stamp::from_nanos(self.host_nanos);
        self.stage.step(at, input, &mut out).unwrap();
        let is_compensation = |output: &Output| matches!(output, Output::Compensation(_));
        if by_state && !out.iter().any(is_compensation) {
            // Not active: nothing is said, and time goes on.
            self.last_driven = Some(self.host_nanos);
            self.last_state = Some(self.machine_nanos);
            self.watch.rest();
            self.silent_states += 1;
        }
        for output in &out {
            self.note(output);
            if let Output::Compensation(c) = output {
                self.silent_states = 0;
                self.watch.check(c, self.elapsed_s(by_state))?;
                self.last_driven = Some(self.host_nanos);
                self.last_state = by_state.then_some(self.machine_nanos);
            }
        }
        Ok(())
    }

    /// Time in which the offsets went where they are now; none where no time passed.
    fn elapsed_s(&self, by_state: bool) -> Option<f64> {
        let host = self
            .last_driven
            .map(|last| self.host_nanos.saturating_sub(last));
        let dt_s = match (by_state, self.last_state) {
            (true, Some(last)) => match self.machine_nanos.saturating_sub(last) {
                i64::MIN..0 => Some(SERVO_S),
                nanos => Some(nanos as f64 / 1e9),
            },
            _ => host.map(|nanos| nanos as f64 / 1e9),
        };
        dt_s.filter(|dt_s| *dt_s > 0.0)
    }

    /// Remembers what the stage made of geometry models and of poses.
    fn note(&mut self, output: &Output) {
        let Output::Diagnostic(said) = output else {
            return;
        };
        self.seen.extend(match said {
            Diagnostic::GeometryAccepted { .. } => Some("accepted"),
            Diagnostic::GeometryConfirmed { .. } => Some("confirmed"),
            Diagnostic::GeometryQuarantined { .. } => Some("kept back"),
            Diagnostic::GeometryIncomplete { .. } => Some("incomplete"),
            Diagnostic::GeometryRefused { .. } => Some("refused"),
            Diagnostic::SizeExceeded { .. } => Some("too large"),
            Diagnostic::ModelRefused {
                cause: PartRefusal::Geometric { .. },
                ..
            } => Some("no geometric part"),
            _ => None,
        });
    }

    pub fn input(&mut self, event: &Event) -> Input {
        let at = Stamp::<Host>::from_nanos(self.host_nanos);
        match event {
            Event::State { .. } => Input::State(self.state(event)),
            Event::Model {
                k0_mm,
                slope,
                life_s,
                rate_mm_s,
            } => {
                self.sequence += 1;
                let model = model(self.sequence, at, *k0_mm, *slope, *life_s, *rate_mm_s);
                Input::Model(Box::new(model))
            }
            Event::Geometry(geometry) => self.geometry(at, geometry),
            Event::Test { begin, completed } => {
                Input::Segment(Box::new(segment(at, *begin, *completed)))
            }
            Event::Enable(on) => Input::Enable(*on),
            Event::Active(active) => Input::Active(*active),
            Event::Tick => Input::Tick,
            Event::Wait { host_nanos } => {
                self.host_nanos = self.host_nanos.saturating_add(*host_nanos);
                Input::Tick
            }
            Event::Shutdown => Input::Shutdown,
            Event::Sweep(_) => unreachable!("a sweep is run as its states"),
        }
    }

    fn state(&mut self, event: &Event) -> AxisState {
        let Event::State {
            step_nanos,
            position_mm: [x_mm, y_mm, z_mm],
            rotary_rad: [a_rad, c_rad],
            heard,
            beyond_motor_mm,
        } = *event
        else {
            unreachable!("asked for states only")
        };
        self.machine_nanos = self.machine_nanos.saturating_add(step_nanos);
        self.host_nanos = self
            .host_nanos
            .saturating_add(step_nanos.clamp(0, 1_000_000_000));
        let commanded = PerAxis([x_mm, y_mm, z_mm, a_rad, 0.0, c_rad]);
        AxisState {
            received_at: Stamp::from_nanos(self.host_nanos),
            controller_at: Stamp::<Machine>::from_nanos(self.machine_nanos),
            axes: match heard {
                Heard::All => self.axes,
                Heard::Linear => AxisSet::XYZ,
                Heard::YAlone => AxisSet::EMPTY.with(Axis::Y),
            },
            commanded,
            motor: commanded,
            scale: PerAxis::from_fn(|axis| commanded[axis] + beyond_motor_mm),
            velocity: PerAxis::default(),
        }
    }

    fn geometry(&mut self, at: Stamp<Host>, geometry: &Geometry) -> Input {
        let mut source = geometry.source;
        let last = self.offered[source as usize].take();
        let sequence = last.as_ref().map_or(0, |last| last.sequence);
        let sequence = geometry.number.after(sequence);
        let model = match &geometry.content {
            Content::Again(by) => {
                let mut model = last.unwrap_or_else(|| geometry::model(at, sequence, Vec::new()));
                model.sequence = sequence;
                geometry::scale(&mut model.curves, *by);
                model
            }
            Content::New(curves, fault) => {
                let mut model = geometry::model(at, sequence, curves.clone());
                fault.mar(&mut model, &mut source);
                model
            }
        };
        self.offered[source as usize] = Some(model.clone());
        Input::Geometry(source, Box::new(model))
    }
}
