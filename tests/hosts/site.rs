//! Hosts of a cell: a clock that is wrong, what relates it to the controller's, and nodes.

use std::time::{SystemTime, UNIX_EPOCH};

use abbe_tests::hosts::network::Network;
use abbe_tests::program::Process;
use abbe_tests::scenario::Scenario;
use metrology::stamp::{Host, Stamp};

/// What a host's clock is made to show: the truth that its map is held against.
#[derive(Clone, Copy)]
pub struct ClockError {
    pub offset_s: f64,
    pub drift: f64,
    since: Stamp<Host>,
}

impl ClockError {
    /// From now on.
    pub fn of(offset_s: f64, drift: f64) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        let seconds = i64::try_from(now.as_secs()).unwrap();
        Self {
            offset_s,
            drift,
            since: Stamp::from_nanos(seconds * 1_000_000_000),
        }
    }

    fn arguments(&self) -> Vec<String> {
        let values = [
            ("offset_s", self.offset_s),
            ("drift_us_per_s", self.drift * 1e6),
            ("since_s", self.since.as_secs_f64()),
        ];
        let set = |(key, value)| ["-p".to_owned(), format!("clock_error.{key}:={value:?}")];
        values.into_iter().flat_map(set).collect()
    }

    /// What the true clock is ahead of this one when it shows `own`.
    pub fn true_offset_s(&self, own: Stamp<Host>) -> f64 {
        let shown_s = (own - self.since).as_secs_f64() - self.offset_s;
        -self.offset_s - self.drift * shown_s / (1.0 + self.drift)
    }
}

/// Arguments that set a parameter.
pub fn parameter(name: &str, value: &str) -> [String; 2] {
    ["-p".to_owned(), format!("{name}:={value}")]
}

/// Nodes of a host and their arguments.
pub struct Site<'n> {
    network: &'n Network,
    host: &'static str,
    clock: Option<ClockError>,
    nodes: Vec<Process>,
}

impl<'n> Site<'n> {
    /// A host with the node that relates its clock to the controller's.
    pub fn new(network: &'n Network, host: &'static str, clock: Option<ClockError>) -> Self {
        let mut site = Self {
            network,
            host,
            clock,
            nodes: Vec::new(),
        };
        let mut names = parameter("host", host).to_vec();
        names.extend(parameter("reference", "controller"));
        names.extend(parameter("period_ms", "20.0"));
        names.extend(parameter_of_name(host));
        site.start("host_clock", names);
        site
    }

    /// Starts a node of the suite.
    pub fn start(&mut self, node: &str, arguments: Vec<String>) {
        let arguments = self.with_clock(arguments);
        let started = self.network.node(self.host, node, &arguments);
        self.nodes.push(started);
    }

    /// Starts a node that is a program of its own.
    pub fn start_program(&mut self, program: &str, arguments: Vec<String>) {
        let mut words = vec!["--ros-args".to_owned()];
        words.extend(self.with_clock(arguments));
        let started = self.network.program(self.host, program, &words);
        self.nodes.push(started);
    }

    fn with_clock(&self, mut arguments: Vec<String>) -> Vec<String> {
        if let Some(clock) = self.clock {
            arguments.extend(clock.arguments());
            arguments.extend(parameter("clock_host", self.host));
        }
        arguments
    }

    /// Stops its nodes.
    pub fn stop(self) {
        for node in self.nodes {
            node.stop();
        }
    }
}

/// Every host clock is a node of its own name.
fn parameter_of_name(host: &str) -> [String; 2] {
    ["-r".to_owned(), format!("__node:=clock_of_{host}")]
}

/// Arguments that name a node's parameter file in a scenario.
pub fn file_of(scenario: &Scenario, node: &str) -> Vec<String> {
    let file = scenario.argument(&format!("{node}.yaml"));
    vec!["--params-file".to_owned(), file]
}
