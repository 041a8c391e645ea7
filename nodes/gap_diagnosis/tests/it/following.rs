//! The stage follows a machine that is measured again and again, and tells what becomes of it.

use std::f64::consts::TAU;

use gap_diagnosis::session::Input::{Grid, Segment, State};
use gap_diagnosis::session::{SessionBuilder, SessionConfig};
use gap_diagnosis::stage::{self, GapDiagnosisStage, Input, Output};
use gap_diagnosis::{GapConfig, GapDiagnosisConfig, session};
use machine::MachineFile;
use metrology::sample::{
    AxisState, GapCause, GapStatus, GapSummary, GridSample, Sense, TestKind, TestPlane, TestSegment,
};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");
const TICK_NANOS: i64 = 5_000_000;
/// Feeds, mm/s, and turns of a test cycle, each circle twice.
const FEEDS: [f64; 2] = [25.0, 50.0];
const SENSES: [Sense; 2] = [Sense::CounterClockwise, Sense::Clockwise];
const CYCLE_RUNS: u32 = 8;
/// Harmonics of the deviation that each run has of its own, and its length about the circle.
const HARMONICS: usize = 8;
const LENGTH_RAD: f64 = 0.5;

/// A machine whose axes follow their commands but for play in X, and whose runs differ as those of real ones do.
struct Machine {
    stage: GapDiagnosisStage,
    file: MachineFile,
    /// What a recorder would hold.
    bag: SessionBuilder,
    nanos: i64,
    run: u32,
    noise: Pcg64Mcg,
    play_mm: f64,
    /// How far the slide of X stands off since a return to its reference.
    shift_mm: f64,
    /// How far the slide of X is off the motor.
    lag_mm: f64,
    x_mm: f64,
    /// How long no state comes in the midst of a circle.
    silence_nanos: i64,
    told: Vec<Output>,
}

impl Machine {
    fn new(config: GapDiagnosisConfig) -> Self {
        // The loop's own lag is no matter here.
        let text = MACHINE.replace("velocity_feedforward: 0.98", "velocity_feedforward: 1.0");
        let machine = MachineFile::parse(&text, "machine.yaml").expect("a machine file");
        Self {
            stage: GapDiagnosisStage::new(&config, &machine).expect("a stage"),
            bag: SessionBuilder::new(&machine, SessionConfig::default()).expect("a machine"),
            file: machine,
            nanos: 0,
            run: 0,
            noise: Pcg64Mcg::seed_from_u64(20_261_121),
            play_mm: 0.0,
            shift_mm: 0.0,
            lag_mm: 0.0,
            x_mm: 0.0,
            silence_nanos: 0,
            told: vec![],
        }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.noise)
    }

    fn step(&mut self, input: Input) {
        let at = Stamp::from_nanos(self.nanos);
        self.stage
            .step(at, input, &mut self.told)
            .expect("the stage goes on");
    }

    fn take(&mut self, sample: session::Input) {
        self.bag.take(sample.clone());
        self.step(Input::Sample(sample));
    }

    fn tick(&mut self, [x, y]: [f64; 2], deviation_mm: [f64; 2]) {
        let half_mm = 0.5 * self.play_mm;
        self.lag_mm = (self.lag_mm - (x - self.x_mm)).clamp(-half_mm, half_mm);
        self.x_mm = x;
        let mut commanded = PerAxis::default();
        (commanded[Axis::X], commanded[Axis::Y], commanded[Axis::Z]) = (x, y, 30.0);
        let at = Stamp::from_nanos(self.nanos);
        self.take(State(AxisState::standing(
            at,
            Stamp::from_nanos(self.nanos),
            AxisSet::XYZ,
            commanded,
        )));
        let noise = [self.normal(), self.normal()].map(|n| 2e-4 * n);
        self.take(Grid(GridSample {
            at,
            plane: TestPlane::Xy,
            u_mm: x + self.lag_mm + self.shift_mm + deviation_mm[0] + noise[0],
            v_mm: y + deviation_mm[1] + noise[1],
            zero_id: 1,
        }));
        self.nanos += TICK_NANOS;
    }

    /// One turn at a feed, a rest before it, and a smooth deviation that is this run's alone.
    fn circle(&mut self, feed_mm_s: f64, sense: Sense) {
        const RADIUS_MM: f64 = 50.0;
        let own: Vec<f64> = (0..4 * HARMONICS).map(|_| 1.5e-4 * self.normal()).collect();
        self.run += 1;
        for _ in 0..200 {
            self.tick([RADIUS_MM, 0.0], [0.0; 2]);
        }
        let segment = |run: u32, begin: bool| TestSegment {
            begin,
            plane: TestPlane::Xy,
            centre_mm: Vector3::new(0.0, 0.0, 30.0),
            radius_mm: RADIUS_MM,
            feed_mm_s,
            sense,
            zero_id: 1,
            setup_id: 1,
            features: vec!["middle".to_owned()],
            ..TestSegment::of_kind(TestKind::Circle, run, Stamp::from_nanos(0))
        };
        self.take(Segment(segment(self.run, true)));
        let turn = if sense == Sense::Clockwise { -1.0 } else { 1.0 };
        let rate = feed_mm_s / RADIUS_MM;
        // A quarter of a turn before and after the turn itself.
        let ticks = (1.5 * TAU / rate / (TICK_NANOS as f64 * 1e-9)).round() as u32;
        for k in 0..ticks {
            self.nanos += if k == ticks / 2 {
                self.silence_nanos
            } else {
                0
            };
            let angle = turn * rate * f64::from(k) * TICK_NANOS as f64 * 1e-9;
            let wave = |first: usize| {
                let harmonics = own[first..first + 2 * HARMONICS].chunks(2).zip(1..);
                harmonics
                    .map(|(pair, n)| {
                        let (sin, cos) = (angle * f64::from(n)).sin_cos();
                        let share = (-0.25 * (f64::from(n) * LENGTH_RAD).powi(2)).exp();
                        share * (pair[0] * cos + pair[1] * sin)
                    })
                    .sum()
            };
            let place = [RADIUS_MM * angle.cos(), RADIUS_MM * angle.sin()];
            self.tick(place, [wave(0), wave(2 * HARMONICS)]);
        }
        self.take(Segment(segment(self.run, false)));
        // The machine rests until the run is whole.
        for _ in 0..2_100_000_000 / TICK_NANOS {
            self.tick([RADIUS_MM, 0.0], [0.0; 2]);
        }
        self.step(Input::Tick);
    }

    fn cycle(&mut self) {
        for _ in 0..2 {
            for feed_mm_s in FEEDS {
                for sense in SENSES {
                    self.circle(feed_mm_s, sense);
                }
            }
        }
    }

    /// Effects that were told as new since the last look.
    fn new_effects(&mut self) -> Vec<String> {
        let told = std::mem::take(&mut self.told);
        told.into_iter()
            .filter_map(|output| match output {
                Output::NewEffect { effect, .. } => Some(effect),
                Output::NewRest { covariate } => Some(format!("rest {covariate}")),
                _ => None,
            })
            .collect()
    }

    fn last_report(&self) -> &GapSummary {
        let reports = self.told.iter().rev();
        let mut reports = reports.filter_map(|output| match output {
            Output::Report(report) => Some(report.as_ref()),
            _ => None,
        });
        reports.next().expect("a report")
    }

    /// The last report, and what a diagnosis of the whole bag says.
    fn live_and_in_the_bag(&self, config: &GapDiagnosisConfig) -> [GapSummary; 2] {
        let (session, _) = self.bag.clone().finish().expect("a session");
        let config = GapConfig {
            stations: config.stations_per_pass,
            significance_draws: config.draws_of_significance,
            bootstrap_draws: config.draws_of_intervals,
            ..GapConfig::default()
        };
        let found = gap_diagnosis::diagnose(&self.file, &session, &config).expect("a diagnosis");
        let runs = session.runs.iter().map(|run| run.segment.run).collect();
        let in_bag = stage::summary(Stamp::from_nanos(self.nanos), runs, &found.report);
        [self.last_report().clone(), in_bag]
    }

    /// Causes of the last report, whatever their status.
    fn causes(&self) -> Vec<String> {
        let causes = self.last_report().causes.iter();
        causes.map(|c| format!("{} {}", c.effect, c.axis)).collect()
    }

    fn reports(&self) -> usize {
        let is_report = |output: &&Output| matches!(output, Output::Report(_));
        self.told.iter().filter(is_report).count()
    }
}

fn config() -> GapDiagnosisConfig {
    GapDiagnosisConfig {
        cycle_runs: CYCLE_RUNS as usize,
        least_runs: CYCLE_RUNS as usize,
        least_period_s: 60.0,
        stations_per_pass: 60,
        draws_of_significance: 99,
        draws_of_intervals: 100,
        ..GapDiagnosisConfig::default()
    }
}

#[test]
fn play_that_develops_is_the_first_cause_within_one_cycle_and_told_of_once() {
    let mut machine = Machine::new(config());
    for _ in 0..3 {
        machine.cycle();
    }
    assert!(machine.reports() >= 3, "{}", machine.reports());
    assert_eq!(machine.new_effects(), [""; 0]);
    machine.play_mm = 4e-3;
    machine.cycle();
    assert_eq!(machine.causes()[0], "backlash X");
    let last = machine.last_report();
    let width_um = last.causes[0].parameters[0].value;
    assert!((width_um - 4.0).abs() < 0.4, "{width_um}");
    let [live, in_bag] = machine.live_and_in_the_bag(&config());
    let named = |of: &GapSummary| -> Vec<String> {
        let named = { of.causes.iter() }.filter(|cause| cause.status == GapStatus::Named);
        named.map(|c| format!("{} {}", c.effect, c.axis)).collect()
    };
    assert_eq!(live.runs, in_bag.runs);
    assert_eq!(named(&in_bag), ["backlash X"]);
    assert_eq!(named(&live), named(&in_bag));
    let width_um = |of: &GapSummary| of.causes[0].parameters[0].value;
    let apart_um = width_um(&live) - width_um(&in_bag);
    assert!(apart_um.abs() < 0.05, "{apart_um}");
    let mut told = machine.new_effects();
    machine.cycle();
    assert_eq!(machine.causes()[0], "backlash X");
    told.extend(machine.new_effects());
    assert_eq!(told, ["backlash X"]);
    // What is there, goes and comes back is no news; what has grown is.
    for (play_mm, news) in [(0.0, 0), (4e-3, 0), (8e-3, 1)] {
        machine.play_mm = play_mm;
        machine.cycle();
        machine.cycle();
        let told = machine.new_effects();
        let of_play = told.iter().filter(|effect| *effect == "backlash X");
        assert_eq!(of_play.count(), news, "{play_mm} {told:?}");
    }
}

#[test]
fn a_machine_that_stays_as_it_is_gives_reports_and_no_warning() {
    let mut machine = Machine::new(config());
    for _ in 0..6 {
        machine.cycle();
    }
    assert!(machine.reports() >= 6);
    assert_eq!(machine.new_effects(), [""; 0]);
}

#[test]
fn a_run_that_is_left_out_is_told_of_at_once_though_no_diagnosis_is_due() {
    let mut machine = Machine::new(config());
    machine.silence_nanos = 500_000_000;
    machine.circle(FEEDS[0], SENSES[0]);
    assert_eq!(machine.reports(), 0);
    let remarks = machine.told.iter().filter_map(|output| match output {
        Output::LeftOut(remarks) => Some(remarks.join("; ")),
        _ => None,
    });
    let remarks: Vec<String> = remarks.collect();
    let wanted = "1 runs lack axis states in the midst of their motion and are left out";
    assert!(
        remarks.len() == 1 && remarks[0].starts_with(wanted),
        "{remarks:?}"
    );
}

/// States of other machines: axes that this one lacks or has not, places outside of its travel, other names of axes.
fn strangers(at: Stamp<metrology::Host>) -> Vec<AxisState> {
    let state = |axes: AxisSet, place: [f64; 6]| {
        AxisState::standing(at, Stamp::from_nanos(at.nanos()), axes, PerAxis(place))
    };
    let of = |axes: &[Axis]| axes.iter().copied().collect::<AxisSet>();
    vec![
        state(of(&[Axis::X]), [0.0; 6]),
        state(of(&[Axis::X, Axis::Y]), [0.0; 6]),
        state(of(&[Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C]), [0.0; 6]),
        state(of(&[]), [0.0; 6]),
        state(AxisSet::XYZ, [5e4, 0.0, 30.0, 0.0, 0.0, 0.0]),
        state(AxisSet::XYZ, [0.0, -5e4, 30.0, 0.0, 0.0, 0.0]),
        state(AxisSet::XYZ, [0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0]),
    ]
}

#[test]
fn states_of_another_machine_are_left_out_and_reported_once_and_the_diagnosis_goes_on() {
    let half = |machine: &mut Machine| {
        for (feed_mm_s, sense) in FEEDS
            .iter()
            .flat_map(|feed| SENSES.map(|sense| (*feed, sense)))
        {
            machine.circle(feed_mm_s, sense);
        }
    };
    let mut undisturbed = Machine::new(config());
    undisturbed.cycle();
    for kind in 0..strangers(Stamp::from_nanos(0)).len() {
        let mut machine = Machine::new(config());
        let meet = |machine: &mut Machine| {
            let stranger = strangers(Stamp::from_nanos(machine.nanos)).swap_remove(kind);
            machine.take(State(stranger));
        };
        // Before the first state of its own, between runs, and as one of several.
        meet(&mut machine);
        half(&mut machine);
        meet(&mut machine);
        meet(&mut machine);
        half(&mut machine);
        let is_reported = |output: &&Output| matches!(output, Output::OtherMachine(_));
        assert_eq!(machine.told.iter().filter(is_reported).count(), 1, "{kind}");
        assert_eq!(machine.reports(), undisturbed.reports(), "{kind}");
        let [found, wanted] = [&machine, &undisturbed].map(Machine::last_report);
        assert_eq!(
            (&found.runs, &found.json),
            (&wanted.runs, &wanted.json),
            "{kind}"
        );
        let counted = machine.told.iter().any(|output| {
            matches!(output, Output::LeftOut(remarks)
                if remarks.iter().any(|one| one.contains("axis states were of another machine")))
        });
        assert!(counted, "{kind}");
    }
}

#[test]
fn while_a_diagnosis_is_made_beside_samples_are_taken_and_none_is_begun() {
    let mut machine = Machine::new(config());
    machine.stage.go_beside();
    machine.cycle();
    let due = |told: &mut Vec<Output>| -> Vec<_> {
        let told = std::mem::take(told);
        told.into_iter()
            .filter_map(|output| match output {
                Output::Due(task) => Some(task),
                _ => None,
            })
            .collect()
    };
    let mut tasks = due(&mut machine.told);
    assert_eq!(tasks.len(), 1);
    machine.cycle();
    assert_eq!(due(&mut machine.told).len(), 0);
    let finding = tasks.remove(0).run();
    machine.step(Input::Found(Box::new(finding)));
    let runs = machine.told.iter().find_map(|output| match output {
        Output::Report(report) => Some(report.runs.clone()),
        _ => None,
    });
    assert_eq!(runs, Some((1..=CYCLE_RUNS).collect()));
    // The runs that were measured meanwhile are in the next one.
    machine.nanos += 60_000_000_000;
    machine.step(Input::Tick);
    let finding = due(&mut machine.told).remove(0).run();
    machine.step(Input::Found(Box::new(finding)));
    let runs = machine.told.iter().find_map(|output| match output {
        Output::Report(report) => Some(report.runs.clone()),
        _ => None,
    });
    // Nothing has been repeated three times before the last cycle yet.
    assert_eq!(runs, Some((1..=2 * CYCLE_RUNS).collect()));
}

impl Machine {
    /// A diagnosis that was given out comes back.
    fn come_back(&mut self) {
        let is_due = |output: &Output| matches!(output, Output::Due(_));
        if let Some(due) = self.told.iter().position(is_due)
            && let Output::Due(task) = self.told.remove(due)
        {
            self.step(Input::Found(Box::new(task.run())));
            self.step(Input::Tick);
        }
    }
}

/// A busy computer makes diagnoses when it can: each is of the runs that were there when the one before came back.
#[test]
fn play_that_sets_in_is_the_first_that_is_told_of_whichever_runs_are_diagnosed() {
    for back_after in [&[6, 7, 8, 9, 10, 11][..], &[7, 9, 11], &[8, 10], &[8]] {
        let mut machine = Machine::new(GapDiagnosisConfig {
            cycle_runs: 6,
            least_runs: 6,
            least_period_s: 0.0,
            ..config()
        });
        machine.stage.go_beside();
        for run in 1..=12 {
            machine.play_mm = if run > 6 { 5.6e-3 } else { 0.0 };
            let is_second = (run - 1) / 3 % 2 == 1;
            machine.circle(40.0, SENSES[usize::from(is_second)]);
            if back_after.contains(&run) {
                machine.come_back();
            }
        }
        machine.come_back();
        machine.come_back();
        assert_eq!(machine.last_report().runs.last(), Some(&12));
        let told = machine.new_effects();
        assert_eq!(told, ["backlash X"], "{back_after:?}");
    }
}

/// A few runs after any change of a machine may look like a step.
#[test]
fn what_sets_in_at_an_instant_is_told_of_only_where_runs_before_it_say_what_noise_is() {
    for (cycle_runs, news) in [(12, &[][..]), (6, &["homing_shift X"])] {
        let mut machine = Machine::new(GapDiagnosisConfig {
            cycle_runs,
            least_runs: 6,
            least_period_s: 0.0,
            ..config()
        });
        let mut is_named = false;
        for run in 1..=12 {
            machine.shift_mm = if run > 6 { -5e-3 } else { 0.0 };
            let is_second = (run - 1) / 3 % 2 == 1;
            machine.circle(40.0, SENSES[usize::from(is_second)]);
            let named = |c: &GapCause| c.effect == "homing_shift" && c.status == GapStatus::Named;
            is_named |= run >= 6 && machine.last_report().causes.iter().any(named);
        }
        assert!(is_named);
        assert_eq!(machine.new_effects(), news, "{cycle_runs}");
    }
}
