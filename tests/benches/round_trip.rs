//! `axes/state` in to `compensation` out at 1 kHz through DDS, between two processes on the loopback,
//! beside Cyclone DDS echoing messages of the same sizes between two processes of its own.
//!
//! Both are asked in turns of a few seconds, so that what else the computer does meets both. Every
//! position tells its number: the thermal part that comes back is a known slope times the position, so
//! an answer is matched with the state that it was computed from, and not with whatever came before it.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Wire as _, from_cdr, msg, to_cdr};
use metrology::sample::{AxisDrift, AxisState, ThermalModel};
use metrology::stamp::{Host, Span};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use node_runtime::environment::{DiscoveryRange, Environment};
use node_runtime::names::NodeNames;
use node_runtime::node::TopicPort;
use node_runtime::tap::{RawPublisher, RawTap, Selection, TapEvent};
use serde::Deserialize;

use crate::python;

const PERIOD: Duration = Duration::from_millis(1);
/// Longest turn of either side [s].
const TURN_S: u32 = 5;
/// How long the last answers of a turn are waited for.
const STRAGGLERS: Duration = Duration::from_secs(1);
const PATIENCE: Duration = Duration::from_secs(15);
/// Positions are numbered within this; an answer 10 s late would be taken for another's.
const NUMBERS: usize = 10_000;
const STEP_MM: f64 = 0.01;
const SLOPE_MM_PER_MM: f64 = 1e-3;
const WARM_UP_STATES: usize = 500;
const BUDGET_P99_US: f64 = 1_000.0;

/// Ends its process whatever happens.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Round trips of one side.
#[derive(Default)]
struct Trips {
    sent: usize,
    nanos: Vec<i64>,
}

impl Trips {
    fn at(&self, share: f64) -> f64 {
        let place = (share * self.nanos.len() as f64) as usize;
        let nanos = self.nanos.get(place).or(self.nanos.last());
        nanos.map_or(f64::NAN, |nanos| *nanos as f64 * 1e-3)
    }

    fn figures_us(&self) -> [f64; 3] {
        [0.5, 0.99, 0.999].map(|share| self.at(share))
    }

    fn print(&self, name: &str) {
        let [p50, p99, p999] = self.figures_us();
        let lost = self.sent - self.nanos.len();
        println!(
            "{name:<14} {p50:>8.0} {p99:>8.0} {p999:>8.0} {:>8} {lost:>6}",
            self.sent
        );
    }
}

/// The program `abbe` of this workspace, built as it is now.
pub fn built_program() -> PathBuf {
    let output = Command::new(env!("CARGO"))
        .args([
            "build",
            "--release",
            "--quiet",
            "-p",
            "abbe",
            "--message-format",
            "json",
        ])
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "cargo build -p abbe: {}",
        output.status
    );
    let built = String::from_utf8(output.stdout).unwrap();
    let executable = built.lines().find_map(|line| {
        let said: serde_json::Value = serde_json::from_str(line).ok()?;
        said["executable"].as_str().map(PathBuf::from)
    });
    executable.expect("cargo names the program that it built")
}

fn compensating_node(environment: &Environment, program: &Path) -> Process {
    let parameters = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../launch_configs/first_run/axis_compensation.yaml");
    let child = Command::new(program)
        .args([
            "node",
            "axis_compensation",
            "--ros-args",
            "--log-level",
            "error",
            "--params-file",
        ])
        .arg(parameters)
        .env("ROS_DOMAIN_ID", environment.domain_id.to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env_remove("ROS_LOCALHOST_ONLY")
        .env_remove("RUST_LOG")
        .spawn();
    Process(child.unwrap())
}

fn port<M: Message>(topic: &Topic<M>) -> TopicPort {
    TopicPort {
        topic: topic.name.to_owned(),
        type_name: M::TYPE_NAME,
        type_hash: M::TYPE_HASH,
        definition: M::DEFINITION,
        qos: topic.qos,
    }
}

/// Drift of X alone, proportional to its position.
fn model(at: Stamp<Host>) -> ThermalModel {
    let mut axes = PerAxis::default();
    axes[Axis::X] = Some(AxisDrift {
        slope_mm_per_mm: SLOPE_MM_PER_MM,
        span_mm: (0.0, NUMBERS as f64 * STEP_MM),
        ..AxisDrift::default()
    });
    ThermalModel {
        at,
        axes,
        valid_from: Stamp::from_nanos(0),
        valid_until: at + Span::from_nanos(86_400_000_000_000),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    }
}

/// An answer: number of its state, size, when it was in hand.
struct Answer {
    number: usize,
    bytes: usize,
    came: Stamp<Host>,
}

fn answer(bytes: &[u8]) -> Option<Answer> {
    let came = RawPublisher::now();
    let compensation = from_cdr::<msg::AxisCompensation>(bytes).unwrap();
    let thermal_mm = compensation.to_inner().unwrap().thermal[Axis::X];
    let number = (thermal_mm / (SLOPE_MM_PER_MM * STEP_MM)).round() as usize;
    // Before the model has come there is no thermal part; numbers begin at 1.
    (number > 0).then_some(Answer {
        number,
        bytes: bytes.len(),
        came,
    })
}

/// The bench's side of the loop through the node.
struct Loop {
    publisher: RawPublisher,
    tap: RawTap,
    answers: Receiver<Answer>,
    sent_at: Vec<Option<Stamp<Host>>>,
    next: usize,
    state_bytes: usize,
    answer_bytes: usize,
    trips: Trips,
}

impl Loop {
    fn join(environment: &Environment) -> Self {
        let names = |name| NodeNames::new(name, &[]).unwrap();
        let ports = [port(&topics::AXES_STATE), port(&topics::THERMAL_MODEL)];
        let mut publisher =
            RawPublisher::start(environment, &names("states"), &ports, 1_000, PATIENCE).unwrap();
        let latched = msg::ThermalModel::from_inner(&model(RawPublisher::now()));
        assert!(publisher.publish(1, None, Arc::from(to_cdr(&latched))));
        let (sender, answers) = channel();
        let heard = format!("/{}", topics::COMPENSATION.name);
        let selection = Selection::Matching(vec![heard]);
        let tap = RawTap::start(environment, &names("offsets"), selection, move |event| {
            if let TapEvent::Sample(sample) = event
                && let Some(answer) = answer(&sample.bytes)
            {
                let _ = sender.send(answer);
            }
        });
        Self {
            publisher,
            tap: tap.unwrap(),
            answers,
            sent_at: vec![None; NUMBERS],
            next: 1,
            state_bytes: 0,
            answer_bytes: 0,
            trips: Trips::default(),
        }
    }

    fn send(&mut self) {
        let number = self.next;
        self.next = number % (NUMBERS - 1) + 1;
        let mut commanded = PerAxis::default();
        commanded[Axis::X] = number as f64 * STEP_MM;
        let at = RawPublisher::now();
        let state = AxisState {
            scale: commanded,
            ..AxisState::standing(at, Stamp::from_nanos(at.nanos()), AxisSet::XYZ, commanded)
        };
        let bytes = to_cdr(&msg::AxisState::from_inner(&state));
        self.state_bytes = bytes.len();
        self.sent_at[number] = Some(RawPublisher::now());
        self.trips.sent += 1;
        assert!(self.publisher.publish(0, None, Arc::from(bytes)));
    }

    fn note(&mut self, answer: &Answer) {
        self.answer_bytes = answer.bytes;
        if let Some(sent) = self.sent_at[answer.number].take() {
            self.trips.nanos.push((answer.came - sent).nanos());
        }
    }

    /// Takes answers until `until`, or until none is missing when `all` is set.
    fn take(&mut self, until: Instant, all: bool) {
        while !(all && self.trips.nanos.len() == self.trips.sent) {
            let left = until.saturating_duration_since(Instant::now());
            match self.answers.recv_timeout(left) {
                Ok(answer) => self.note(&answer),
                Err(RecvTimeoutError::Timeout) => return,
                Err(RecvTimeoutError::Disconnected) => panic!("the tap has ended"),
            }
        }
    }

    fn turn(&mut self, states: usize) {
        let begin = Instant::now();
        for number in 0..states {
            self.send();
            self.take(begin + PERIOD * (number as u32 + 1), false);
        }
        self.take(Instant::now() + STRAGGLERS, true);
        // What has not come by now is lost, and must not be taken for one of the next turn.
        self.sent_at.fill(None);
    }

    /// Sends until the node answers from the model, then forgets it all.
    fn warm_up(&mut self) {
        let deadline = Instant::now() + PATIENCE;
        while self.trips.nanos.is_empty() {
            assert!(
                Instant::now() < deadline,
                "axis_compensation does not answer"
            );
            self.turn(1);
        }
        self.turn(WARM_UP_STATES);
        self.trips = Trips::default();
    }

    fn leave(self) -> Trips {
        self.publisher.stop().unwrap();
        self.tap.stop().unwrap();
        self.trips
    }
}

/// Cyclone DDS: one process that echoes, one that asks.
struct Cyclone {
    _echo: Process,
    _ping: Process,
    orders: ChildStdin,
    answers: BufReader<ChildStdout>,
    trips: Trips,
}

#[derive(Deserialize)]
struct Turn {
    sent: usize,
    round_trips_ns: Vec<i64>,
}

impl Cyclone {
    fn start(domain_id: u16, ping_bytes: usize, answer_bytes: usize) -> Option<Self> {
        let start = |role: &str, bytes: usize| {
            let mut command = python::peer("echo_cyclone.py")?;
            command
                .args([role, &domain_id.to_string(), &bytes.to_string()])
                .stdin(Stdio::piped())
                .stdout(Stdio::piped());
            Some(Process(command.spawn().unwrap()))
        };
        let (echo, mut ping) = (start("echo", answer_bytes)?, start("ping", ping_bytes)?);
        let orders = ping.0.stdin.take().unwrap();
        let answers = BufReader::new(ping.0.stdout.take().unwrap());
        let mut cyclone = Self {
            _echo: echo,
            _ping: ping,
            orders,
            answers,
            trips: Trips::default(),
        };
        let deadline = Instant::now() + PATIENCE;
        while cyclone.trips.nanos.is_empty() {
            assert!(Instant::now() < deadline, "Cyclone DDS does not answer");
            cyclone.turn(WARM_UP_STATES);
        }
        cyclone.turn(WARM_UP_STATES);
        cyclone.trips = Trips::default();
        Some(cyclone)
    }

    fn turn(&mut self, pings: usize) {
        writeln!(self.orders, "{pings}").unwrap();
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        let turn: Turn = serde_json::from_str(&line).unwrap();
        self.trips.sent += turn.sent;
        self.trips.nanos.extend(turn.round_trips_ns);
    }
}

/// Measures `seconds` of each side, in turns, and prints both and their ratio. `program` is a built
/// `abbe`; without one it is built now.
pub fn run(seconds: u32, program: Option<PathBuf>) {
    let domain_id = u16::try_from(100 + std::process::id() % 60 * 2).unwrap();
    let environment = Environment {
        domain_id,
        range: DiscoveryRange::Localhost,
        ..Environment::default()
    };
    let node = compensating_node(&environment, &program.unwrap_or_else(built_program));
    let mut ours = Loop::join(&environment);
    ours.warm_up();
    let (state_bytes, answer_bytes) = (ours.state_bytes, ours.answer_bytes);
    let mut cyclone = Cyclone::start(domain_id + 1, state_bytes, answer_bytes);
    let mut left_s = seconds;
    while left_s > 0 {
        let states = left_s.min(TURN_S) as usize * 1_000;
        ours.turn(states);
        if let Some(cyclone) = &mut cyclone {
            cyclone.turn(states);
        }
        left_s -= left_s.min(TURN_S);
    }
    let mut ours = ours.leave();
    drop(node);
    ours.nanos.sort_unstable();
    println!("1 kHz for {seconds} s, {state_bytes} B there, {answer_bytes} B back [us]");
    println!("                    p50      p99    p99.9     sent   lost");
    ours.print("ours");
    if let Some(Cyclone { mut trips, .. }) = cyclone {
        trips.nanos.sort_unstable();
        trips.print("Cyclone DDS");
        let (mine, theirs) = (ours.figures_us(), trips.figures_us());
        let [p50, p99, p999] = std::array::from_fn(|place| mine[place] / theirs[place]);
        println!("{:<14} {p50:>8.2} {p99:>8.2} {p999:>8.2}", "ratio");
    }
    let is_kept = ours.at(0.99) <= BUDGET_P99_US && ours.nanos.len() == ours.sent;
    let word = if is_kept { "kept" } else { "missed" };
    println!("budget: p99 <= {BUDGET_P99_US} us, none lost: {word}");
}
