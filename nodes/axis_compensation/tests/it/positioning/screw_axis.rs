//! An axis with physics of its own: screw, backlash, heat, servo lag, scale.
//!
//! It shares no formula with the crate. Its slide is pushed through a gap by a nut whose way is the motor's,
//! times a lead error with a straight, a cubic and a cyclic part, and a screw that grows from its fixed
//! bearing with a time constant. The scale sits on the slide.

use std::f64::consts::PI;

use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Diagnostic, Input, Output};
use metrology::sample::{
    AxisCompensation, AxisState, CompensationState, PositioningTable, TestKind, TestSegment,
};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};

pub const TICK_S: f64 = 1e-3;
/// Points of the table, mm: 15 mm apart on a screw of 10 mm lead.
pub const FIRST_MM: f64 = -120.0;
pub const SPACING_MM: f64 = 15.0;
pub const POINTS: u32 = 17;

/// A ball screw axis.
#[derive(Clone, Debug)]
pub struct Screw {
    pub motor_mm: f64,
    pub slide_mm: f64,
    pub commanded_before_mm: f64,
    pub grown: f64,
    /// Growth in the end, mm/mm.
    pub growth: f64,
    pub time_constant_s: f64,
    pub gap_mm: f64,
    pub fixed_bearing_mm: f64,
    pub gain_per_s: f64,
    pub feedforward: f64,
}

impl Screw {
    pub fn new() -> Self {
        Self {
            motor_mm: 0.0,
            slide_mm: 0.0,
            commanded_before_mm: 0.0,
            grown: 0.0,
            growth: 0.0,
            time_constant_s: 600.0,
            gap_mm: 5e-3,
            fixed_bearing_mm: -200.0,
            gain_per_s: 60.0,
            feedforward: 1.0,
        }
    }

    /// How far the nut is beyond what the motor says, mm.
    pub fn lead_error_mm(&self, x_mm: f64) -> f64 {
        let u = x_mm / 120.0;
        let cyclic_mm = 0.8e-3 * (2.0 * PI * x_mm / 10.0 + 0.4).sin();
        12e-3 * u - 7e-3 * u.powi(3) + cyclic_mm + self.grown * (x_mm - self.fixed_bearing_mm)
    }

    /// One tick towards a command; `offset_mm` is what compensation adds.
    pub fn tick(&mut self, commanded_mm: f64, offset_mm: f64) {
        // The command before is what the motor was to have reached by now.
        let lag_mm = self.commanded_before_mm + offset_mm - self.motor_mm;
        let feed_mm_s = (commanded_mm - self.commanded_before_mm) / TICK_S;
        self.commanded_before_mm = commanded_mm;
        self.motor_mm += TICK_S * (self.gain_per_s * lag_mm + self.feedforward * feed_mm_s);
        self.grown += (self.growth - self.grown) * TICK_S / self.time_constant_s;
        let nut_mm = self.motor_mm + self.lead_error_mm(self.motor_mm);
        // A slide in its gap stays until a flank takes it along.
        let half_mm = 0.5 * self.gap_mm;
        self.slide_mm = self.slide_mm.max(nut_mm - half_mm).min(nut_mm + half_mm);
    }

    /// Scale with steps of 0.05 µm.
    pub fn scale_mm(&self) -> f64 {
        (self.slide_mm / 5e-5).round() * 5e-5
    }
}

/// What closes the position loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feedback {
    /// The motor alone.
    SemiClosed,
    /// The motor, and the offset of the stage.
    DualLoop,
    /// The scale in the servo loop: command less slide takes the place of command less motor.
    FullClosed,
}

pub struct Machine {
    pub stage: AxisCompensationStage,
    pub screw: Screw,
    pub feedback: Feedback,
    pub nanos: i64,
    pub commanded_mm: f64,
    pub scale_speaks: bool,
    pub last: Option<AxisCompensation>,
    pub tables: Vec<PositioningTable>,
    pub diagnostics: Vec<Diagnostic>,
    /// Slide less command at each tick, while recording.
    pub record_mm: Option<Vec<f64>>,
    pub repeat: u32,
}

pub const MACHINE: &str = include_str!("../../../../../launch_configs/first_run/machine.yaml");

pub fn configured(positioning: &str) -> Result<AxisCompensationStage, String> {
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 2000.0, acceleration_limit_um_per_s2: 100000.0";
    let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: hold, physical_rate_um_per_min: 3.0, \
         jump_margin_um: 2.0, expanded_uncertainty_limit_um: 1000.0, hold_s: 1.0, fade_s: 2.0, positioning: {{{positioning}}}}}"
    ))
    .map_err(|error| error.to_string())?;
    AxisCompensationStage::new(&config, &serde_saphyr::from_str(MACHINE).unwrap())
        .map_err(|error| error.to_string())
}

pub fn x(reading: &str, weight: f64, directions: &str, more: &str) -> String {
    format!(
        "X: {{reading: {reading}, weight: {weight}, directions: {directions}, thermal_part: false, \
         measured_limit_um: 60.0, settle_s: 0.1, dwell_s: 0.1, {more}}}"
    )
}

impl Machine {
    pub fn new(positioning: &str, feedback: Feedback) -> Self {
        Self {
            stage: configured(positioning).unwrap(),
            screw: Screw::new(),
            feedback,
            nanos: 0,
            commanded_mm: 0.0,
            scale_speaks: true,
            last: None,
            tables: Vec::new(),
            diagnostics: Vec::new(),
            record_mm: None,
            repeat: 0,
        }
    }

    pub fn step(&mut self, input: Input) {
        let mut out = Vec::new();
        let Ok(()) = self
            .stage
            .step(Stamp::from_nanos(self.nanos), input, &mut out);
        for output in out {
            match output {
                Output::Compensation(compensation) => self.last = Some(compensation),
                Output::Diagnostic(said) => self.diagnostics.push(said),
                Output::Table(table) => self.tables.push(*table),
                Output::FadedOut | Output::AtRest => {}
            }
        }
    }

    pub fn tick(&mut self, commanded_mm: f64) {
        self.nanos += 1_000_000;
        self.commanded_mm = commanded_mm;
        let offset_mm = match self.feedback {
            Feedback::SemiClosed => 0.0,
            Feedback::DualLoop => self.last.map_or(0.0, |last| last.total[Axis::X]),
            Feedback::FullClosed => self.screw.motor_mm - self.screw.scale_mm(),
        };
        self.screw.tick(commanded_mm, offset_mm);
        if let Some(record_mm) = &mut self.record_mm {
            record_mm.push(self.screw.slide_mm - commanded_mm);
        }
        let only_x = |x_mm: f64| {
            let mut all = PerAxis::default();
            all[Axis::X] = x_mm;
            all
        };
        let scale_mm = if self.scale_speaks {
            self.screw.scale_mm()
        } else {
            f64::NAN
        };
        self.step(Input::State(AxisState {
            received_at: Stamp::from_nanos(self.nanos),
            controller_at: Stamp::from_nanos(self.nanos),
            axes: AxisSet::XYZ,
            commanded: only_x(commanded_mm),
            motor: only_x(self.screw.motor_mm),
            scale: only_x(scale_mm),
            velocity: PerAxis::default(),
        }));
        if self.nanos % 10_000_000 == 0 {
            self.step(Input::Tick);
        }
    }

    /// Along the axis at constant feed, ramped over 50 ms at both ends.
    pub fn go(&mut self, to_mm: f64, feed_mm_s: f64) {
        let from_mm = self.commanded_mm;
        let length_mm = (to_mm - from_mm).abs();
        let ticks = (length_mm / feed_mm_s / TICK_S).ceil().max(1.0) as u32 + 50;
        for k in 1..=ticks {
            let share = f64::from(k) / f64::from(ticks);
            let ramp = (50.0 / f64::from(ticks)).min(0.5);
            // Speed rises, stays and falls; its integral over the whole is 1.
            let way = match share {
                s if s < ramp => 0.5 * s * s / ramp,
                s if s > 1.0 - ramp => 1.0 - ramp - 0.5 * (1.0 - s).powi(2) / ramp,
                s => s - 0.5 * ramp,
            } / (1.0 - ramp);
            self.tick(from_mm + (to_mm - from_mm) * way);
        }
        self.tick(to_mm);
    }

    pub fn stand(&mut self, seconds: f64) {
        for _ in 0..(seconds / TICK_S).round() as u32 {
            self.tick(self.commanded_mm);
        }
    }

    pub fn segment(&mut self, begin: bool) {
        let segment = TestSegment {
            begin,
            feed_mm_s: 50.0,
            repeat: self.repeat,
            zero_id: 1,
            setup_id: 1,
            stations: POINTS,
            ..TestSegment::of_kind(
                TestKind::Positioning,
                1 + self.repeat,
                Stamp::from_nanos(self.nanos),
            )
        };
        self.step(Input::Segment(Box::new(segment)));
    }

    /// One run up and down with overrun.
    pub fn run(&mut self) {
        let end_mm = FIRST_MM + SPACING_MM * f64::from(POINTS - 1);
        self.go(FIRST_MM - 3.0, 100.0);
        for j in (0..POINTS).chain((0..POINTS).rev().map(|j| j + POINTS)) {
            if j == 2 * POINTS - 1 {
                self.go(end_mm + 3.0, 100.0);
            }
            self.go(FIRST_MM + SPACING_MM * f64::from(j % POINTS), 100.0);
            self.stand(0.25);
        }
        self.go(FIRST_MM - 3.0, 100.0);
    }

    /// `n` runs, each a segment.
    pub fn learn(&mut self, n: u32) {
        for repeat in 0..n {
            self.repeat = repeat;
            self.segment(true);
            self.run();
            self.segment(false);
        }
    }

    /// RMS and greatest |slide − command| over slow strokes up and down, reversals included, mm.
    pub fn errors_mm(&mut self) -> (f64, f64) {
        self.go(-100.0, 100.0);
        self.go(-110.0, 10.0);
        self.record_mm = Some(Vec::with_capacity(100_000));
        self.go(100.0, 10.0);
        self.go(-110.0, 10.0);
        let record_mm = self.record_mm.take().unwrap();
        let squares: f64 = record_mm.iter().map(|e_mm| e_mm * e_mm).sum();
        let rms_mm = (squares / record_mm.len() as f64).sqrt();
        (
            rms_mm,
            record_mm
                .iter()
                .fold(0.0, |most, e_mm| most.max(e_mm.abs())),
        )
    }

    pub fn x(&self) -> (f64, CompensationState) {
        let last = self.last.as_ref().unwrap();
        (last.positioning[Axis::X], last.state[Axis::X])
    }

    pub fn said(&self, wanted: impl Fn(&Diagnostic) -> bool) -> usize {
        self.diagnostics.iter().filter(|said| wanted(said)).count()
    }
}

pub fn um(mm: f64) -> f64 {
    mm * 1e3
}
