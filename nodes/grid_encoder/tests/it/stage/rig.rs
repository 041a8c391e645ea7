//! A machine that moves a head over a plate, with errors by a formula of the test.

use std::collections::VecDeque;

use grid_encoder::diagnostic::{Diagnostic, Refusal};
use grid_encoder::identify::Identification;
use grid_encoder::{GridEncoderConfig, GridEncoderStage, Input, Output};
use machine::MachineFile;
use metrology::sample::{
    AxisState, GeometryModel, GridSample, Sense, TestKind, TestPlane, TestSegment,
};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const MACHINE: &str = include_str!("../../../../../launch_configs/four_blocks/machine.yaml");
const TICK_NS: i64 = 2_000_000;
const NOISE_MM: f64 = 2e-4;

/// One circle.
#[derive(Clone)]
pub struct Motion {
    pub plane: TestPlane,
    pub radius_mm: f64,
    pub sense: Sense,
    /// Zero: moving.
    pub stations: u32,
    pub dwell_s: f64,
    pub feed_mm_s: f64,
}

impl Motion {
    pub fn stops(radius_mm: f64, stations: u32) -> Self {
        Self {
            plane: TestPlane::Xy,
            radius_mm,
            sense: Sense::CounterClockwise,
            stations,
            dwell_s: 1.0,
            feed_mm_s: 25.0,
        }
    }

    pub fn moving(radius_mm: f64, sense: Sense) -> Self {
        Self {
            sense,
            stations: 0,
            ..Self::stops(radius_mm, 0)
        }
    }

    /// Angle at a time, rad, and the time that it takes, s.
    fn angle(&self, t_s: f64) -> f64 {
        let rate = self.feed_mm_s / self.radius_mm;
        let sign = if self.sense == Sense::Clockwise {
            -1.0
        } else {
            1.0
        };
        if self.stations == 0 {
            return sign * rate * t_s;
        }
        let step = std::f64::consts::TAU / f64::from(self.stations);
        let period_s = self.dwell_s + step / rate;
        let (whole, rest) = ((t_s / period_s).floor(), t_s % period_s);
        sign * (whole * step + (rest - self.dwell_s).max(0.0) * rate)
    }

    fn duration_s(&self) -> f64 {
        let once = std::f64::consts::TAU * self.radius_mm / self.feed_mm_s;
        once + f64::from(self.stations) * self.dwell_s
    }
}

pub struct Rig {
    pub stage: GridEncoderStage,
    pub out: Vec<Output>,
    pub now_ns: i64,
    pub turn_rad: f64,
    pub lost_motion_mm: [f64; 2],
    /// The grid's stamps are this much later than the instant at which it read.
    pub stamp_late_s: f64,
    /// Motors are where the command and minus the error ask for.
    pub compensated: bool,
    /// Zero as read, and as the segment tells.
    pub zero_id: u32,
    pub told_zero_id: u32,
    pub setup_id: u32,
    pub completed: bool,
    /// Readings for which this holds are changed to that: (time in the run, s) → reading.
    pub spoil: fn(f64, GridSample) -> Option<GridSample>,
    /// Whether each reading is told twice, and once more after the next one.
    pub tells_again: bool,
    /// How many positions later than they were read readings arrive, and those that are on their way.
    pub lag_ticks: usize,
    on_their_way: VecDeque<Option<GridSample>>,
    /// How many positions the end of a segment is late.
    pub ends_late_ticks: i64,
    /// Whether the next recording begins some time after the one before.
    pub pauses: bool,
    /// After how many positions the begin of a segment arrives.
    pub begins_late_ticks: i64,
    error_mm: fn(f64, f64) -> [f64; 2],
    rng: Pcg64Mcg,
}

impl Rig {
    pub fn new(error_mm: fn(f64, f64) -> [f64; 2]) -> Self {
        Self::with(error_mm, GridEncoderConfig::default())
    }

    pub fn with(error_mm: fn(f64, f64) -> [f64; 2], config: GridEncoderConfig) -> Self {
        let mut file = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        file.chain = String::from("[w X' Y' b Z t]");
        file.axes.retain(|axis, _| axis.is_linear());
        Self {
            stage: GridEncoderStage::new(&config, &file).unwrap(),
            out: Vec::new(),
            now_ns: 1_000_000_000,
            turn_rad: 1e-4,
            lost_motion_mm: [0.0; 2],
            stamp_late_s: 0.0,
            compensated: false,
            zero_id: 7,
            told_zero_id: 7,
            setup_id: 1,
            completed: true,
            spoil: |_, sample| Some(sample),
            tells_again: false,
            lag_ticks: 0,
            on_their_way: VecDeque::new(),
            ends_late_ticks: 0,
            pauses: true,
            begins_late_ticks: 0,
            error_mm,
            rng: Pcg64Mcg::seed_from_u64(3),
        }
    }

    pub fn send(&mut self, input: Input) {
        let at = Stamp::from_nanos(self.now_ns);
        self.stage.step(at, input, &mut self.out).unwrap();
    }

    pub fn segment(&mut self, run: u32, begin: bool, motion: &Motion) {
        self.segment_of(self.now_ns, run, begin, motion);
    }

    fn segment_of(&mut self, at_ns: i64, run: u32, begin: bool, motion: &Motion) {
        let segment = TestSegment {
            begin,
            plane: motion.plane,
            radius_mm: motion.radius_mm,
            feed_mm_s: motion.feed_mm_s,
            sense: motion.sense,
            stations: motion.stations,
            zero_id: self.told_zero_id,
            setup_id: self.setup_id,
            completed: self.completed,
            ..TestSegment::of_kind(TestKind::Circle, run, Stamp::from_nanos(at_ns))
        };
        self.send(Input::Segment(segment));
    }

    fn axes(plane: TestPlane) -> [Axis; 2] {
        match plane {
            TestPlane::Yz => [Axis::Y, Axis::Z],
            TestPlane::Zx => [Axis::Z, Axis::X],
            _ => [Axis::X, Axis::Y],
        }
    }

    /// Where the motors are, along u and v.
    fn motors_mm(&self, motion: &Motion, t_s: f64) -> [f64; 2] {
        let (sin, cos) = motion.angle(t_s).sin_cos();
        let [u, v] = [motion.radius_mm * cos, motion.radius_mm * sin];
        if self.compensated {
            let [eu, ev] = (self.error_mm)(u, v);
            [u - eu, v - ev]
        } else {
            [u, v]
        }
    }

    fn reading(&mut self, motion: &Motion, t_s: f64) -> [f64; 2] {
        let read_s = t_s - self.stamp_late_s;
        let [u, v] = self.motors_mm(motion, read_s);
        let before = self.motors_mm(motion, read_s - 1e-4);
        let sign = |now: f64, before: f64| if now < before { -1.0 } else { 1.0 };
        let [eu, ev] = (self.error_mm)(u, v);
        let lag = [
            -0.5 * self.lost_motion_mm[0] * sign(u, before[0]),
            -0.5 * self.lost_motion_mm[1] * sign(v, before[1]),
        ];
        let (s, c) = self.turn_rad.sin_cos();
        let (u, v) = (u + eu + lag[0], v + ev + lag[1]);
        let mut noise =
            || -> f64 { NOISE_MM * Distribution::<f64>::sample(&StandardNormal, &mut self.rng) };
        [
            c * u - s * v + 1.25 + noise(),
            s * u + c * v - 3.5 + noise(),
        ]
    }

    /// A whole recording: positions every 2 ms, readings every 6 ms.
    pub fn record(&mut self, run: u32, motion: &Motion) {
        let begin_ns = self.now_ns;
        let mut before = None;
        let ticks = (motion.duration_s() * 1e9) as i64 / TICK_NS;
        for tick in 0..ticks + self.ends_late_ticks {
            let t_s = (tick * TICK_NS) as f64 / 1e9;
            self.now_ns = begin_ns + tick * TICK_NS;
            if tick == self.begins_late_ticks {
                self.segment_of(begin_ns, run, true, motion);
            }
            self.state(motion, t_s);
            let reads = tick % 3 == 0 && tick > 0;
            let sample = reads.then(|| self.sample(motion, t_s)).flatten();
            self.on_their_way.push_back(sample);
            while self.on_their_way.len() > self.lag_ticks {
                let Some(sample) = self.on_their_way.pop_front().flatten() else {
                    continue;
                };
                self.send(Input::Reading(sample));
                if self.tells_again {
                    let before = before.replace(sample).unwrap_or(sample);
                    self.send(Input::Reading(sample));
                    self.send(Input::Reading(before));
                }
            }
        }
        let end_ns = begin_ns + (ticks - 1) * TICK_NS;
        self.segment_of(end_ns, run, false, motion);
        for _ in 0..if self.pauses { 10 } else { 0 } {
            self.now_ns += 50_000_000;
            self.send(Input::Tick);
        }
    }

    /// What the grid reads at a tick.
    fn sample(&mut self, motion: &Motion, t_s: f64) -> Option<GridSample> {
        let [u_mm, v_mm] = self.reading(motion, t_s - 0.0007);
        let sample = GridSample {
            at: Stamp::from_nanos(self.now_ns - 700_000),
            plane: motion.plane,
            u_mm,
            v_mm,
            zero_id: self.zero_id,
        };
        (self.spoil)(t_s, sample)
    }

    pub fn state(&mut self, motion: &Motion, t_s: f64) {
        let [u, v] = Self::axes(motion.plane);
        let (sin, cos) = motion.angle(t_s).sin_cos();
        let mut commanded = PerAxis::default();
        commanded[u] = motion.radius_mm * cos;
        commanded[v] = motion.radius_mm * sin;
        let mut motor = commanded;
        [motor[u], motor[v]] = self.motors_mm(motion, t_s);
        self.send(Input::State(AxisState {
            received_at: Stamp::from_nanos(self.now_ns),
            controller_at: Stamp::from_nanos(self.now_ns),
            axes: AxisSet::XYZ,
            commanded,
            motor,
            scale: PerAxis([f64::NAN; 6]),
            velocity: PerAxis::default(),
        }));
    }

    pub fn models(&self) -> Vec<&GeometryModel> {
        let all = self.out.iter();
        all.filter_map(|output| match output {
            Output::Model(model) => Some(model),
            _ => None,
        })
        .collect()
    }

    pub fn identification(&self) -> &Identification {
        let of = |output: &Output| matches!(output, Output::Identification(_));
        match self.out.iter().rfind(|output| of(output)) {
            Some(Output::Identification(found)) => found,
            _ => panic!("not fitted: {:?}", self.diagnostics()),
        }
    }

    pub fn diagnostics(&self) -> Vec<&Diagnostic> {
        let all = self.out.iter();
        all.filter_map(|output| match output {
            Output::Diagnostic(diagnostic) => Some(diagnostic),
            _ => None,
        })
        .collect()
    }

    pub fn refusals(&self) -> Vec<&Refusal> {
        let all = self.diagnostics().into_iter();
        all.filter_map(|diagnostic| match diagnostic {
            Diagnostic::Refused { refusal, .. } => Some(refusal),
            _ => None,
        })
        .collect()
    }
}
