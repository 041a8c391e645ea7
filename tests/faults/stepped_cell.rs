//! A cell of separate processes whose computer's clock the test sets.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::diagnostic_msgs::msg::DiagnosticStatus;
use abbe_msgs::topics;
use abbe_tests::computer_clock::{Faketime, SetClock};
use abbe_tests::graph::{Graph, now};
use abbe_tests::namespace;
use abbe_tests::program::{Process, command};
use abbe_tests::scenario::Scenario;
use nix::sys::signal::Signal;

use crate::said::later;

const RECORDER: &str = "recorder";

/// How long a node may take to end in good order.
const STOP: Duration = Duration::from_secs(20);
/// Between two looks of a node at its clock, s: one, on a busy computer.
const LOOK_S: f64 = 5.0;
/// How old what a node says of the time may be when it is heard, s.
const DELAY_S: f64 = 5.0;

pub struct Cell {
    /// They end before their clock does.
    nodes: BTreeMap<&'static str, Process>,
    clock: SetClock,
    pub scenario: Scenario,
    pub graph: Graph,
    domain: u16,
}

/// A machine that rests, with compensation on.
fn scenario() -> Scenario {
    let scenario = Scenario::copy_of("short_cell");
    let plan = "title: rest\nsteps:\n  - {do: wait, seconds: 3600.0}\n";
    scenario.write("plan.yaml", plan);
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 250.0\n    compensation_rate_limit_um_s: 25.0",
    );
    scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
    scenario
}

impl Cell {
    /// A cell that is not launched yet, in a network and with mounts of its own.
    pub fn new(faketime: &Faketime, domain: u16) -> Self {
        // What the library shares between a process and its children stays with this cell.
        namespace::small_disk(Path::new("/dev/shm"), 1024);
        let scenario = scenario();
        let clock = SetClock::new(faketime, scenario.path("clock"));
        Self {
            nodes: BTreeMap::new(),
            clock,
            scenario,
            graph: Graph::join(domain),
            domain,
        }
    }

    /// Starts the recorder and these nodes, and waits until all have spoken.
    pub fn launch(&mut self, nodes: &[&'static str]) {
        let since = Instant::now();
        for name in nodes.iter().copied().chain([RECORDER]) {
            let argument = if name == RECORDER {
                ["-p".to_owned(), format!("bag:={}", self.bag().display())]
            } else {
                let file = self.scenario.argument(&format!("{name}.yaml"));
                ["--params-file".to_owned(), file]
            };
            let mut command = command(self.domain, &["node", name, "--ros-args"]);
            command.args(argument);
            self.clock.put_under(&mut command);
            self.nodes.insert(name, Process::start(command));
        }
        for name in self.nodes.keys() {
            self.graph.alive(name, since);
        }
    }

    pub fn bag(&self) -> PathBuf {
        self.scenario.path("recorded")
    }

    /// Sets the computer's clock by so much, s; when that was.
    pub fn step_clock(&mut self, by_s: i64) -> Instant {
        let at = Instant::now();
        self.clock.set(self.clock.ahead_s() + by_s);
        at
    }

    /// What the computer's clock shows.
    pub fn now(&self) -> Time {
        later(&now(), self.clock.ahead_s() * 1_000_000_000)
    }

    /// What it showed at an instant after which it was not set, s.
    fn shown_s(&self, at: Instant) -> f64 {
        let (now, since) = (self.now(), at.elapsed());
        seconds(&now) - since.as_secs_f64()
    }

    /// Every process runs, and says so by the clock as it is set, after `since`.
    pub fn goes_on(&mut self, since: Instant) {
        // What was on its way does not count.
        let since = since + Duration::from_millis(500);
        for name in self.nodes.keys() {
            let own = format!("/{name}");
            let (at, stamp) = self.graph.wait(&format!("{name} goes on"), |graph| {
                let all = graph.since(&topics::DIAGNOSTICS, since);
                let is_own = |status: &DiagnosticStatus| status.name == own;
                let mut all = all.into_iter();
                let (at, said) = all.find(|(_, array)| array.status.iter().any(is_own))?;
                Some((at, said.header.stamp))
            });
            let age_s = self.shown_s(at) - seconds(&stamp);
            assert!(
                (-DELAY_S..DELAY_S).contains(&age_s),
                "{name}: {age_s} s old"
            );
        }
        for (name, process) in &mut self.nodes {
            assert!(process.is_running(), "{name} ended");
        }
        self.graph.next(&topics::AXES_STATE, since, |_| true);
        self.graph.next(&topics::JOINT_STATES, since, |_| true);
        self.graph.next(&topics::COMPENSATION, since, |_| true);
    }

    /// Every node says that the clock was set back by `by_s`, and what that means.
    pub fn said_set_back(&self, by_s: f64, since: Instant) {
        for name in self.nodes.keys() {
            let words = ["clock went back", "samples of best effort"];
            let said = self
                .graph
                .condition(name, "clock_stepped_back", &words, since);
            let step = said.values.iter().find(|pair| pair.key == "step_s");
            let step_s: f64 = step.unwrap().value.parse().unwrap();
            // What passed between two looks at the clock is missing.
            assert!((0.0..LOOK_S).contains(&(step_s + by_s)), "{name}: {step_s}");
        }
    }

    /// Stops the recorder, then every node, with SIGINT; each ends with exit code 0. Gives when the recorder was told.
    pub fn stop(&mut self) -> Instant {
        let at = Instant::now();
        let stopped = |name: &str, process: Process| {
            let ended = process.ended_within(STOP);
            assert_eq!(ended.status.code(), Some(0), "{name}: {}", ended.said);
        };
        let recorder = self.nodes.remove(RECORDER).unwrap();
        recorder.signal(Signal::SIGINT);
        stopped(RECORDER, recorder);
        for process in self.nodes.values() {
            process.signal(Signal::SIGINT);
        }
        for (name, process) in std::mem::take(&mut self.nodes) {
            stopped(name, process);
        }
        at
    }
}

pub fn seconds(time: &Time) -> f64 {
    f64::from(time.sec) + f64::from(time.nanosec) * 1e-9
}
