//! Time of one servo period of the first-run plant with everything on, in production motion.

use std::time::Instant;

use fake_cnc::{Plant, PlantFile};
use machine::MachineFile;
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};

const TICKS: u32 = 2_000_000;

#[expect(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a bench measures and prints"
)]
fn main() {
    let machine: MachineFile = serde_saphyr::from_str(include_str!(
        "../../../launch_configs/first_run/machine.yaml"
    ))
    .expect("the first run's machine file is well formed");
    let truth = PlantFile::from_yaml(include_str!("../../../launch_configs/first_run/plant.yaml"))
        .expect("the first run's plant file is well formed");
    let mut plant = Plant::new(&machine, &truth).expect("both files fit each other");
    let strokes = [
        (Axis::X, 110.0, 4.0),
        (Axis::Y, 90.0, 3.7),
        (Axis::Z, 60.0, 3.1),
    ];
    let mut start = PerAxis::default();
    start[Axis::Z] = 150.0;
    plant.settle_at(&start);
    let begin = Instant::now();
    let mut demand = PerAxis::default();
    let mut sum = 0.0;
    for tick in 0..TICKS {
        let feedback = plant.step(&demand, 8000.0, Span::from_nanos(1_000_000));
        let t = f64::from(tick + 1) * 1e-3;
        for (axis, stroke_mm, period_s) in strokes {
            let rate = std::f64::consts::TAU / period_s;
            let (sin, cos) = (rate * t).sin_cos();
            let lag = start[axis] + stroke_mm * sin - feedback.motor[axis];
            let short = stroke_mm * rate * cos - feedback.velocity[axis];
            demand[axis] = -stroke_mm * rate * rate * sin + 8000.0 * lag + 150.0 * short;
        }
        sum += feedback.motor[Axis::X];
    }
    let elapsed = begin.elapsed();
    println!(
        "plant step: {:.0} ns per period with servo, {TICKS} periods (check sum {sum:.3})",
        elapsed.as_secs_f64() * 1e9 / f64::from(TICKS)
    );
}
