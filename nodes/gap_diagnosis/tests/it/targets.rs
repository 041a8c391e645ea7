//! Tables of ISO 230-2: smooth lead errors of any shape and a lost motion, read at a few targets up and down.

use std::f64::consts::TAU;

use gap_diagnosis::report::{Cause, Status};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{Diagnosis, GapConfig, diagnose};
use machine::MachineFile;
use metrology::sample::{AxisState, LengthSample, TestKind, TestSegment};
use metrology::stamp::Host;
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");
const FEED_MM_S: f64 = 100.0;
const TICK_MS: i64 = 10;
const RUNS: u32 = 5;
/// Axes of which the tables are drawn; false names among them, at most one in a hundred.
const TABLES: u64 = 100;

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").expect("the scenario's machine file")
}

/// An axis with its errors, mm: waves no shorter than half of what is measured, and a lost motion.
struct Plant {
    waves: Vec<[f64; 3]>,
    lost_mm: f64,
    targets_mm: Vec<f64>,
    random: Pcg64Mcg,
}

impl Plant {
    fn drawn(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let n: u32 = random.random_range(5..=41);
        let extent_mm: f64 = random.random_range(200.0..560.0);
        let spacing_mm = extent_mm / f64::from(n - 1);
        let target = |k: u32, off: f64| -0.5 * extent_mm + (f64::from(k) + off) * spacing_mm;
        let targets_mm = (0..n)
            .map(|k| target(k, random.random_range(-0.15..0.15)))
            .collect();
        let waves = (0..3)
            .map(|_| {
                let length_mm = extent_mm * random.random_range(0.5..3.0);
                [
                    random.random_range(1e-3..8e-3),
                    TAU / length_mm,
                    random.random_range(0.0..TAU),
                ]
            })
            .collect();
        Self {
            waves,
            lost_mm: random.random_range(3e-3..20e-3),
            targets_mm,
            random,
        }
    }

    fn lead_mm(&self, at_mm: f64) -> f64 {
        let wave = |[height, per_mm, phase]: &[f64; 3]| height * (per_mm * at_mm + phase).sin();
        self.waves.iter().map(wave).sum()
    }

    fn reading_mm(&mut self, at_mm: f64, sense: f64) -> f64 {
        let noise: f64 = self.random.sample(StandardNormal);
        at_mm + self.lead_mm(at_mm) - 0.5 * sense * self.lost_mm + 0.2e-3 * noise
    }
}

/// The test as a recording.
struct Table {
    builder: SessionBuilder,
    millis: i64,
    x_mm: f64,
}

impl Table {
    fn now(&self) -> Stamp<Host> {
        Stamp::from_nanos(1_767_600_000_000_000_000 + self.millis * 1_000_000)
    }

    fn tick(&mut self) {
        let mut position = PerAxis::default();
        (position[Axis::X], position[Axis::Z]) = (self.x_mm, 120.0);
        let at = self.now();
        self.builder.take(Input::State(AxisState::standing(
            at,
            Stamp::from_nanos(at.nanos()),
            AxisSet::XYZ,
            position,
        )));
    }

    fn rest(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.tick();
            self.millis += TICK_MS;
        }
    }

    fn go(&mut self, to_mm: f64) {
        let step_mm = FEED_MM_S * 1e-3 * TICK_MS as f64;
        while (to_mm - self.x_mm).abs() > step_mm {
            self.x_mm += step_mm * (to_mm - self.x_mm).signum();
            self.rest(1);
        }
        self.x_mm = to_mm;
        self.rest(1);
    }

    fn segment(&mut self, run: u32, begin: bool, stations: usize) {
        let at = self.now();
        self.builder.take(Input::Segment(TestSegment {
            begin,
            feed_mm_s: FEED_MM_S,
            repeat: run - 1,
            stations: u32::try_from(stations).expect("few"),
            zero_id: 1,
            setup_id: 1,
            features: vec!["X".to_owned()],
            ..TestSegment::of_kind(TestKind::Positioning, run, at)
        }));
    }

    fn stop(&mut self, displacement_mm: f64) {
        self.rest(110);
        for _ in 0..5 {
            self.tick();
            let at = self.now();
            self.builder.take(Input::Length(LengthSample {
                at,
                axis: Axis::X,
                displacement_mm,
                zero_id: 1,
            }));
            self.millis += TICK_MS;
        }
    }
}

fn measured(plant: &mut Plant) -> Diagnosis {
    let machine = machine();
    let targets_mm = plant.targets_mm.clone();
    let mut table = Table {
        builder: SessionBuilder::new(&machine, SessionConfig::default()).expect("a machine"),
        millis: 0,
        x_mm: targets_mm[0] - 5.0,
    };
    for run in 1..=RUNS {
        table.rest(200);
        table.segment(run, true, 2 * targets_mm.len());
        table.go(targets_mm[0] - 5.0);
        for &target_mm in &targets_mm {
            table.go(target_mm);
            let read_mm = plant.reading_mm(target_mm, 1.0);
            table.stop(read_mm);
        }
        table.go(targets_mm[targets_mm.len() - 1] + 5.0);
        for &target_mm in targets_mm.iter().rev() {
            table.go(target_mm);
            let read_mm = plant.reading_mm(target_mm, -1.0);
            table.stop(read_mm);
        }
        table.segment(run, false, 2 * targets_mm.len());
    }
    let (session, account) = table.builder.finish().expect("a session");
    assert_eq!(account.runs, 5, "{account:?}");
    diagnose(&machine, &session, &GapConfig::default()).expect("a diagnosis")
}

fn is_named(cause: &&Cause) -> bool {
    cause.status != Status::Surrogate
}

/// What is true of every plant, or what a table of one axis cannot separate from it.
fn is_true(cause: &Cause) -> bool {
    let truths = ["pitch_error", "scale_error", "backlash"];
    let is_truth = |effect: &str, axis: &str| axis == "X" && truths.contains(&effect);
    let mut others = cause.confusable_with.iter().filter(|other| !other.excluded);
    is_truth(&cause.effect, &cause.axis) || others.any(|other| is_truth(&other.effect, &other.axis))
}

#[test]
fn smooth_lead_errors_get_no_false_name_and_their_lost_motion_its_size() {
    let (mut wrong, mut lost, mut curves) = (vec![], 0, 0);
    for seed in 0..TABLES {
        let mut plant = Plant::drawn(seed);
        let diagnosis = measured(&mut plant);
        let named = || diagnosis.report.causes.iter().filter(is_named);
        wrong.extend(named().filter(|cause| !is_true(cause)).map(|cause| {
            let targets = plant.targets_mm.len();
            format!("{seed}: {} {}, {targets} targets", cause.effect, cause.axis)
        }));
        let play = named().find(|cause| cause.effect == "backlash");
        let width_um = play.and_then(|play| play.parameters.first());
        lost += usize::from(
            width_um.is_some_and(|width| (width.value - 1e3 * plant.lost_mm).abs() < 0.5),
        );
        let of_lead = |cause: &Cause| ["pitch_error", "scale_error"].contains(&&*cause.effect);
        curves += usize::from(named().any(of_lead));
    }
    let few = usize::try_from(TABLES).expect("few");
    assert!(100 * wrong.len() <= few, "{wrong:?}");
    assert!(10 * lost >= 9 * few, "{lost} of {few} lost motions");
    assert!(10 * curves >= 9 * few, "{curves} of {few} lead errors");
}
