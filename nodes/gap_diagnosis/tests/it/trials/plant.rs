//! A plant of circles on a grid encoder. Its effects and its noise are written here, from other formulas than
//! the catalogue's: play with a soft edge, a second-order loop, products that no catalogue holds.

use std::f64::consts::TAU;

use gap_diagnosis::{Diagnosis, GapConfig, diagnose};
use machine::MachineFile;
use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::{Channel, Motion, Reading, Run, Session};

/// State of the slides at a reading.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Position from the machine's zero, mm.
    pub position: [f64; 2],
    /// Velocity, mm/s.
    pub velocity: [f64; 2],
    /// Way since the axis turned, mm.
    pub way: [f64; 2],
    /// Time of the session, s.
    pub time_s: f64,
}

/// What is wrong: u and v in mm at a state.
pub type Wrong = dyn Fn(&State) -> [f64; 2];

/// Noise of a plant.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// White, of a reading, mm.
    pub white_mm: f64,
    /// Smooth, from run to run, mm.
    pub between_mm: f64,
    /// Factor on the white noise of runs that are not repeats.
    pub other_runs: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            white_mm: 0.3e-3,
            between_mm: 0.15e-3,
            other_runs: 1.0,
        }
    }
}

const TICK_S: f64 = 0.004;

pub fn machine() -> MachineFile {
    let text = include_str!("../../../../../launch_configs/grid_xy/machine.yaml");
    MachineFile::parse(text, "grid_xy").expect("the plant is sound")
}

/// Radius mm, feed mm/min, counterclockwise, repeat.
pub type Circle = (f64, f64, bool, u32);

pub const PROGRAM: [Circle; 14] = [
    (50.0, 2000.0, true, 0),
    (50.0, 2000.0, false, 0),
    (80.0, 4000.0, true, 0),
    (50.0, 4000.0, false, 0),
    (50.0, 2000.0, true, 1),
    (50.0, 2000.0, false, 1),
    (80.0, 2000.0, true, 0),
    (80.0, 2000.0, false, 0),
    (50.0, 2000.0, true, 2),
    (50.0, 2000.0, false, 2),
    (80.0, 4000.0, false, 0),
    (50.0, 4000.0, true, 0),
    (65.0, 3000.0, true, 0),
    (65.0, 3000.0, false, 0),
];

pub fn session(seed: u64, noise: Noise, wrong: &Wrong) -> Session {
    session_of(&PROGRAM, seed, noise, wrong)
}

/// A session of another program.
pub fn session_of(program: &[Circle], seed: u64, noise: Noise, wrong: &Wrong) -> Session {
    let mut session = Session::default();
    go_on(&mut session, program, 1, seed, noise, wrong);
    session
}

/// Measures more circles after a session, in a set-up of their own.
pub fn go_on(
    session: &mut Session,
    program: &[Circle],
    setup: u32,
    seed: u64,
    noise: Noise,
    wrong: &Wrong,
) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut start_s = session
        .runs
        .last()
        .map_or(10.0, |run| run.motion.time_s[run.motion.len() - 1] + 60.0);
    for entry in program {
        let number = u32::try_from(session.runs.len()).expect("the plant is sound");
        let is_repeated = program.iter().filter(|other| same(entry, other)).count() > 1;
        let mut run = circle(
            number,
            start_s,
            *entry,
            is_repeated,
            noise,
            wrong,
            &mut random,
        );
        (run.segment.setup_id, run.segment.zero_id) = (setup, setup);
        start_s = run.motion.time_s[run.motion.len() - 1] + 30.0;
        session.runs.push(run);
    }
}

fn same(a: &Circle, b: &Circle) -> bool {
    (a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-9 && a.2 == b.2
}

fn circle(
    run: u32,
    start_s: f64,
    (radius, feed, ccw, repeat): Circle,
    is_repeat: bool,
    noise: Noise,
    wrong: &Wrong,
    random: &mut Pcg64Mcg,
) -> Run {
    let omega = feed / 60.0 / radius * if ccw { 1.0 } else { -1.0 };
    let lead = 0.4;
    let count = ((TAU + 2.0 * lead) / omega.abs() / TICK_S).ceil() as usize;
    let angle = |tick: usize| omega * (tick as f64 * TICK_S) - lead * omega.signum();
    let mut position = PerAxis::<Vec<f64>>::default();
    position[Axis::X] = (0..count).map(|t| radius * angle(t).cos()).collect();
    position[Axis::Y] = (0..count).map(|t| radius * angle(t).sin()).collect();
    position[Axis::Z] = vec![30.0; count];
    let time_s = (0..count).map(|t| start_s + t as f64 * TICK_S).collect();
    let motion = Motion::new(time_s, AxisSet::XYZ, position).expect("the plant is sound");
    let white = noise.white_mm * if is_repeat { 1.0 } else { noise.other_runs };
    let fields = [
        field(noise.between_mm, random),
        field(noise.between_mm, random),
    ];
    let mut readings = Vec::new();
    let mut coloured = [0.0; 2];
    for tick in 0..count {
        let a = angle(tick);
        if a.abs() > TAU || a * omega < 0.0 {
            continue;
        }
        let state = State {
            position: [radius * a.cos(), radius * a.sin()],
            velocity: [-radius * omega * a.sin(), radius * omega * a.cos()],
            way: way(radius, a, omega),
            time_s: start_s + tick as f64 * TICK_S,
        };
        let truth = wrong(&state);
        let lag = following(&state, omega);
        for (axis, channel) in [(0, Channel::GridU), (1, Channel::GridV)] {
            let draw: f64 = StandardNormal.sample(random);
            coloured[axis] = 0.6 * coloured[axis] + 0.8 * white * draw;
            readings.push(Reading {
                channel,
                at: tick,
                fraction: 0.0,
                deviation: truth[axis] + lag[axis] + coloured[axis] + fields[axis](a),
            });
        }
    }
    Run {
        segment: segment(run, radius, feed, ccw, repeat),
        motion,
        touches: vec![],
        readings,
    }
}

/// What the control loop of the machine file leaves on a circle: gain 60/s, 98 % of velocity feed-forward, each
/// axis -0.02 s / (60 + s) of its command, from the frequency response at omega.
fn following(state: &State, omega: f64) -> [f64; 2] {
    let (gain, left) = (60.0, 0.02);
    let size = left / (gain * gain + omega * omega);
    [0, 1].map(|axis| -size * (gain * state.velocity[axis] + omega * omega * state.position[axis]))
}

/// Way since each axis last turned, from the angle: X turns at 0 and pi, Y at a quarter and three.
fn way(radius: f64, angle: f64, omega: f64) -> [f64; 2] {
    let quarter = TAU / 4.0;
    let since = |turn: f64| {
        let from = (angle - turn) * omega.signum();
        radius * (1.0 - from.rem_euclid(2.0 * quarter).cos())
    };
    [since(0.0), since(quarter)]
}

fn field(amplitude_mm: f64, random: &mut Pcg64Mcg) -> impl Fn(f64) -> f64 + use<> {
    let mut draw = || -> f64 { StandardNormal.sample(random) };
    let waves: Vec<[f64; 3]> = [1.0, 0.8, 0.6, 0.3]
        .iter()
        .zip(1..)
        .map(|(w, k)| [f64::from(k), w * draw(), w * draw()])
        .collect();
    let offset = 0.5 * draw();
    move |angle: f64| {
        let wave = |[k, c, s]: &[f64; 3]| c * (k * angle).cos() + s * (k * angle).sin();
        amplitude_mm / 1.45 * (offset + waves.iter().map(wave).sum::<f64>())
    }
}

fn segment(run: u32, radius: f64, feed: f64, ccw: bool, repeat: u32) -> TestSegment {
    TestSegment {
        plane: TestPlane::Xy,
        centre_mm: Vector3::new(0.0, 0.0, 30.0),
        radius_mm: radius,
        feed_mm_s: feed / 60.0,
        sense: if ccw {
            Sense::CounterClockwise
        } else {
            Sense::Clockwise
        },
        repeat,
        zero_id: 1,
        setup_id: 1,
        ..TestSegment::of_kind(TestKind::Circle, run, Stamp::from_nanos(0))
    }
}

/// Play with a soft edge: half the width against the direction, taken up within a few µm of way.
pub fn soft_play(axis: usize, width_mm: f64) -> impl Fn(&State) -> [f64; 2] {
    move |state| {
        let mut error = [0.0; 2];
        error[axis] = -0.5
            * width_mm
            * state.velocity[axis].signum()
            * (2.0 * (state.way[axis] / 0.004).tanh() - 1.0);
        error
    }
}

pub fn diagnosed(session: &Session) -> Diagnosis {
    diagnose(&machine(), session, &GapConfig::default()).expect("the plant is sound")
}

/// Causes that are named or a set, e.g. `backlash X`.
pub fn names(diagnosis: &Diagnosis) -> Vec<String> {
    let causes = diagnosis.report.causes.iter();
    let kept = causes.filter(|c| c.status != gap_diagnosis::report::Status::Surrogate);
    kept.map(|c| format!("{} {}", c.effect, c.axis)).collect()
}

/// Causes and notes in a few words, for messages of tests.
pub fn told(diagnosis: &Diagnosis) -> String {
    let causes = diagnosis.report.causes.iter().map(|c| {
        let values: Vec<String> = c
            .parameters
            .iter()
            .map(|p| format!("{} {:.3} ({:.3} to {:.3})", p.name, p.value, p.low, p.high))
            .collect();
        format!(
            "{} {} {:?} {:.2} D {:.1} {} z {:.1} {}",
            c.effect,
            c.axis,
            c.status,
            c.confidence,
            c.d,
            values.join(", "),
            c.constancy.worst_z,
            c.constancy.split_by
        )
    });
    let notes = diagnosis.notes.iter().map(ToString::to_string);
    let unknown = &diagnosis.report.unknown;
    let rest = format!(
        "rest {} {:.1} of {:.1}",
        unknown.flagged, unknown.score, unknown.threshold
    );
    causes
        .chain(notes)
        .chain([rest])
        .collect::<Vec<_>>()
        .join("\n")
}
