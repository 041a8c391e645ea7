//! A machine that moves in straight lines, touches whose true contact is known, and what follows.

use machine::MachineFile;
use metrology::sample::{
    AxisState, BlockMeasurement, ProbeTrigger, ProbedFeature, ProbedPoint, TestKind, TestSegment,
};
use metrology::stamp::Span;
use metrology::{Axis, PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use probe::{Input, Output, ProbeConfig, ProbeStage};

pub(crate) const BENCH: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");
pub(crate) const BALL_MM: f64 = 3.0;
pub(crate) const LATENCY_S: f64 = 0.008_37;

pub(crate) fn bench() -> MachineFile {
    MachineFile::parse(BENCH, "bench.yaml").unwrap()
}

pub(crate) fn known_latency() -> ProbeConfig {
    ProbeConfig {
        latency_ms: Some(LATENCY_S * 1e3),
        latency_standard_uncertainty_ms: Some(0.025),
        ..ProbeConfig::default()
    }
}

/// A machine that moves in straight lines and a stage that watches it.
pub(crate) struct Rig {
    pub(crate) stage: ProbeStage,
    pub(crate) now_ns: i64,
    pub(crate) sequence: u32,
    pub(crate) out: Vec<Output>,
    /// Rotary positions, rad.
    pub(crate) rotary: PerAxis<f64>,
    /// Acceleration along the approach during a touch, mm/s².
    pub(crate) acceleration_mm_s2: f64,
    /// Whether the trigger arrives before the position at its stamp.
    pub(crate) trigger_first: bool,
    /// Changes a position before it is published.
    pub(crate) spoil: fn(&mut AxisState),
}

impl Rig {
    pub(crate) fn new(config: &ProbeConfig) -> Self {
        Self::with_file(config, &bench())
    }

    pub(crate) fn with_file(config: &ProbeConfig, file: &MachineFile) -> Self {
        Self {
            stage: ProbeStage::new(config, file).unwrap(),
            now_ns: 1_000_000_000,
            sequence: 0,
            out: Vec::new(),
            rotary: PerAxis::default(),
            acceleration_mm_s2: 0.0,
            trigger_first: false,
            spoil: |_| {},
        }
    }

    pub(crate) fn send(&mut self, input: Input) {
        let at = Stamp::from_nanos(self.now_ns);
        self.stage.step(at, input, &mut self.out).unwrap();
    }

    /// Lets time pass until everything that waits has been settled.
    pub(crate) fn settle(&mut self) {
        self.now_ns += 300_000_000;
        self.send(Input::Tick);
    }

    pub(crate) fn state(&self, ball_mm: &Vector3<f64>, at_ns: i64) -> AxisState {
        let mut motor = self.rotary;
        for axis in Axis::LINEAR {
            motor[axis] = ball_mm[axis.index()];
        }
        AxisState::standing(
            Stamp::from_nanos(at_ns),
            Stamp::from_nanos(at_ns),
            bench().axis_set(),
            motor,
        )
    }

    /// Touches with the ball's centre at `contact_mm` at the true instant of contact.
    pub(crate) fn touch_ball(
        &mut self,
        feature: &str,
        contact_mm: Vector3<f64>,
        approach: Vector3<f64>,
        feed_mm_s: f64,
    ) -> ProbeTrigger {
        let contact_ns = self.now_ns + 60_000_456;
        let latch_ns = contact_ns + Span::from_secs_f64(LATENCY_S).nanos();
        let acceleration = self.acceleration_mm_s2;
        let at_instant = move |at_ns: i64| {
            let t_s = (at_ns - contact_ns) as f64 / 1e9;
            contact_mm + approach * (feed_mm_s * t_s + acceleration * t_s * t_s / 2.0)
        };
        self.sequence += 1;
        let trigger = ProbeTrigger {
            received_at: Stamp::from_nanos(latch_ns + 500_000),
            controller_at: Stamp::from_nanos(latch_ns),
            feature_id: feature.to_owned(),
            approach,
            feed_mm_s: feed_mm_s + acceleration * LATENCY_S,
            axes: bench().axis_set(),
            latched: self.state(&at_instant(latch_ns), latch_ns).motor,
            sequence: self.sequence,
        };
        let first_ns = self.now_ns;
        let mut sent = false;
        while self.now_ns < latch_ns + 5_000_000 {
            let due = if self.trigger_first {
                contact_ns - 2_000_000
            } else {
                latch_ns + 500_000
            };
            if !sent && self.now_ns >= due {
                self.send(Input::Trigger(trigger.clone()));
                sent = true;
            }
            let mut state = self.state(&at_instant(self.now_ns), self.now_ns);
            (self.spoil)(&mut state);
            self.send(Input::State(state));
            self.now_ns += 1_000_000;
        }
        assert!(sent && self.now_ns > first_ns);
        trigger
    }

    /// Touches a surface point.
    pub(crate) fn touch(
        &mut self,
        feature: &str,
        point_mm: Vector3<f64>,
        approach: Vector3<f64>,
        feed: f64,
    ) {
        self.touch_ball(feature, point_mm - approach * BALL_MM, approach, feed);
    }

    pub(crate) fn segment(&mut self, kind: TestKind, begin: bool, features: &[&str]) {
        let segment = TestSegment {
            begin,
            feed_mm_s: 2.0,
            stylus: String::from("ruby_6"),
            cold: true,
            features: features.iter().map(|&name| name.to_owned()).collect(),
            completed: !begin,
            ..TestSegment::of_kind(kind, 7, Stamp::from_nanos(self.now_ns))
        };
        self.send(Input::Segment(segment));
    }

    pub(crate) fn points(&self) -> Vec<ProbedPoint> {
        let points = self.out.iter().filter_map(|out| match out {
            Output::Point(point) => Some(point.clone()),
            _ => None,
        });
        points.collect()
    }

    pub(crate) fn only_point(&self) -> ProbedPoint {
        let [point] = &self.points()[..] else {
            panic!("{:?}", self.out);
        };
        point.clone()
    }

    pub(crate) fn blocks(&self) -> Vec<BlockMeasurement> {
        let blocks = self.out.iter().filter_map(|out| match out {
            Output::Block(block) => Some(block.clone()),
            _ => None,
        });
        blocks.collect()
    }

    pub(crate) fn feature(&self) -> ProbedFeature {
        let mut features = self.out.iter().filter_map(|out| match out {
            Output::Feature(feature) => Some(feature.clone()),
            _ => None,
        });
        features.next().unwrap_or_else(|| panic!("{:?}", self.out))
    }

    pub(crate) fn features(&self) -> Vec<ProbedFeature> {
        let features = self.out.iter().filter_map(|out| match out {
            Output::Feature(feature) => Some(feature.clone()),
            _ => None,
        });
        features.collect()
    }

    pub(crate) fn diagnostics(&self) -> Vec<String> {
        let texts = self.out.iter().filter_map(|out| match out {
            Output::Diagnostic(diagnostic) => Some(diagnostic.to_string()),
            _ => None,
        });
        texts.collect()
    }
}
