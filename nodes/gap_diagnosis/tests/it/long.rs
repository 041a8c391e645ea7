//! A recording of ten hours: what is held of it stays bounded, and a play is named.

use std::f64::consts::TAU;

use gap_diagnosis::report::Status;
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{GapConfig, Note, diagnose};
use machine::MachineFile;
use metrology::sample::{
    AxisState, GridSample, Sense, TemperatureSample, TestKind, TestPlane, TestSegment,
};
use metrology::stamp::Host;
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::Session;

const MACHINE: &str = include_str!("../../../../launch_configs/grid_xy/machine.yaml");
/// Circles, and the time from one to the next, s: ten hours.
const RUNS: usize = 480;
const EVERY_S: f64 = 75.0;
/// States and readings a second while the axes move, states while they stand.
const MOVING_HZ: f64 = 250.0;
const STANDING_HZ: f64 = 10.0;
/// Radius and feed, turn by turn; each in both senses.
const CONDITIONS: [(f64, f64); 3] = [(50.0, 50.0), (80.0, 80.0), (50.0, 90.0)];
const PLAY_MM: f64 = 4e-3;
/// Angle before the first reading and after the last.
const LEAD: f64 = 0.4;

fn stamp(time_s: f64) -> Stamp<Host> {
    Stamp::from_nanos((time_s * 1e9).round() as i64 + 1_767_600_000_000_000_000)
}

/// The recording, sample by sample.
struct Shift {
    builder: SessionBuilder,
    noise: Pcg64Mcg,
    samples: usize,
}

impl Shift {
    fn take(&mut self, input: Input) {
        self.samples += 1;
        self.builder.take(input);
    }

    fn normal(&mut self, size: f64) -> f64 {
        let normal: f64 = StandardNormal.sample(&mut self.noise);
        size * normal
    }

    fn state(&mut self, time_s: f64, [x, y]: [f64; 2]) {
        let mut commanded = PerAxis::default();
        (commanded[Axis::X], commanded[Axis::Y], commanded[Axis::Z]) = (x, y, 30.0);
        self.take(Input::State(AxisState::standing(
            stamp(time_s),
            Stamp::from_nanos(stamp(time_s).nanos()),
            AxisSet::XYZ,
            commanded,
        )));
    }

    fn segment(&mut self, run: u32, begin: bool, time_s: f64) {
        let (radius_mm, feed_mm_s) = condition(run);
        let sense = if run.is_multiple_of(2) {
            Sense::CounterClockwise
        } else {
            Sense::Clockwise
        };
        self.take(Input::Segment(TestSegment {
            at: stamp(time_s),
            run: run + 1,
            begin,
            kind: TestKind::Circle,
            plane: TestPlane::Xy,
            centre_mm: Vector3::new(0.0, 0.0, 30.0),
            radius_mm,
            feed_mm_s,
            sense,
            repeat: run / 6,
            stylus: String::new(),
            tool_offset_mm: Vector3::zeros(),
            stations: 0,
            zero_id: 1,
            setup_id: 1,
            cold: false,
            features: vec!["middle".to_owned()],
            completed: true,
        }));
    }

    /// One circle, and the machine standing until the next.
    fn run(&mut self, run: u32, start_s: f64) {
        let (radius_mm, feed_mm_s) = condition(run);
        let turn = if run.is_multiple_of(2) { 1.0 } else { -1.0 };
        let omega = feed_mm_s / radius_mm;
        // Waves of what no two runs have in common.
        let own: [f64; 6] = std::array::from_fn(|_| self.normal(0.1e-3));
        self.segment(run, true, start_s);
        let ticks = ((TAU + 2.0 * LEAD) / omega * MOVING_HZ) as u32;
        let place = |angle: f64| [radius_mm * angle.cos(), radius_mm * angle.sin()];
        let (mut time_s, mut angle) = (start_s, 0.0);
        for tick in 0..ticks {
            time_s = start_s + f64::from(tick) / MOVING_HZ;
            angle = turn * (omega * (time_s - start_s) - LEAD);
            self.state(time_s, place(angle));
            if (0.0..=TAU).contains(&(angle * turn)) {
                self.read(time_s, angle, turn * omega, radius_mm, &own);
            }
        }
        self.segment(run, false, time_s);
        while time_s + 1.0 / STANDING_HZ < start_s + EVERY_S {
            time_s += 1.0 / STANDING_HZ;
            self.state(time_s, place(angle));
        }
        self.take(Input::Temperature(TemperatureSample {
            at: stamp(time_s),
            sensor: "bed".to_owned(),
            temperature_degc: 20.0,
            variance_k2: 0.0,
        }));
    }

    fn read(&mut self, time_s: f64, angle: f64, omega: f64, radius_mm: f64, own: &[f64; 6]) {
        let (sin, cos) = angle.sin_cos();
        let here = [radius_mm * cos, radius_mm * sin];
        let behind_mm = following_mm(here, [-omega * here[1], omega * here[0]], omega);
        let wave =
            |k: usize| own[3 * k] + own[3 * k + 1] * sin + own[3 * k + 2] * (2.0 * angle).cos();
        let [u_off, v_off] = [0, 1].map(|k| behind_mm[k] + wave(k) + self.normal(0.2e-3));
        self.take(Input::Grid(GridSample {
            at: stamp(time_s),
            plane: TestPlane::Xy,
            u_mm: here[0] + played_mm(radius_mm, angle, omega.signum()) + u_off,
            v_mm: here[1] + v_off,
            zero_id: 1,
        }));
    }
}

/// What the loops of the machine file leave on a circle: gain 60/s, 98 % of velocity feed-forward, each axis
/// -0.02 s / (60 + s) of its command.
fn following_mm(here: [f64; 2], velocity: [f64; 2], omega: f64) -> [f64; 2] {
    let (gain, left) = (60.0, 0.02);
    let size = left / (gain * gain + omega * omega);
    [0, 1].map(|axis| -size * (gain * velocity[axis] + omega * omega * here[axis]))
}

/// A play of X with a soft edge, after it turned at 0 or at half a turn.
fn played_mm(radius_mm: f64, angle: f64, turn: f64) -> f64 {
    let since = (angle * turn).rem_euclid(0.5 * TAU);
    let way_mm = radius_mm * (1.0 - since.cos());
    let sense = -turn * angle.sin();
    -0.5 * PLAY_MM * sense.signum() * (2.0 * (way_mm / 4e-3).tanh() - 1.0)
}

const fn condition(run: u32) -> (f64, f64) {
    CONDITIONS[(run as usize / 2) % CONDITIONS.len()]
}

fn shift(machine: &MachineFile) -> (Session, usize) {
    let mut shift = Shift {
        builder: SessionBuilder::new(machine, SessionConfig::default()).expect("a machine"),
        noise: Pcg64Mcg::seed_from_u64(36_000),
        samples: 0,
    };
    for run in 0..RUNS as u32 {
        shift.run(run, EVERY_S * f64::from(run));
    }
    let samples = shift.samples;
    let (session, account) = shift.builder.finish().expect("a session");
    assert_eq!(account.left_out.len(), 0, "{account:?}");
    (session, samples)
}

#[test]
fn ten_hours_are_held_in_few_ticks_and_diagnosed_with_bounded_rows() {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").expect("the scenario's machine file");
    let (session, samples) = shift(&machine);
    assert!(samples > 1_500_000, "{samples}");
    assert_eq!(session.runs.len(), RUNS);
    assert!((3595..=3605).contains(&session.history.len()));
    let limit = SessionConfig::default().readings_per_run;
    for run in &session.runs {
        // Two channels; no more ticks are held of the motion than are read, and where it turns and stands.
        assert!(run.readings.len() <= 2 * limit, "{}", run.readings.len());
        assert!(run.motion.len() < limit, "{}", run.motion.len());
    }

    let config = GapConfig::default();
    let diagnosis = diagnose(&machine, &session, &config).expect("a diagnosis");
    let judged = diagnosis.notes.iter().find_map(|note| match note {
        Note::FewerRuns { runs, of } => Some((*runs, *of)),
        _ => None,
    });
    let (runs, of) = judged.unwrap_or_else(|| panic!("{:?}", diagnosis.notes));
    assert_eq!(of, RUNS);
    let shrink = &diagnosis.report.shrink;
    let used = [&shrink.fit_runs[..], &shrink.held_out_runs].concat();
    assert_eq!(used.len(), runs);
    // 64 stations of two channels, a few more where an axis turns.
    assert!((40..=config.most_rows / 128).contains(&runs), "{runs}");
    assert!(used.contains(&1) && used.iter().any(|run| *run + 6 > RUNS as u32));
    let causes = diagnosis.report.causes.iter();
    let causes: Vec<_> = causes.filter(|c| c.status != Status::Surrogate).collect();
    let [play] = causes[..] else {
        panic!("{causes:?}");
    };
    assert_eq!(
        (play.effect.as_str(), play.axis.as_str()),
        ("backlash", "X")
    );
    assert_eq!(play.status, Status::Named);
    let width_um = &play.parameters[0];
    assert!((width_um.value - 4.0).abs() < 0.2, "{width_um:?}");
    let closed = shrink.gap_closed.as_ref().expect("a share");
    assert!(closed.value > 0.9, "{closed:?} {:?}", shrink.rms_um);
}
