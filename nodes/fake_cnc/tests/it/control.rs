//! The whole control over axes that do as they are told, and over the plant.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod compensation;
mod feedback;
mod homing;
mod machine_frame;
mod motion;
mod registers;
mod time;
mod touches;
mod trips;
mod waiting;

use std::collections::VecDeque;

use fake_cnc::{
    Cnc, Config, Diagnostic, Feedback, Hardware, Input, Outcome, Output, Plant, PlantFile,
    ProbeEdge, ProgramState,
};
use machine::MachineFile;
use metrology::sample::{AxisCompensation, AxisState, CompensationState, ProbeTrigger};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use nalgebra::Vector3;

const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../../launch_configs/first_run/plant.yaml");
const MS: i64 = 1_000_000;

/// Rigid axes without friction, and a probe that closes when Z is below a surface.
#[derive(Clone, Debug)]
struct Bench {
    feedback: Feedback,
    surface_z_mm: f64,
    latency_s: f64,
    elapsed_s: f64,
    /// Arrival time and signal of edges that are on their way, s.
    edges: VecDeque<(f64, bool)>,
    touching: bool,
    closed: bool,
    arrived: Option<ProbeEdge>,
    jammed: bool,
    spindle_rpm: f64,
    /// Further surfaces: where the ball's centre meets them, and the direction into them.
    contacts: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl Bench {
    fn new(surface_z_mm: f64, latency_s: f64) -> Self {
        Self {
            feedback: Feedback {
                motor: PerAxis::default(),
                velocity: PerAxis::default(),
                scale: PerAxis::from_fn(|_| f64::NAN),
            },
            surface_z_mm,
            latency_s,
            elapsed_s: 0.0,
            edges: VecDeque::new(),
            touching: false,
            closed: false,
            arrived: None,
            jammed: false,
            spindle_rpm: 0.0,
            contacts: Vec::new(),
        }
    }

    fn open() -> Self {
        Self::new(-1e9, 0.0)
    }

    fn probe(&mut self, before: &PerAxis<f64>, period_s: f64) {
        let after = self.feedback.motor;
        let height = |p: &PerAxis<f64>| {
            let near = self.contacts.iter().filter_map(|(contact, into)| {
                let off = p.xyz() - contact;
                let along = off.dot(into);
                ((off - into * along).norm() < 0.5 && along < 10.0).then_some(-along)
            });
            near.fold(p[Axis::Z] - self.surface_z_mm, f64::min)
        };
        let (from, to) = (height(before), height(&after));
        if (to <= 0.0) != self.touching {
            let share = if (from - to).abs() > 0.0 {
                from / (from - to)
            } else {
                0.0
            };
            self.touching = to <= 0.0;
            let arrival = self.elapsed_s + share * period_s + self.latency_s;
            self.edges.push_back((arrival, self.touching));
        }
        self.arrived = None;
        if let Some(&(arrival, closed)) = self.edges.front()
            && arrival < self.elapsed_s + period_s
        {
            self.edges.pop_front();
            self.closed = closed;
            let after_s = arrival - self.elapsed_s;
            let share = after_s / period_s;
            self.arrived = Some(ProbeEdge {
                after_period_start: Span::from_secs_f64(after_s),
                closed,
                motor_at_arrival: PerAxis::from_fn(|axis| {
                    before[axis] + share * (after[axis] - before[axis])
                }),
            });
        }
    }
}

impl Hardware for Bench {
    fn step(&mut self, demand: &PerAxis<f64>, spindle_rpm: f64, period: Span) -> Feedback {
        let period_s = period.as_secs_f64();
        self.spindle_rpm = spindle_rpm;
        let before = self.feedback.motor;
        for axis in Axis::ALL {
            if self.jammed && axis == Axis::Y {
                continue;
            }
            let velocity = &mut self.feedback.velocity[axis];
            self.feedback.motor[axis] += (*velocity + 0.5 * demand[axis] * period_s) * period_s;
            *velocity += demand[axis] * period_s;
        }
        self.probe(&before, period_s);
        self.elapsed_s += period_s;
        self.feedback
    }

    fn feedback(&self) -> Feedback {
        self.feedback
    }

    fn probe_edge(&self) -> Option<ProbeEdge> {
        self.arrived
    }

    fn probe_closed(&self) -> bool {
        self.closed
    }

    fn sensor_reading_degc(&mut self, id: &str) -> Option<f64> {
        Some(20.0 + id.len() as f64)
    }

    fn settle_at(&mut self, position: &PerAxis<f64>) {
        self.feedback.motor = *position;
    }
}

/// A control, its time, and all that it said.
#[derive(Clone)]
struct Shop<H> {
    cnc: Cnc<H>,
    now: Stamp<metrology::Host>,
    out: Vec<Output>,
}

impl<H: Hardware> Shop<H> {
    fn new(config: &Config, machine: &MachineFile, hardware: H) -> Self {
        let mut shop = Self {
            cnc: Cnc::new(config, machine, hardware).unwrap(),
            now: Stamp::from_nanos(1_000 * MS),
            out: Vec::new(),
        };
        shop.tell(Input::Tick);
        shop
    }

    /// Offsets without a stamp are of now.
    fn tell(&mut self, mut input: Input) {
        if let Input::Compensation(message) = &mut input
            && message.at == Stamp::default()
        {
            message.at = self.now;
        }
        self.cnc.step(self.now, input, &mut self.out).unwrap();
    }

    fn pass_ms(&mut self, periods: u32) {
        for _ in 0..periods {
            self.now += Span::from_nanos(MS);
            self.tell(Input::Tick);
        }
    }

    fn request(&mut self, text: &str) {
        self.tell(Input::RunProgram {
            goal: 7,
            text: text.to_owned(),
            name: "test".to_owned(),
        });
    }

    /// Runs `text` to its end; outcome, message, line.
    fn run(&mut self, text: &str) -> (Outcome, String, u32) {
        self.request(text);
        self.finish()
    }

    fn finish(&mut self) -> (Outcome, String, u32) {
        let begin = self.out.len().saturating_sub(1);
        for _ in 0..600_000 {
            let end = self.out[begin..]
                .iter()
                .rev()
                .take(8)
                .find_map(|o| match o {
                    Output::Finished {
                        goal: 7,
                        outcome,
                        message,
                        line,
                    } => Some((*outcome, message.clone(), *line)),
                    Output::Refused { goal: 7, message } => {
                        Some((Outcome::Refused, message.clone(), 0))
                    }
                    _ => None,
                });
            if let Some(end) = end {
                return end;
            }
            self.pass_ms(1);
        }
        panic!("no end within 600 s");
    }

    fn states(&self) -> Vec<AxisState> {
        self.out
            .iter()
            .filter_map(|o| match o {
                Output::State(state) => Some(*state),
                _ => None,
            })
            .collect()
    }

    fn triggers(&self) -> Vec<ProbeTrigger> {
        self.out
            .iter()
            .filter_map(|o| match o {
                Output::Trigger(trigger) => Some(trigger.clone()),
                _ => None,
            })
            .collect()
    }

    fn diagnostics(&self) -> Vec<Diagnostic> {
        self.out
            .iter()
            .filter_map(|o| match o {
                Output::Diagnostic(diagnostic) => Some(diagnostic.clone()),
                _ => None,
            })
            .collect()
    }
}

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").unwrap()
}

fn shop(bench: Bench) -> Shop<Bench> {
    Shop::new(&Config::default(), &machine(), bench)
}

fn done() -> (Outcome, String) {
    (Outcome::Done, String::new())
}

fn offsets(x_mm: f64) -> Input {
    let mut total = PerAxis::default();
    total[Axis::X] = x_mm;
    Input::Compensation(AxisCompensation {
        at: Stamp::default(),
        axes: AxisSet::XYZ,
        total,
        thermal: total,
        geometric: PerAxis::default(),
        positioning: PerAxis::default(),
        pulses: PerAxis::default(),
        remainder: total,
        state: PerAxis::from_fn(|_| CompensationState::Active),
    })
}
