//! Hosts of a cell: a clock that is wrong, what relates it to the reference's, and nodes.
//!
//! A clock is wrong by parameters of each node on the host ([`Site::new`] takes the error), or because its computer's is
//! ([`Network::computer_clock`]), under whatever else reads it as well.

use super::network::Network;
use crate::computer_clock::ClockError;
use crate::program::Process;
use crate::scenario::Scenario;

/// The host whose clock is right.
pub const REFERENCE: &str = "controller";

/// Parameters of a node that make its host's clock wrong.
fn wrong_by(error: &ClockError) -> Vec<String> {
    let values = [
        ("offset_s", error.offset_s),
        ("drift_us_per_s", error.drift * 1e6),
        ("since_s", error.since.as_secs_f64()),
    ];
    let set = |(key, value)| ["-p".to_owned(), format!("clock_error.{key}:={value:?}")];
    values.into_iter().flat_map(set).collect()
}

/// Arguments that set a parameter.
#[must_use]
pub fn parameter(name: &str, value: &str) -> [String; 2] {
    ["-p".to_owned(), format!("{name}:={value}")]
}

/// Nodes of a host and their arguments.
pub struct Site<'n> {
    network: &'n Network,
    host: &'static str,
    /// By which its nodes' parameters make the clock wrong.
    error: Option<ClockError>,
    nodes: Vec<Process>,
}

impl<'n> Site<'n> {
    /// A host with the node that relates its clock to the reference's.
    #[must_use]
    pub fn new(network: &'n Network, host: &'static str, error: Option<ClockError>) -> Self {
        let mut site = Self {
            network,
            host,
            error,
            nodes: Vec::new(),
        };
        let mut names = parameter("host", host).to_vec();
        names.extend(parameter("reference", REFERENCE));
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
        arguments.extend(self.error.iter().flat_map(wrong_by));
        if self.error.is_some() || self.network.has_wrong_clock(self.host) {
            arguments.extend(parameter("clock_host", self.host));
        }
        arguments
    }

    /// Stops its nodes; what they said.
    ///
    /// # Panics
    /// When one does not stop in good order.
    pub fn stop(self) -> String {
        self.nodes.into_iter().map(Process::stop).collect()
    }
}

/// Every host clock is a node of its own name.
fn parameter_of_name(host: &str) -> [String; 2] {
    ["-r".to_owned(), format!("__node:=clock_of_{host}")]
}

/// Arguments that name a node's parameter file in a scenario.
#[must_use]
pub fn file_of(scenario: &Scenario, node: &str) -> Vec<String> {
    let file = scenario.argument(&format!("{node}.yaml"));
    vec!["--params-file".to_owned(), file]
}
