//! A cell of separate processes with a recorder, at rest or at work, in which nodes are killed.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::drift;
use abbe_tests::graph::{Graph, Voice, now, port};
use abbe_tests::program::{Process, root};
use abbe_tests::scenario::Scenario;
use nix::sys::signal::Signal;

/// Nodes of the cell beside its recorder.
pub const NODES: [&str; 13] = [
    "fake_cnc",
    "probe",
    "latency_calibrator",
    "thermal_model",
    "axis_compensation",
    "sequencer",
    "machine_frames",
    "grid_encoder",
    "gap_diagnosis",
    "host_clock",
    "rotary_axes",
    "mtconnect_bridge",
    "replayer",
];
pub const RECORDER: &str = "recorder";

/// Nodes of the cell that its scenario does not have, and what they are told.
const MORE: [(&str, &str); 6] = [
    ("grid_encoder", "machine_file: machine.yaml"),
    ("gap_diagnosis", "machine_file: machine.yaml"),
    ("host_clock", "host: models, reference: controller"),
    ("rotary_axes", "machine_file: five_axis.yaml"),
    (
        "mtconnect_bridge",
        "source: log, log_file: shift.shdr, map_file: map.yaml",
    ),
    (
        "replayer",
        "bag: bags/grid_circles, topics: [/grid/position], repeat: true, clock: false, onto_a_running_graph: true",
    ),
];

/// The load that a machine reports, by the name of its topic and as `mtconnect_bridge` maps it.
const REPORTED: &str = "spindle_load";
const MAP: &str = "values:\n  Sload: {is: load, name: spindle_load, unit: PERCENT}\n";
/// Between two lines of its log, ms, and how many there are: enough for the longest round.
const LOG_PERIOD_MS: u32 = 100;
const LOG_LINES: u32 = 3_000;

/// Rate at which fake_cnc follows a compensation at most, here, m/s.
pub const RATE_LIMIT_M_S: f64 = 25e-6;

/// How long a node may take to end in good order.
const STOP: Duration = Duration::from_secs(20);

pub struct Cell {
    scenario: Scenario,
    domain: u16,
    pub graph: Graph,
    pub nodes: BTreeMap<&'static str, Process>,
    voice: Voice,
    bags: u32,
}

/// A plan that touches and works until it is stopped, or one that rests.
fn scenario(works: bool) -> Scenario {
    let scenario = Scenario::copy_of("short_cell");
    let plan = if works {
        "title: work\nsteps:\n  - {do: latency, feature: block_1.z, feeds_mm_min: [120.0, 240.0, 480.0], repeats: 2}\n  \
         - {do: produce, program: production.ngc, minutes: 60.0, serve_updates: false}\n"
    } else {
        "title: rest\nsteps:\n  - {do: wait, seconds: 3600.0}\n"
    };
    scenario.write("plan.yaml", plan);
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 250.0\n    compensation_rate_limit_um_s: 25.0",
    );
    scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
    for (node, parameter) in MORE {
        let text = format!("/**:\n  ros__parameters: {{{parameter}}}\n");
        scenario.write(&format!("{node}.yaml"), &text);
    }
    let five_axis = root().join("launch_configs/five_axis/machine.yaml");
    let five_axis = std::fs::read_to_string(five_axis).unwrap();
    scenario.write("five_axis.yaml", &five_axis);
    scenario.write("map.yaml", MAP);
    scenario.write("shift.shdr", &log());
    scenario
}

/// Lines of an adapter, of another day: the bridge tells them from its start on.
fn log() -> String {
    let line = |number: u32| {
        let (s, ms) = (number * LOG_PERIOD_MS / 1000, number * LOG_PERIOD_MS % 1000);
        let (minute, second, load) = (s / 60, s % 60, 20 + number % 7);
        format!("2016-11-29T11:{minute:02}:{second:02}.{ms:03}Z|Sload|{load}\n")
    };
    (0..LOG_LINES).map(line).collect()
}

impl Cell {
    /// Launches every process, and does not wait for any.
    pub fn launch_all(works: bool, domain: u16) -> Self {
        let graph = Graph::join(domain);
        let mut voice = graph.voice(&[port(&topics::THERMAL_MODEL)]);
        voice.say(0, &drift::model(&now()));
        let mut cell = Self {
            scenario: scenario(works),
            domain,
            graph,
            nodes: BTreeMap::new(),
            voice,
            bags: 0,
        };
        for name in NODES.into_iter().chain([RECORDER]) {
            cell.launch(name);
        }
        cell
    }

    pub fn launch(&mut self, name: &'static str) {
        let process = if name == RECORDER {
            self.bags += 1;
            let bag = format!("bag:={}", self.bag(self.bags).display());
            Process::node(self.domain, name, &["-p", &bag])
        } else {
            let file = self.scenario.argument(&format!("{name}.yaml"));
            Process::node(self.domain, name, &["--params-file", &file])
        };
        self.nodes.insert(name, process);
    }

    fn bag(&self, number: u32) -> PathBuf {
        self.scenario.path(&format!("recorded_{number}"))
    }

    /// Every bag that a recorder was told to make, in order.
    pub fn bags(&self) -> Vec<PathBuf> {
        (1..=self.bags).map(|number| self.bag(number)).collect()
    }

    /// Kills a process and gives the instant.
    pub fn kill(&mut self, name: &str) -> Instant {
        let process = self.nodes.remove(name).unwrap();
        process.signal(Signal::SIGKILL);
        let at = Instant::now();
        let ended = process.ended_within(Duration::from_secs(5));
        assert_eq!(
            ended.status.code(),
            None,
            "{name} had ended by itself: {}",
            ended.said
        );
        at
    }

    /// Every node that is there runs, and speaks after `since`.
    pub fn others_go_on(&mut self, since: Instant) {
        // What was on its way does not count.
        let since = since + Duration::from_millis(500);
        for (name, process) in &mut self.nodes {
            self.graph.alive(name, since);
            assert!(process.is_running(), "{name} ended");
        }
        if self.nodes.contains_key("fake_cnc") {
            self.graph.next(&topics::AXES_STATE, since, |_| true);
            self.graph.next(&topics::JOINT_STATES, since, |_| true);
            if self.nodes.contains_key("axis_compensation") {
                self.graph.next(&topics::COMPENSATION, since, |_| true);
            }
        }
    }

    /// What the machine reports is heard since `since`.
    pub fn reported(&self, since: Instant) {
        self.graph.wait("what the machine reports", |graph| {
            let told = graph.member_since(&topics::MACHINE, REPORTED, since);
            (!told.is_empty()).then_some(())
        });
    }

    pub fn compensated(&self, since: Instant) {
        self.graph.next(&topics::COMPENSATION, since, |message| {
            let mut totals = message.total.iter();
            totals.all(|total| (total - drift::DRIFT_M).abs() < 0.2e-6)
        });
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

    /// Leaves the graph; the folder goes with the cell.
    pub fn leave(self) {
        self.voice.stop();
    }
}
