//! Servo periods per second: control alone over ideal axes, and control with the plant.

#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]

use divan::Bencher;
use divan::counter::ItemsCount;
use fake_cnc::{Cnc, Config, Feedback, Hardware, Input, Output, Plant, PlantFile, ProbeEdge};
use machine::MachineFile;
use metrology::stamp::Span;
use metrology::{PerAxis, Stage, Stamp};

const MACHINE: &str = include_str!("../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../launch_configs/first_run/plant.yaml");
/// Moves three axes at once, an arc, a pause; about 6 s of machine time, mostly in motion.
const PROGRAM: &str =
    "G21 G90\nG1 F6000 X200 Y150 Z100\nG2 X100 Y50 I-50 J-50\nG1 X0 Y0 Z50\nG4 P1\nG0 X0 Y0 Z0\nM2";
const PERIODS: i64 = 10_000;

fn main() {
    divan::main();
}

/// Axes that do as they are told.
#[derive(Clone)]
struct IdealAxes(Feedback);

impl Hardware for IdealAxes {
    fn step(&mut self, demand: &PerAxis<f64>, _: f64, period: Span) -> Feedback {
        let period_s = period.as_secs_f64();
        for axis in 0..6 {
            self.0.velocity.0[axis] += demand.0[axis] * period_s;
            self.0.motor.0[axis] += self.0.velocity.0[axis] * period_s;
        }
        self.0
    }

    fn feedback(&self) -> Feedback {
        self.0
    }

    fn probe_edge(&self) -> Option<ProbeEdge> {
        None
    }

    fn probe_closed(&self) -> bool {
        false
    }

    fn sensor_reading_degc(&mut self, _: &str) -> Option<f64> {
        None
    }

    fn settle_at(&mut self, position: &PerAxis<f64>) {
        self.0.motor = *position;
    }
}

fn run<H: Hardware>(bencher: Bencher<'_, '_>, hardware: impl Fn(&MachineFile) -> H) {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let config = Config {
        background_rate_hz: 10.0,
        ..Config::default()
    };
    let mut cnc = Cnc::new(&config, &machine, hardware(&machine)).unwrap();
    let mut out: Vec<Output> = Vec::with_capacity(1024);
    let mut now = Stamp::from_nanos(0);
    let mut goal = 0;
    cnc.step(now, Input::Tick, &mut out).unwrap();
    bencher
        .counter(ItemsCount::new(PERIODS as usize))
        .bench_local(|| {
            for _ in 0..PERIODS {
                if cnc.idle() {
                    goal += 1;
                    let request = Input::RunProgram {
                        goal,
                        text: PROGRAM.to_owned(),
                        name: String::new(),
                    };
                    cnc.step(now, request, &mut out).unwrap();
                }
                now += Span::from_nanos(1_000_000);
                cnc.step(now, Input::Tick, &mut out).unwrap();
                out.clear();
            }
        });
}

#[divan::bench]
fn control_alone(bencher: Bencher<'_, '_>) {
    run(bencher, |_| {
        IdealAxes(Feedback {
            motor: PerAxis::default(),
            velocity: PerAxis::default(),
            scale: PerAxis::from_fn(|_| f64::NAN),
        })
    });
}

#[divan::bench]
fn control_and_plant(bencher: Bencher<'_, '_>) {
    let truth = PlantFile::from_yaml(PLANT).unwrap();
    run(bencher, |machine| Plant::new(machine, &truth).unwrap());
}
