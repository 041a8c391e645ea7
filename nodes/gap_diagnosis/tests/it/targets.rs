//! Tables of ISO 230-2: smooth lead errors of any shape and a lost motion, read at a few targets up and down.

use std::f64::consts::TAU;

use gap_diagnosis::report::figures::Note;
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
/// Axes of which the tables are drawn; false names among them, at most one in a hundred.
const TABLES: u64 = 100;

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").expect("the scenario's machine file")
}

/// An axis with its errors, mm: waves no shorter than half of what is measured, and a lost motion.
struct Plant {
    waves: Vec<[f64; 3]>,
    lost_mm: f64,
    /// What the lost motion has more in the middle than at both ends.
    worn_mm: f64,
    rate_mm_per_s: f64,
    /// A set-up that settles by so much, to half of it after so many seconds.
    settles: [f64; 2],
    /// Standard deviation of what runs are apart.
    apart_mm: f64,
    /// What this run is off by.
    off_mm: f64,
    noise_mm: f64,
    runs: u32,
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
            worn_mm: 0.0,
            rate_mm_per_s: 0.0,
            settles: [0.0, 1.0],
            apart_mm: 0.0,
            off_mm: 0.0,
            noise_mm: 0.2e-3,
            runs: 5,
            targets_mm,
            random,
        }
    }

    fn lead_mm(&self, at_mm: f64) -> f64 {
        let wave = |[height, per_mm, phase]: &[f64; 3]| height * (per_mm * at_mm + phase).sin();
        self.waves.iter().map(wave).sum()
    }

    /// Of a short part of the travel, 40 to 100 mm, with a lead error that is ten times as high and has shorter waves.
    fn short(seed: u64) -> Self {
        let mut short = Self::drawn(seed);
        let [first, last] = [0, short.targets_mm.len() - 1].map(|k| short.targets_mm[k]);
        let extent_mm = short.random.random_range(40.0..100.0);
        for at_mm in &mut short.targets_mm {
            *at_mm *= extent_mm / (last - first);
        }
        for [height_mm, per_mm, _] in &mut short.waves {
            *height_mm *= 5.0;
            *per_mm *= (last - first) / extent_mm;
        }
        short
    }

    /// Lost motion from the middle of the travel to the targets farthest from it: a wedge, which is no polynomial.
    fn play_mm(&self, at_mm: f64) -> f64 {
        let farthest_mm = self
            .targets_mm
            .iter()
            .fold(1.0_f64, |most, at| most.max(at.abs()));
        self.lost_mm + self.worn_mm * (1.0 - at_mm.abs() / farthest_mm)
    }

    fn mean_play_um(&self) -> f64 {
        let all = self.targets_mm.iter().map(|at| 1e3 * self.play_mm(*at));
        all.sum::<f64>() / self.targets_mm.len() as f64
    }

    fn reading_mm(&mut self, at_mm: f64, sense: f64, millis: i64) -> f64 {
        let noise: f64 = self.random.sample(StandardNormal);
        let at_s = 1e-3 * millis as f64;
        let [settles_mm, half_s] = self.settles;
        let drifted_mm = self.rate_mm_per_s * at_s + settles_mm * at_s / (at_s + half_s);
        let read_mm = at_mm + self.lead_mm(at_mm) - 0.5 * sense * self.play_mm(at_mm);
        read_mm + drifted_mm + self.off_mm + self.noise_mm * noise
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
    measured_with(plant, &GapConfig::default())
}

fn measured_with(plant: &mut Plant, config: &GapConfig) -> Diagnosis {
    let machine = machine();
    let targets_mm = plant.targets_mm.clone();
    let mut table = Table {
        builder: SessionBuilder::new(&machine, SessionConfig::default()).expect("a machine"),
        millis: 0,
        x_mm: targets_mm[0] - 5.0,
    };
    for run in 1..=plant.runs {
        if plant.apart_mm > 0.0 {
            let apart: f64 = plant.random.sample(StandardNormal);
            plant.off_mm = plant.apart_mm * apart;
        }
        table.rest(200);
        table.segment(run, true, 2 * targets_mm.len());
        table.go(targets_mm[0] - 5.0);
        for &target_mm in &targets_mm {
            table.go(target_mm);
            let read_mm = plant.reading_mm(target_mm, 1.0, table.millis);
            table.stop(read_mm);
        }
        table.go(targets_mm[targets_mm.len() - 1] + 5.0);
        for &target_mm in targets_mm.iter().rev() {
            table.go(target_mm);
            let read_mm = plant.reading_mm(target_mm, -1.0, table.millis);
            table.stop(read_mm);
        }
        table.segment(run, false, 2 * targets_mm.len());
    }
    let (session, account) = table.builder.finish().expect("a session");
    assert_eq!(account.runs, plant.runs as usize, "{account:?}");
    diagnose(&machine, &session, config).expect("a diagnosis")
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

/// False names, and how many have their lead error and their lost motion within a limit, of some axes.
fn named_of(plants: impl Iterator<Item = Plant>, within_um: f64) -> (Vec<String>, [usize; 2]) {
    let (mut wrong, mut found) = (vec![], [0, 0]);
    for (n, mut plant) in plants.enumerate() {
        let diagnosis = measured(&mut plant);
        let named = || diagnosis.report.causes.iter().filter(is_named);
        wrong.extend({ named() }.filter(|cause| !is_true(cause)).map(|cause| {
            let targets = plant.targets_mm.len();
            format!("{n}: {} {}, {targets} targets", cause.effect, cause.axis)
        }));
        let of_lead = |cause: &Cause| ["pitch_error", "scale_error"].contains(&&*cause.effect);
        found[0] += usize::from(named().any(of_lead));
        let play = named().find(|cause| cause.effect == "backlash");
        let width_um = play.and_then(|play| play.parameters.first());
        let off_um = |width: f64| (width - plant.mean_play_um()).abs();
        found[1] += usize::from(width_um.is_some_and(|width| off_um(width.value) < within_um));
    }
    (wrong, found)
}

#[test]
fn a_lead_error_over_a_short_part_of_the_travel_has_the_shape_of_its_targets() {
    let (wrong, [curves, lost]) = named_of((0..30).map(Plant::short), 0.8);
    assert_eq!(wrong, Vec::<String>::new());
    assert!(curves >= 27, "{curves} of 30 lead errors");
    assert!(lost >= 27, "{lost} of 30 lost motions");
}

/// A wave with the screw's lead of 10 mm, at targets 20 to 60 mm apart: it may be a curve, and a curve may be it.
#[test]
fn an_error_of_the_screws_period_at_coarse_targets_is_one_of_a_set() {
    let mut found = 0;
    for seed in 0..12 {
        let mut plant = Plant::drawn(seed);
        let targets = plant.random.random_range(8..16_u32);
        let mut at = |k: u32| {
            let off: f64 = plant.random.random_range(-0.2..0.2);
            -280.0 + 37.0 * (f64::from(k) + off)
        };
        plant.targets_mm = (0..targets).map(&mut at).collect();
        plant.waves = vec![[6e-3, TAU / 10.0, 0.7]];
        let diagnosis = measured(&mut plant);
        for cause in diagnosis.report.causes.iter().filter(is_named) {
            let is_curve = cause.effect == "pitch_error";
            let mut open = cause.confusable_with.iter().filter(|it| !it.excluded);
            let lists = open.any(|other| other.effect == "cyclic_error");
            assert!(
                !is_curve || (cause.status == Status::Set && lists),
                "{seed}: {cause:?}"
            );
            assert_ne!(cause.effect, "cyclic_error", "{seed}: {cause:?}");
            found += usize::from(is_curve);
        }
    }
    assert!(found >= 10, "{found} of 12");
}

#[test]
fn a_single_run_has_its_lead_error_and_its_lost_motion() {
    let single = |seed| Plant {
        runs: 1,
        ..Plant::drawn(seed)
    };
    let (wrong, [curves, lost]) = named_of((0..30).map(single), 1.0);
    assert_eq!(wrong, Vec::<String>::new());
    // Few targets know their noise from few differences only.
    assert!(curves >= 20, "{curves} of 30 lead errors");
    assert!(lost >= 20, "{lost} of 30 lost motions");
}

#[test]
fn a_drift_and_a_worn_screw_are_found_beside_a_large_lead_error() {
    for seed in 0..8 {
        let mut plant = Plant::drawn(seed);
        (plant.lost_mm, plant.worn_mm) = (16e-3, 18e-3);
        plant.rate_mm_per_s = -1e-3 / 60.0;
        for wave in &mut plant.waves {
            wave[0] *= 5.0;
        }
        let diagnosis = measured(&mut plant);
        let causes = &diagnosis.report.causes;
        let size = |effect: &str| {
            let named = causes.iter().filter(is_named);
            let found = named.filter(|cause| cause.effect == effect);
            found
                .flat_map(|cause| &cause.parameters)
                .map(|p| p.value)
                .next()
        };
        let near = |effect: &str, wanted: f64, within: f64| {
            let found = size(effect);
            let holds = found.is_some_and(|value| (value - wanted).abs() < within);
            assert!(
                holds,
                "{seed}: {effect} {found:?}, not {wanted}: {causes:?}"
            );
        };
        near("backlash", plant.mean_play_um(), 1.5);
        near("ambient_drift", -60.0, 9.0);
        assert!(size("pitch_error").is_some(), "{seed}: {causes:?}");
        let varies = diagnosis.notes.iter().find_map(|note| match note {
            Note::Varies { from_um, to_um, .. } => Some([*from_um, *to_um]),
            _ => None,
        });
        let [from_um, to_um] = varies.expect("a note");
        assert!((from_um - 16.0).abs() < 3.0, "{from_um}");
        assert!((to_um - 34.0).abs() < 4.0, "{to_um}");
    }
}

/// Whether a slow drift of X is named.
fn drifts(diagnosis: &Diagnosis) -> bool {
    let mut named = diagnosis.report.causes.iter().filter(is_named);
    named.any(|cause| (cause.effect.as_str(), cause.axis.as_str()) == ("ambient_drift", "X"))
}

/// A set-up that settles, by a law that no effect has: to half of 12 µm within a run.
#[test]
fn a_drift_that_settles_is_named_in_three_runs_and_in_five() {
    for runs in [3, 5] {
        let mut found = 0;
        for seed in 0..12 {
            let settling = Plant {
                runs,
                settles: [12e-3, 60.0],
                ..Plant::drawn(seed)
            };
            found += usize::from(drifts(&measured(&mut { settling })));
        }
        assert!(found >= 10, "{found} of 12 with {runs} runs");
    }
}

#[test]
fn runs_that_are_apart_without_a_course_are_no_drift() {
    for runs in [2, 3, 4, 5] {
        let named = (0..25).filter(|seed| {
            let apart = Plant {
                runs,
                apart_mm: 1e-3,
                ..Plant::drawn(*seed)
            };
            drifts(&measured(&mut { apart }))
        });
        let named = named.count();
        assert!(named <= 1, "{named} of 25 with {runs} runs");
    }
}

#[test]
fn errors_of_the_place_may_be_a_drift_where_the_order_is_not_known() {
    let config = GapConfig {
        is_order_known: false,
        ..GapConfig::default()
    };
    let mut found = 0;
    for seed in 0..8 {
        let diagnosis = measured_with(&mut Plant::drawn(seed), &config);
        for cause in diagnosis.report.causes.iter().filter(is_named) {
            let of_place = ["scale_error", "pitch_error"].contains(&&*cause.effect);
            let mut open = cause.confusable_with.iter().filter(|it| !it.excluded);
            let lists = open.any(|other| other.effect == "ambient_drift");
            assert_eq!(lists, of_place, "{seed}: {cause:?}");
            found += usize::from(of_place);
        }
    }
    assert!(found >= 6, "{found}");
}

/// Targets that are each off by an amount of its own are no curve: the lost motion beside them is named all the same.
#[test]
fn a_lost_motion_beside_errors_without_a_form_is_named_where_every_run_is_a_repeat() {
    let mut found = 0;
    for seed in 0..8 {
        let mut plant = Plant::drawn(seed);
        plant.targets_mm = (0..31).map(|k| -270.0 + 18.0 * f64::from(k)).collect();
        // Waves of less than three targets.
        plant.waves = vec![[0.4e-3, TAU / 41.0, 0.4], [0.3e-3, TAU / 47.0, 1.9]];
        (plant.lost_mm, plant.runs) = (12e-3, 3);
        let diagnosis = measured(&mut plant);
        let mut named = diagnosis.report.causes.iter().filter(is_named);
        found += usize::from(named.any(|cause| cause.effect == "backlash"));
    }
    assert!(found >= 7, "{found} of 8");
}

/// A table of so many readings shows a settling of 0.19 µm within its first minutes, and no simulator is right to that.
#[test]
fn what_wanders_by_less_than_a_simulator_is_off_by_is_not_named_from_however_many_readings() {
    for (runs, half_s) in [(3, 15.0), (5, 40.0)] {
        let mut settling = Plant {
            waves: vec![],
            lost_mm: 0.0,
            settles: [-0.19e-3, half_s],
            noise_mm: 0.01e-3,
            runs,
            targets_mm: (0..241).map(|k| 2.0 * f64::from(k) - 240.0).collect(),
            ..Plant::drawn(3)
        };
        let diagnosis = measured(&mut settling);
        let mut named = diagnosis.report.causes.iter().filter(is_named);
        assert_eq!(named.next(), None);
    }
}
