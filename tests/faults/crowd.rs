//! More participants on one computer than announce themselves to each other without multicast.

use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::graph::Graph;
use abbe_tests::namespace;
use abbe_tests::program::{Process, domain};
use abbe_tests::scenario::Scenario;

/// Participants that find each other on a plain `lo`.
const MEET: usize = 12;

/// A computer with more participants than those.
struct Crowd {
    scenario: Scenario,
    domain: u16,
    nodes: Vec<(String, Process)>,
}

impl Crowd {
    fn of(domain: u16) -> Self {
        Self {
            scenario: Scenario::copy_of("short_cell"),
            domain,
            nodes: Vec::new(),
        }
    }

    fn add(&mut self) -> String {
        let name = format!("probe_{}", self.nodes.len());
        let file = self.scenario.argument("probe.yaml");
        let rename = format!("__node:={name}");
        let arguments = ["-r", &rename, "--params-file", &file];
        let process = Process::node(self.domain, "probe", &arguments);
        self.nodes.push((name.clone(), process));
        name
    }

    /// Stops all; what the last one said.
    fn stop(self) -> Vec<String> {
        let said = self.nodes.into_iter().map(|(_, process)| process.stop());
        said.collect()
    }
}

/// Whether `graph` hears of `node` within some seconds.
fn hears(graph: &Graph, node: &str) -> bool {
    let deadline = Instant::now() + Duration::from_secs(6);
    let name = format!("/{node}");
    let since = Instant::now();
    while Instant::now() < deadline {
        let all = graph.since(&topics::DIAGNOSTICS, since);
        let mut statuses = all.iter().flat_map(|(_, array)| &array.status);
        if statuses.any(|status| status.name == name) {
            return true;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    false
}

#[test]
fn beyond_twelve_participants_on_a_plain_loopback_the_start_says_why_they_do_not_meet() {
    namespace::alone("thirteen participants on a plain lo", || {
        let domain = domain(7);
        let first = Graph::join(domain);
        let mut crowd = Crowd::of(domain);
        for _ in 1..MEET {
            crowd.add();
        }
        let since = Instant::now();
        for (name, _) in &crowd.nodes {
            first.alive(name, since);
        }
        let beyond = crowd.add();
        assert!(hears(&first, &beyond), "the first hears the thirteenth");
        let last = Graph::join(domain);
        assert!(
            hears(&last, "probe_0"),
            "the fourteenth hears one of the first"
        );
        let meet = hears(&last, &beyond);
        drop(last);
        let said = crowd.stop();
        let (of_beyond, of_others) = said.split_last().unwrap();
        eprintln!("{of_beyond}");
        assert!(!meet, "they meet: the warning is not true any more");
        for word in [
            "participant 12",
            "the first 12",
            "ip link set lo multicast on",
        ] {
            assert!(of_beyond.contains(word), "{word}: {of_beyond}");
        }
        assert!(of_others.iter().all(|said| !said.contains("multicast")));
    });
}

#[test]
fn beyond_twelve_participants_meet_where_the_loopback_has_multicast() {
    namespace::alone("fourteen participants on lo with multicast", || {
        namespace::multicast_on_loopback();
        let domain = domain(8);
        let mut crowd = Crowd::of(domain);
        for _ in 0..MEET {
            crowd.add();
        }
        let first = Graph::join(domain);
        let since = Instant::now();
        for (name, _) in &crowd.nodes {
            first.alive(name, since);
        }
        let last = Graph::join(domain);
        for (name, _) in &crowd.nodes {
            assert!(hears(&last, name), "{name}");
        }
        let beyond = crowd.add();
        assert!(hears(&last, &beyond), "{beyond}");
        drop(last);
        let said = crowd.stop();
        assert!(said.iter().all(|said| !said.contains("the first 12")));
    });
}
