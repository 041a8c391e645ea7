//! What each effect costs per recorded tick: a circle of ten seconds, after an hour that warmed the machine.

use std::collections::BTreeMap;

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use machine::file::MachineFile;
use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::{PerAxis, Stamp};
use nalgebra::Vector3;
use twin::effects::CATALOGUE;
use twin::{Channel, History, Motion, Reading, Run, Session, Touch, Twin};

const MACHINE: &str = include_str!("../../machine/tests/data/bench.yaml");
const SENSORS: &str = "temperature_sensors:
  - {id: spindle, place: spindle_front, period_s: 10.0}
  - {id: column, place: column, period_s: 10.0}
  - {id: air, place: ambient, period_s: 10.0}
";
const TICKS: usize = 10_000;

fn main() {
    divan::main();
}

fn segment() -> TestSegment {
    TestSegment {
        plane: TestPlane::Xy,
        radius_mm: 50.0,
        feed_mm_s: 50.0,
        sense: Sense::CounterClockwise,
        stylus: String::from("ruby_6"),
        ..TestSegment::of_kind(TestKind::Circle, 1, Stamp::from_nanos(0))
    }
}

fn session(machine: &MachineFile) -> Session {
    let axes = machine.axis_set();
    let time_s: Vec<f64> = (0..TICKS).map(|k| 3600.0 + k as f64 * 1e-3).collect();
    let along = |of: fn(f64) -> f64| time_s.iter().map(|t| 50.0 * of(*t)).collect::<Vec<_>>();
    let still = || vec![0.0; TICKS];
    let position = PerAxis([
        along(f64::cos),
        along(f64::sin),
        still(),
        still(),
        vec![],
        still(),
    ]);
    let motion = Motion::new(time_s, axes, position).expect("time grows");
    let touches = (0..100_u8).map(|k| Touch {
        time_s: 3600.0 + f64::from(k),
        feature_id: String::from("ring"),
        approach: Vector3::x(),
        feed_mm_s: 2.0,
        position: PerAxis([0.0; 6]),
        tick: None,
    });
    let readings = (0..TICKS).step_by(10).map(|at| Reading {
        channel: Channel::GridU,
        at,
        fraction: 0.5,
        deviation: 0.0,
    });
    let run = Run {
        segment: segment(),
        motion,
        touches: touches.collect(),
        readings: readings.collect(),
    };
    let series = |value: f64| vec![value; 360];
    let temperatures = ["spindle", "column", "air"].map(|id| (id.to_owned(), series(21.0)));
    let history = History {
        step_s: 10.0,
        position: PerAxis([0.0; 6].map(series)),
        speed: PerAxis([30.0; 6].map(series)),
        speed_squared: PerAxis([1500.0; 6].map(series)),
        temperature_degc: BTreeMap::from(temperatures),
        ..History::default()
    };
    Session {
        history,
        runs: vec![run],
        first_bag_ends: None,
    }
}

/// The main amplitudes of an effect on its first target.
#[divan::bench(args = CATALOGUE.iter().map(|kind| kind.id))]
fn respond(bencher: Bencher<'_, '_>, id: &str) {
    let text = format!("{MACHINE}{SENSORS}");
    let machine = MachineFile::parse(&text, "bench.yaml").expect("a machine");
    let session = session(&machine);
    let twin = Twin::new(&machine).expect("a chain");
    let kind = twin::effects::kind(id).expect("in the catalogue");
    let target = kind.targets_on(&machine).remove(0);
    let typical = kind.parameters.iter().map(|p| p.typical);
    let free = kind.free.iter().map(|_| 0.0);
    let effect = (kind.build)(target, &typical.chain(free).collect::<Vec<_>>());
    bencher
        .counter(ItemsCount::new(TICKS))
        .bench_local(|| twin.respond(black_box(&session), &session.runs[0], &[effect.as_ref()]));
}
