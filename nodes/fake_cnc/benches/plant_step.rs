//! One servo period of the first-run plant with everything on, in production motion.

#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]

use divan::Bencher;
use divan::counter::ItemsCount;
use fake_cnc::{Plant, PlantFile};
use machine::MachineFile;
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};

const MACHINE: &str = include_str!("../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../launch_configs/first_run/plant.yaml");
const PERIODS: u32 = 20_000;
const MIDDLE_Z_MM: f64 = 150.0;

fn main() {
    divan::main();
}

/// Plant and a plain servo that keeps it reciprocating.
#[divan::bench]
fn plant_and_plain_servo(bencher: Bencher<'_, '_>) {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let mut plant = Plant::new(&machine, &PlantFile::from_yaml(PLANT).unwrap()).unwrap();
    let strokes = [
        (Axis::X, 110.0, 4.0),
        (Axis::Y, 90.0, 3.7),
        (Axis::Z, 60.0, 3.1),
    ];
    let mut middle = PerAxis::default();
    middle[Axis::Z] = MIDDLE_Z_MM;
    plant.settle_at(&middle);
    let mut demand = PerAxis::default();
    let mut tick = 0_u32;
    bencher
        .counter(ItemsCount::new(PERIODS as usize))
        .bench_local(|| {
            for _ in 0..PERIODS {
                let feedback = plant.step(&demand, 8000.0, Span::from_nanos(1_000_000));
                tick += 1;
                let t = f64::from(tick) * 1e-3;
                for (axis, stroke_mm, period_s) in strokes {
                    let rate = std::f64::consts::TAU / period_s;
                    let (sin, cos) = (rate * t).sin_cos();
                    let lag = middle[axis] + stroke_mm * sin - feedback.motor[axis];
                    let short = stroke_mm * rate * cos - feedback.velocity[axis];
                    demand[axis] = -stroke_mm * rate * rate * sin + 8000.0 * lag + 150.0 * short;
                }
            }
            plant.probe_closed()
        });
}
