//! The whole control over axes that do as they are told, and over the plant.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::VecDeque;

use fake_cnc::{
    Cnc, Config, Diagnostic, Feedback, Hardware, Input, Outcome, Output, Plant, PlantFile,
    ProbeEdge, ProgramState,
};
use machine::MachineFile;
use metrology::sample::{AxisCompensation, AxisState, CompensationState, ProbeTrigger};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};

const MACHINE: &str = include_str!("../../../launch_configs/first_run/machine.yaml");
const PLANT: &str = include_str!("../../../launch_configs/first_run/plant.yaml");
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
        }
    }

    fn open() -> Self {
        Self::new(-1e9, 0.0)
    }

    fn probe(&mut self, before: &PerAxis<f64>, period_s: f64) {
        let after = self.feedback.motor;
        let height = |p: &PerAxis<f64>| p[Axis::Z] - self.surface_z_mm;
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

    fn grid_position_mm(&self) -> Option<(f64, f64)> {
        None
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

    fn tell(&mut self, input: Input) {
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
        remainder: PerAxis::default(),
        state: PerAxis::from_fn(|_| CompensationState::Active),
    })
}

#[test]
fn a_program_ends_exactly_where_it_says() {
    let mut shop = shop(Bench::open());
    let text = "G21 G90 (go)\nG0 X12.345 Y-6.789\nF3000 G1 Z33.3 A-10.5 C123.4\nG2 X22.345 I5\nG91 G1 X0.1 X-0\nM2";
    assert_eq!(shop.run(text).0, Outcome::Refused);
    let (outcome, message, line) = shop.run(&text.replace(" X-0", ""));
    assert_eq!((outcome, message.as_str(), line), (Outcome::Done, "", 6));
    let at = *shop.cnc.commanded();
    let expected = [
        22.345 + 0.1,
        -6.789,
        33.3,
        (-10.5_f64).to_radians(),
        0.0,
        123.4_f64.to_radians(),
    ];
    for (at, expected) in at.0.iter().zip(expected) {
        assert!((at - expected).abs() < 1e-12, "{at} {expected}");
    }
    shop.pass_ms(500);
    let last = shop.states().pop().unwrap();
    for axis in last.axes.iter() {
        assert!(
            (last.motor[axis] - at[axis]).abs() < 1e-6,
            "{axis} {}",
            last.motor[axis] - at[axis]
        );
    }
}

#[test]
fn a_touch_latches_where_the_signal_arrives_and_tells_its_feed() {
    let latency_s = 0.0053;
    let surface = -3.0;
    for feed_mm_min in [60.0, 240.0, 960.0] {
        let mut shop = shop(Bench::new(surface, latency_s));
        let text = format!("(feature: top)\nF{feed_mm_min} G38.2 Z-8\nG0 Z0\nM2");
        let (outcome, message, _) = shop.run(&text);
        assert_eq!((outcome, message), done());
        let [touch] = &shop.triggers()[..] else {
            panic!("one touch");
        };
        let feed_mm_s = feed_mm_min / 60.0;
        assert_eq!((touch.feature_id.as_str(), touch.sequence), ("top", 1));
        assert!((touch.approach + nalgebra::Vector3::z()).norm() < 1e-12);
        assert!(
            (touch.feed_mm_s - feed_mm_s).abs() < 2e-3 * feed_mm_s,
            "{}",
            touch.feed_mm_s
        );
        let expected = surface - feed_mm_s * latency_s;
        assert!(
            (touch.latched[Axis::Z] - expected).abs() < 1e-4,
            "{}",
            touch.latched[Axis::Z]
        );
        // The latch lies between the states of the ticks around it, at its own stamp.
        let states = shop.states();
        let after = states
            .iter()
            .position(|s| s.controller_at >= touch.controller_at)
            .unwrap();
        let [before, after] = [&states[after - 1], &states[after]];
        let share = (touch.controller_at - before.controller_at).as_secs_f64() / 0.001;
        let between =
            before.motor[Axis::Z] + share * (after.motor[Axis::Z] - before.motor[Axis::Z]);
        assert!((between - touch.latched[Axis::Z]).abs() < 1e-6);
        assert_eq!(touch.received_at, after.received_at);
        // It stops as quickly as the axis may, not at the programmed end.
        let lowest = states
            .iter()
            .map(|s| s.commanded[Axis::Z])
            .fold(0.0, f64::min);
        let braking = feed_mm_s * feed_mm_s / (2.0 * 0.75 * 2500.0);
        let period = feed_mm_s * 0.001;
        assert!(
            (expected - braking - period - 0.01..expected + period).contains(&lowest),
            "{lowest} {expected} {braking}"
        );
    }
}

#[test]
fn a_polled_latch_waits_for_the_end_of_the_period() {
    let text = "F600 G38.2 Z-8\nM2";
    let mut machine = machine();
    let mut hardware = Shop::new(&Config::default(), &machine, Bench::new(-3.0, 0.00437));
    hardware.run(text);
    machine.control.latch = machine::file::Latch::Polled;
    let mut polled = Shop::new(&Config::default(), &machine, Bench::new(-3.0, 0.00437));
    polled.run(text);
    let (early, late) = (&hardware.triggers()[0], &polled.triggers()[0]);
    let delay = late.controller_at - early.controller_at;
    assert!(delay.nanos() > 0 && delay.nanos() <= MS, "{delay:?}");
    assert_eq!(
        (late.controller_at.nanos() % MS, late.received_at),
        (0, early.received_at)
    );
    let moved = early.latched[Axis::Z] - late.latched[Axis::Z];
    assert!((moved - 10.0 * delay.as_secs_f64()).abs() < 1e-4, "{moved}");
}

#[test]
fn a_touch_that_never_triggers_ends_the_program_or_goes_on() {
    let mut shop = shop(Bench::open());
    let (outcome, message, line) = shop.run("(feature: hole)\nF600 G38.2 Z-4\nG0 Z10\nM2");
    assert_eq!((outcome, line), (Outcome::ProbeMissed, 2));
    assert_eq!(
        message,
        "line 2: touch of \"hole\" ended without the probe closed"
    );
    assert!((shop.cnc.commanded()[Axis::Z] + 4.0).abs() < 1e-12);
    let (outcome, message, _) = shop.run("F600 G38.3 Z-5\nG0 Z10\nM2");
    assert_eq!((outcome, message), done());
    assert!((shop.cnc.commanded()[Axis::Z] - 10.0).abs() < 1e-12);
    assert!(shop.triggers().is_empty());
}

#[test]
fn a_probe_stuck_closed_ends_the_program_before_the_touch() {
    let mut bench = Bench::open();
    bench.closed = true;
    let mut shop = shop(bench);
    for code in ["G38.2", "G38.3"] {
        let (outcome, message, line) =
            shop.run(&format!("G0 X1\n(feature: top)\nF100 {code} Z-4\nM2"));
        assert_eq!((outcome, line), (Outcome::ProbeStuck, 3));
        assert_eq!(
            message,
            "line 3: the probe is already closed before the touch of \"top\""
        );
        assert!(shop.cnc.commanded()[Axis::Z].abs() < 1e-12);
    }
}

#[test]
fn leaving_a_surface_ends_a_touch_away_from_it() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    let text = "F600 G38.2 Z-8\nF600 G38.4 Z0\nM2";
    let (outcome, message, _) = shop.run(text);
    assert_eq!((outcome, message), done());
    let touches = shop.triggers();
    assert_eq!(touches.len(), 2);
    // It leaves the surface while still gaining speed, 1 ms before the signal arrives.
    let latched = touches[1].latched[Axis::Z];
    assert!((-2.998..-2.988).contains(&latched), "{latched}");
    assert!((touches[1].approach - nalgebra::Vector3::z()).norm() < 1e-12);
    let (outcome, message, _) = shop.run("G0 Z1\nF60 G38.4 Z5\nM2");
    assert_eq!(outcome, Outcome::ProbeStuck, "{message}");
    assert!(message.contains("already open"), "{message}");
}

#[test]
fn a_probe_that_closes_in_another_motion_is_a_fault_but_retracting_is_not() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    let (outcome, message, line) = shop.run("F6000\nG1 Z-20\nM2");
    assert_eq!((outcome, line), (Outcome::Fault, 2));
    assert!(
        message.contains("probe closed in a motion that is no touch"),
        "{message}"
    );
    let z = shop.cnc.commanded()[Axis::Z];
    assert!(z < -3.0 && z > -7.0, "{z}");
    assert_eq!(shop.run("G0 Z5\nM2").0, Outcome::Done);
}

#[test]
fn following_error_opens_the_loop_and_faults() {
    let mut bench = Bench::open();
    bench.jammed = true;
    let mut shop = shop(bench);
    let (outcome, message, line) = shop.run("F3000\nG1 X50 Y50\nM2");
    assert_eq!((outcome, line), (Outcome::Fault, 2));
    assert!(
        message.contains("axis Y follows with an error of"),
        "{message}"
    );
    assert!(message.contains("limit 1"), "{message}");
    let state = shop.states().pop().unwrap();
    assert!((state.commanded[Axis::X] - state.motor[Axis::X]).abs() < 1e-9);
    assert!(state.velocity[Axis::X].abs() < 1e-3);
    // What still moves can be moved.
    assert_eq!(shop.run("G0 X0\nM2").0, Outcome::Done);
}

#[test]
fn compensation_moves_the_motors_smoothly_and_not_the_command() {
    let mut shop = shop(Bench::open());
    shop.pass_ms(100);
    for k in 0..3000_u32 {
        // Smooth, then a jump as from another node's first message.
        let wanted = if k < 1500 { 5e-6 * f64::from(k) } else { 0.05 };
        shop.tell(offsets(wanted));
        shop.pass_ms(1);
    }
    let states = shop.states();
    let greatest_step = states
        .windows(2)
        .map(|w| (w[1].motor[Axis::X] - w[0].motor[Axis::X]).abs())
        .fold(0.0, f64::max);
    // 100 µm/s at most: 0.1 µm in a period, and the loop's own overshoot.
    assert!(greatest_step < 2e-4, "{greatest_step}");
    let last = states.last().unwrap();
    assert!(last.commanded[Axis::X].abs() < 1e-15);
    assert!(
        (last.motor[Axis::X] - 0.05).abs() < 1e-5,
        "{}",
        last.motor[Axis::X]
    );
    // Silence: held for 1 s, then faded at 5 µm/s.
    shop.pass_ms(999);
    assert!((shop.cnc.offset()[Axis::X] - 0.05).abs() < 1e-12);
    shop.pass_ms(1000);
    assert!(
        (shop.cnc.offset()[Axis::X] - 0.045).abs() < 2e-5,
        "{}",
        shop.cnc.offset()[Axis::X]
    );
    assert_eq!(
        shop.diagnostics(),
        [Diagnostic::CompensationStale {
            silent_periods: 1001
        }]
    );
    shop.pass_ms(10_000);
    assert!(shop.cnc.offset()[Axis::X].abs() <= 0.0);
    assert!(shop.states().last().unwrap().motor[Axis::X].abs() < 1e-6);
}

#[test]
fn a_compensation_that_is_not_a_number_is_refused_and_told() {
    let mut shop = shop(Bench::open());
    shop.tell(offsets(0.001));
    shop.pass_ms(50);
    shop.tell(offsets(f64::NAN));
    shop.pass_ms(50);
    assert!((shop.cnc.offset()[Axis::X] - 0.001).abs() < 1e-15);
    let [
        Diagnostic::CompensationNotFinite {
            axis: Axis::X,
            value,
        },
    ] = shop.diagnostics()[..]
    else {
        panic!("{:?}", shop.diagnostics());
    };
    assert!(value.is_nan());
}

#[test]
fn time_that_goes_back_moves_nothing_and_is_told() {
    let mut shop = shop(Bench::open());
    shop.request("F6000 G1 X100\nM2");
    shop.pass_ms(300);
    let (before, said) = (shop.cnc.hardware().feedback.motor, shop.out.len());
    let right = shop.now;
    shop.now = Stamp::from_nanos(right.nanos() - 40 * MS);
    shop.tell(Input::Tick);
    assert_eq!(shop.cnc.hardware().feedback.motor, before);
    let [Output::Diagnostic(Diagnostic::TimeWentBack { by_s })] = shop.out[said..] else {
        panic!("{:?}", &shop.out[said..]);
    };
    assert!((by_s - 0.04).abs() < 1e-12);
    shop.now = right;
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn a_jump_of_time_is_skipped_and_told() {
    let mut shop = shop(Bench::open());
    shop.pass_ms(10);
    let before = shop.states().len();
    shop.now += Span::from_secs_f64(3600.0);
    shop.tell(Input::Tick);
    assert_eq!(shop.states().len(), before);
    assert!(matches!(
        shop.diagnostics()[..],
        [Diagnostic::TimeJumped { by_s, limit_s }] if by_s > 3599.0 && limit_s < 61.0
    ));
    shop.pass_ms(10);
    assert_eq!(shop.states().len(), before + 10);
    let states = shop.states();
    let gap = states[before].controller_at - states[before - 1].controller_at;
    assert_eq!(gap.nanos(), MS);
}

#[test]
fn cancel_slows_down_along_the_path_and_ends_stopped() {
    let mut shop = shop(Bench::open());
    shop.request("F12000\nG1 X100 Y50\nG1 X200\nM2");
    shop.pass_ms(300);
    shop.tell(Input::CancelProgram { goal: 8 });
    shop.tell(Input::CancelProgram { goal: 7 });
    let (outcome, message, line) = shop.finish();
    assert_eq!(
        (outcome, message.as_str(), line),
        (Outcome::Stopped, "line 2: cancelled", 2)
    );
    assert_eq!(
        shop.diagnostics(),
        [Diagnostic::NothingToCancel { goal: 8 }]
    );
    let at = *shop.cnc.commanded();
    assert!(
        (at[Axis::X] - 2.0 * at[Axis::Y]).abs() < 1e-9,
        "on its path"
    );
    let accelerations = shop.states().windows(3).fold(0.0_f64, |most, w| {
        let second =
            w[2].commanded[Axis::X] - 2.0 * w[1].commanded[Axis::X] + w[0].commanded[Axis::X];
        most.max(second.abs() / 1e-6)
    });
    assert!(accelerations <= 3000.0, "{accelerations}");
}

#[test]
fn a_second_program_is_refused_while_one_runs() {
    let mut shop = shop(Bench::open());
    shop.request("G4 P1\nM2");
    shop.tell(Input::RunProgram {
        goal: 9,
        text: "M2".to_owned(),
        name: String::new(),
    });
    let refused = Output::Refused {
        goal: 9,
        message: "program 7 is running".to_owned(),
    };
    assert_eq!(shop.out.last(), Some(&refused));
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn out_of_travel_is_refused_before_anything_moves() {
    let mut shop = shop(Bench::open());
    let (outcome, message, _) = shop.run("G0 X100\nG0 X-320.001\nM2");
    assert_eq!(outcome, Outcome::Refused);
    assert_eq!(
        message,
        "line 2, column 4: axis X would go to -320.001 mm, limit -320 mm"
    );
    let (_, message, _) = shop.run("G1 F0 X5\nM2");
    assert_eq!(
        message,
        "line 1, column 1: G1 needs a feed, F is 0: must be above 0"
    );
    shop.pass_ms(100);
    assert!(
        shop.cnc
            .hardware()
            .feedback
            .motor
            .0
            .iter()
            .all(|x| x.abs() <= 0.0)
    );
}

#[test]
fn states_come_at_full_rate_around_a_touch_and_slowly_otherwise() {
    let config = Config {
        background_rate_hz: 10.0,
        ..Config::default()
    };
    let mut shop = Shop::new(&config, &machine(), Bench::new(-3.0, 0.002));
    let (outcome, ..) = shop.run("G4 P2\nF120 G38.2 Z-8\nG0 Z0\nG4 P2\nF600\n(rate: full)\nG1 X1\n(rate: background)\nX2\nM2");
    assert_eq!(outcome, Outcome::Done);
    let touch = shop.triggers()[0].controller_at;
    let states = shop.states();
    let within = |from_s: f64, to_s: f64| {
        states
            .iter()
            .filter(|s| {
                let after_s = (s.controller_at - touch).as_secs_f64();
                (from_s..to_s).contains(&after_s)
            })
            .count()
    };
    // 1.5 s of way at 2 mm/s, 50 ms before and after.
    assert!(within(-1.5, 0.05) >= 1549, "{}", within(-1.5, 0.05));
    assert!(within(-3.0, -1.6) <= 15 && within(0.2, 2.0) <= 19);
    let first = states
        .iter()
        .position(|s| s.commanded[Axis::Z] < 0.0)
        .unwrap();
    let lead = states[first].controller_at - states[first - 49].controller_at;
    assert_eq!(
        lead.nanos(),
        49 * MS,
        "full rate before the touch begins to move"
    );
    let full = states
        .iter()
        .filter(|s| (0.001..0.999).contains(&s.commanded[Axis::X]))
        .count();
    assert!(full >= 95, "{full}");
    let slow = states.iter().filter(|s| s.commanded[Axis::X] > 1.6).count();
    assert!(slow < 10, "{slow}");
}

#[test]
fn stamps_follow_offset_and_drift_of_the_controller_clock() {
    let config = Config {
        clock_offset_s: -100.0,
        clock_drift_ppm: 200.0,
        ..Config::default()
    };
    let mut shop = Shop::new(&config, &machine(), Bench::open());
    shop.pass_ms(10_000);
    let states = shop.states();
    // 200 ppm fast: 10 002 of its periods fit into 10 s of the host.
    assert_eq!(states.len(), 10_002);
    let last = states.last().unwrap();
    let machine_s = last.controller_at.as_secs_f64() - (1.0 - 100.0);
    let host_s = last.received_at.as_secs_f64() - 1.0;
    assert!(
        (machine_s / host_s - 1.0002).abs() < 1e-9,
        "{machine_s} {host_s}"
    );
    assert!(
        states
            .windows(2)
            .all(|w| w[1].received_at > w[0].received_at)
    );
}

#[test]
fn progress_spindle_dwell_and_temperatures_are_told() {
    let mut shop = shop(Bench::open());
    shop.request("S3000 M3\nG4 P0.5\nS4000\nG4 P20\nM2");
    shop.pass_ms(400);
    assert!((shop.cnc.hardware().spindle_rpm - 3000.0).abs() < 1e-9);
    shop.pass_ms(400);
    assert!((shop.cnc.hardware().spindle_rpm - 4000.0).abs() < 1e-9);
    assert_eq!(shop.finish().0, Outcome::Done);
    shop.pass_ms(10);
    assert!(shop.cnc.hardware().spindle_rpm.abs() < 1e-9);
    let lines: Vec<u32> = shop
        .out
        .iter()
        .filter_map(|o| match o {
            Output::Feedback {
                goal: 7,
                line,
                state: ProgramState::Running,
                ..
            } => Some(*line),
            _ => None,
        })
        .collect();
    assert!((204..=206).contains(&lines.len()), "{}", lines.len());
    assert!(lines.is_sorted() && lines.contains(&2) && lines.contains(&4));
    let fronts: Vec<_> = shop
        .out
        .iter()
        .filter_map(|o| match o {
            Output::Temperature(t) if t.sensor == "spindle_front" => Some(t.at),
            _ => None,
        })
        .collect();
    assert_eq!(fronts.len(), 2);
    assert_eq!((fronts[1] - fronts[0]).nanos(), 10_000 * MS);
}

#[test]
fn snapshot_then_resume_equals_straight_run() {
    let mut straight = shop(Bench::new(-3.0, 0.002));
    straight.request("F6000 G1 X30 Y20\nG2 X40 I5\nF300 G38.2 Z-8\nG0 Z0\nM2");
    straight.tell(offsets(0.004));
    straight.pass_ms(450);
    let mut resumed = straight.clone();
    straight.pass_ms(3000);
    resumed.pass_ms(3000);
    // As text: a scale that is not there is NaN, which equals nothing.
    let said = |shop: &Shop<Bench>| format!("{:?}", shop.out);
    assert!(said(&straight) == said(&resumed));
    assert_eq!(straight.triggers().len(), 1);
    // And time in other portions gives the same.
    let mut coarse = shop(Bench::new(-3.0, 0.002));
    coarse.request("F6000 G1 X30 Y20\nG2 X40 I5\nF300 G38.2 Z-8\nG0 Z0\nM2");
    coarse.tell(offsets(0.004));
    for _ in 0..345 {
        coarse.now += Span::from_nanos(10 * MS);
        coarse.tell(Input::Tick);
    }
    assert!(said(&coarse) == said(&straight));
}

#[test]
fn the_plant_follows_within_its_lag_and_comes_to_rest() {
    let truth = PlantFile::from_yaml(PLANT).unwrap();
    let machine = machine();
    let plant = Plant::new(&machine, &truth).unwrap();
    let mut shop = Shop::new(&Config::default(), &machine, plant);
    let (outcome, message, _) = shop
        .run("F6000 G1 X150 Y-100 Z120\nA-30 C90\nG2 X100 I-25\nG0 X0 Y0 Z20 A0 C0\nG4 P0.5\nM2");
    assert_eq!((outcome, message), done());
    let states = shop.states();
    let worst = |axis: Axis| {
        states
            .iter()
            .map(|s| (s.commanded[axis] - s.motor[axis]).abs())
            .fold(0.0, f64::max)
    };
    for axis in Axis::LINEAR {
        assert!(worst(axis) < 0.5, "{axis}: {} mm", worst(axis));
    }
    let last = states.last().unwrap();
    for axis in last.axes.iter() {
        let rest = (last.commanded[axis] - last.motor[axis]).abs();
        assert!(
            rest < if axis.is_linear() { 1e-3 } else { 1e-5 },
            "{axis}: {rest}"
        );
    }
}
