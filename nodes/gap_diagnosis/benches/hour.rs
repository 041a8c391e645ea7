//! A session of an hour at 1 kHz, from its samples to its diagnosis: circles on a grid encoder, 200 touches at
//! several feeds, 16 cycles of two blocks. Says what each part takes, and the most memory that was ever held; the search
//! on the Gram matrix of the signatures beside the same search with numpy, which must find the same set.

#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]
#![expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "a bench looks at the clock and says what it saw"
)]

use std::f64::consts::TAU;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use gap_diagnosis::problem::Posed;
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{GapConfig, diagnose};
use machine::MachineFile;
use machine::cycle::FeatureId;
use metrology::sample::{
    AxisState, GridSample, ProbeTrigger, Sense, TemperatureSample, TestKind, TestPlane, TestSegment,
};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const MACHINE: &str = include_str!("../../../launch_configs/gap_first/machine.yaml");
const HOUR_NANOS: i64 = 3_600_000_000_000;
const TICK_NANOS: i64 = 1_000_000;
const PLAY_MM: f64 = 4e-3;
/// Latency of the probe, s.
const LATENCY_S: f64 = 2e-3;
const CYCLES: i64 = 16;
const TOUCHES: u32 = 200;
/// What it may take: the whole diagnosis, the search, the memory.
const MOST_S: f64 = 60.0;
const MOST_SEARCH_S: f64 = 2.0;
const MOST_MIB: f64 = 1024.0;
/// Searches of which the mean is taken.
const SEARCHES: u32 = 20;

struct Hour {
    machine: MachineFile,
    builder: SessionBuilder,
    nanos: i64,
    run: u32,
    noise: Pcg64Mcg,
    lag_mm: f64,
    last: [f64; 3],
    touches: u32,
}

impl Hour {
    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.noise)
    }

    fn at<C: metrology::stamp::Clock>(&self) -> Stamp<C> {
        Stamp::from_nanos(self.nanos)
    }

    fn tick(&mut self, place: [f64; 3]) {
        let mut commanded = PerAxis::default();
        for (axis, mm) in Axis::LINEAR.into_iter().zip(place) {
            commanded[axis] = mm;
        }
        self.lag_mm =
            (self.lag_mm - (place[0] - self.last[0])).clamp(-0.5 * PLAY_MM, 0.5 * PLAY_MM);
        self.last = place;
        self.builder.take(Input::State(AxisState::standing(
            self.at(),
            self.at(),
            AxisSet::XYZ,
            commanded,
        )));
        self.nanos += TICK_NANOS;
    }

    fn segment(&mut self, begin: bool, kind: TestKind, radius_mm: f64, feed_mm_s: f64, turn: f64) {
        self.run += u32::from(begin);
        let is_circle = kind == TestKind::Circle;
        self.builder.take(Input::Segment(TestSegment {
            begin,
            plane: if is_circle {
                TestPlane::Xy
            } else {
                TestPlane::None
            },
            centre_mm: Vector3::new(0.0, 0.0, 30.0),
            radius_mm,
            feed_mm_s,
            sense: match turn {
                t if t > 0.0 => Sense::CounterClockwise,
                t if t < 0.0 => Sense::Clockwise,
                _ => Sense::None,
            },
            zero_id: u32::from(is_circle),
            setup_id: u32::from(is_circle),
            ..TestSegment::of_kind(kind, self.run, self.at())
        }));
    }

    fn circle(&mut self, radius_mm: f64, feed_mm_s: f64, turn: f64) {
        let own: [f64; 4] = std::array::from_fn(|_| 1e-4 * self.normal());
        for _ in 0..500 {
            self.tick([radius_mm, 0.0, 30.0]);
        }
        self.segment(true, TestKind::Circle, radius_mm, feed_mm_s, turn);
        let step = feed_mm_s * 1e-3 / radius_mm;
        let mut angle = 0.0;
        while angle < 1.5 * TAU {
            let (sin, cos) = (turn * angle).sin_cos();
            let [x, y] = [radius_mm * cos, radius_mm * sin];
            let at = self.at();
            self.tick([x, y, 30.0]);
            let wave = |k: usize| own[k] * (2.0 * angle).cos() + own[k + 1] * (3.0 * angle).sin();
            let deviation = [self.lag_mm + wave(0), wave(2)].map(|d| d + 5e-5 * self.normal());
            self.builder.take(Input::Grid(GridSample {
                at,
                plane: TestPlane::Xy,
                u_mm: x + deviation[0],
                v_mm: y + deviation[1],
                zero_id: 1,
            }));
            angle += step;
        }
        self.segment(false, TestKind::Circle, radius_mm, feed_mm_s, turn);
    }

    fn touch(&mut self, block: usize, axis: Axis, feed_mm_s: f64) {
        let entry = self.machine.blocks[block].clone();
        let sign = f64::from(entry.approach_sign[axis.index()]);
        let mut contact: [f64; 3] = std::array::from_fn(|k| {
            entry.corner_mm[k] + f64::from(entry.approach_sign[k]) * entry.inset_mm
        });
        contact[axis.index()] =
            entry.corner_mm[axis.index()] - sign * self.machine.ball_radius_mm();
        let mut way_mm = 2.0;
        while way_mm > 0.0 {
            let mut place = contact;
            place[axis.index()] -= sign * way_mm;
            self.tick(place);
            way_mm -= feed_mm_s * 1e-3;
        }
        let travel_mm = feed_mm_s * LATENCY_S + 3e-4 * self.normal();
        let mut latched = PerAxis::default();
        for (k, one) in Axis::LINEAR.into_iter().enumerate() {
            latched[one] = contact[k];
        }
        latched[axis] += sign * travel_mm;
        let mut approach = Vector3::zeros();
        approach[axis.index()] = sign;
        self.touches += 1;
        self.builder.take(Input::Trigger(ProbeTrigger {
            received_at: self.at(),
            controller_at: self.at(),
            feature_id: FeatureId::Face {
                block: &entry.id,
                axis,
            }
            .to_string(),
            approach,
            feed_mm_s,
            axes: AxisSet::XYZ,
            latched,
            sequence: self.touches,
        }));
        self.tick(contact);
    }

    fn cycle(&mut self) {
        self.segment(true, TestKind::Block, 0.0, 0.0, 0.0);
        for block in 0..2 {
            for axis in Axis::LINEAR {
                self.touch(block, axis, 2.0);
            }
        }
        self.segment(false, TestKind::Block, 0.0, 0.0, 0.0);
        for sensor in ["nut_x", "nut_y", "bed", "ambient"] {
            self.builder.take(Input::Temperature(TemperatureSample {
                at: self.at(),
                sensor: sensor.to_owned(),
                temperature_degc: 20.0,
                variance_k2: 0.0,
            }));
        }
    }

    fn latency(&mut self, feeds_mm_s: &[f64]) {
        self.segment(true, TestKind::Latency, 0.0, 0.0, 0.0);
        for &feed_mm_s in feeds_mm_s {
            for _ in 0..2 {
                self.touch(0, Axis::X, feed_mm_s);
            }
        }
        self.segment(false, TestKind::Latency, 0.0, 0.0, 0.0);
    }
}

fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Seconds of a search here, and with numpy where there is a Python; both from one Gram matrix.
fn searches(posed: &Posed) {
    let began = Instant::now();
    let mut found = posed.solved();
    for _ in 1..SEARCHES {
        found = posed.solved();
    }
    let own_s = began.elapsed().as_secs_f64() / f64::from(SEARCHES);
    let (set, score) = found;
    let [columns, forms] = [posed.problem.along.len(), posed.problem.forms.len()];
    println!(
        "searched {columns} columns in {forms} forms in {:.1} ms ({} of 2 s)",
        own_s * 1e3,
        within(own_s, MOST_SEARCH_S)
    );
    let Some(peer) = by_numpy(posed) else { return };
    let other: Vec<usize> = serde_json::from_value(peer["set"].clone()).unwrap();
    let other_score = peer["score"].as_f64().unwrap();
    // Forms that look alike to the last digits may stand for each other.
    let is_tie = (score - other_score).abs() < 1e-9 * score.abs();
    assert!(
        set == other || is_tie,
        "{set:?} {score} here, {other:?} {other_score} with numpy"
    );
    assert!((score - other_score).abs() < 1e-6 * posed.problem.square);
    let seconds: Vec<f64> = serde_json::from_value(peer["seconds"].clone()).unwrap();
    let peer_s = seconds.iter().sum::<f64>() / seconds.len() as f64;
    println!(
        "numpy: a set as good in {:.1} ms, ratio {:.1}",
        peer_s * 1e3,
        peer_s / own_s
    );
}

fn within(value: f64, most: f64) -> &'static str {
    if value <= most { "within" } else { "BEYOND" }
}

fn by_numpy(posed: &Posed) -> Option<serde_json::Value> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let python = std::env::var("ABBE_PYTHON");
    let python = python.map_or_else(|_| root.join(".venv/bin/python"), PathBuf::from);
    if !python.exists() {
        let python = python.display();
        println!("peer not run: no {python} (set ABBE_PYTHON, or let tests/run install it)");
        return None;
    }
    let mut problem = serde_json::to_value(&posed.problem).unwrap();
    problem["repeats"] = SEARCHES.into();
    let mut peer = Command::new(python)
        .arg(root.join("tests/peers/bench_selection.py"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let text = serde_json::to_vec(&problem).unwrap();
    peer.stdin.take().unwrap().write_all(&text).unwrap();
    let output = peer.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", output.status);
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

fn gathered(machine: &MachineFile) -> Hour {
    let mut hour = Hour {
        builder: SessionBuilder::new(machine, SessionConfig::default()).unwrap(),
        machine: machine.clone(),
        nanos: 0,
        run: 0,
        noise: Pcg64Mcg::seed_from_u64(1),
        lag_mm: 0.0,
        last: [0.0; 3],
        touches: 0,
    };
    let mut k = 0_u32;
    while hour.nanos < HOUR_NANOS {
        let (radius_mm, feed_mm_s) = [(50.0, 25.0), (25.0, 25.0), (50.0, 75.0)][k as usize / 2 % 3];
        let turn = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        hour.circle(radius_mm, feed_mm_s, turn);
        if i64::from(k) < CYCLES * 8 && k.is_multiple_of(8) {
            hour.cycle();
            hour.latency(&[1.0, 4.0, 8.0]);
        }
        k += 1;
    }
    hour.latency(&[1.0, 2.0, 4.0, 8.0]);
    assert_eq!(hour.touches, TOUCHES);
    hour
}

fn main() {
    let text = MACHINE.replace("velocity_feedforward: 0.98", "velocity_feedforward: 1.0");
    let machine = MachineFile::parse(&text, "machine.yaml").unwrap();
    let began = Instant::now();
    let hour = gathered(&machine);
    let (samples, touches) = (hour.nanos / TICK_NANOS, hour.touches);
    let (session, account) = hour.builder.finish().unwrap();
    let gathered_s = began.elapsed().as_secs_f64();
    let held_mib = peak_mib();
    let config = GapConfig::default();
    let began = Instant::now();
    let found = diagnose(&machine, &session, &config).unwrap();
    let diagnosed_s = began.elapsed().as_secs_f64();
    println!(
        "{samples} axis states, {touches} touches, {} runs, {} readings kept",
        account.runs, account.readings
    );
    println!("gathered in {gathered_s:.1} s, most memory {held_mib:.0?} MiB");
    println!(
        "diagnosed in {diagnosed_s:.1} s with all simulations ({} 60 s)",
        within(diagnosed_s, MOST_S)
    );
    if let Some(most_mib) = peak_mib() {
        println!(
            "most memory {most_mib:.0} MiB ({} 1 GiB)",
            within(most_mib, MOST_MIB)
        );
    }
    for cause in &found.report.causes {
        println!(
            "{:?} {} {} D {:.0}",
            cause.status, cause.effect, cause.axis, cause.d
        );
    }
    let began = Instant::now();
    let posed = Posed::new(&machine, &session, &config).unwrap();
    println!(
        "noise and signatures of the first search in {:.1} s",
        began.elapsed().as_secs_f64()
    );
    searches(&posed);
}
