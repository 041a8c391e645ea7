//! The same on the wire: processes, and a stranger who writes, calls and proposes what no good node does. Each node
//! answers afterwards, and stops when it is asked to.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use abbe_msgs::rcl_interfaces::srv::{DescribeParameters, GetParameters, SetParameters};
use abbe_tests::asker::service;
use abbe_tests::graph::Graph;
use abbe_tests::namespace;
use abbe_tests::program::{Process, domain};
use metrology::stamp::{Host, Span, Stamp};
use nix::sys::signal::Signal;
use node_runtime::arguments::Arguments;
use node_runtime::node::Ports;
use node_runtime::parameter::Parameter;
use node_runtime::{Emission, Event, Node, NodeFault, Setup, launch};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

use crate::draw::Dice;
use crate::form::Form;
use crate::nodes::{TRIED, Tried};
use crate::{programs, request_of};

/// What each node is sent at least.
const SENT: u64 = 300;
/// What is promised of every node, under any single message.
const STOPS: Duration = Duration::from_secs(5);

/// Sends what it draws to whatever `of` hears and offers.
struct Stranger {
    ports: Ports,
    dice: Dice,
    next_id: u64,
    sent: Arc<AtomicU64>,
    /// Services and actions that answered.
    answered: Arc<Mutex<BTreeSet<String>>>,
}

impl Stranger {
    fn of(name: &str, node: &Ports) -> Self {
        let mut clients = node.services.clone();
        let own = |service: &str| format!("/{name}/{service}");
        clients.push(service::<GetParameters>(&own("get_parameters")));
        clients.push(service::<DescribeParameters>(&own("describe_parameters")));
        clients.push(service::<SetParameters>(&own("set_parameters")));
        Self {
            ports: Ports {
                publications: node.subscriptions.clone(),
                clients,
                action_clients: node.action_servers.clone(),
                timers: vec![Span::from_nanos(4_000_000)],
                ..Ports::default()
            },
            dice: Dice {
                rng: Pcg64Mcg::seed_from_u64(7),
                words: programs(),
            },
            next_id: 1,
            sent: Arc::default(),
            answered: Arc::default(),
        }
    }

    fn drawn(&mut self, type_name: &str, at: Stamp<Host>) -> Arc<[u8]> {
        let around_s = i32::try_from(at.nanos() / 1_000_000_000).unwrap();
        let form = Form::of(type_name);
        let value = self.dice.value(&form, around_s);
        // The middleware reads the header itself.
        Arc::from(crate::form::Writer::message(&form, &value))
    }

    fn hears(&self, name: &str) {
        self.answered.lock().unwrap().insert(name.to_owned());
    }
}

impl Node for Stranger {
    fn name(&self) -> &str {
        "stranger"
    }

    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn parameters(&self) -> &[Parameter] {
        &[]
    }

    fn handle(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        match event {
            Event::Timer { .. } => {}
            Event::Response { client, .. } => {
                self.hears(&self.ports.clients[client].service);
                return Ok(());
            }
            Event::GoalAnswer { client, .. } => {
                self.hears(&self.ports.action_clients[client].action);
                return Ok(());
            }
            Event::Shutdown => {
                out.push(Emission::Stopped);
                return Ok(());
            }
            _ => return Ok(()),
        }
        for publication in 0..self.ports.publications.len() {
            let type_name = self.ports.publications[publication].type_name;
            let bytes = self.drawn(type_name, at);
            out.push(Emission::Publish { publication, bytes });
        }
        // Calls wait for their answers: one at a time is enough of each.
        if self.dice.one_in(8) {
            self.next_id += 1;
            let id = self.next_id;
            let client = self.dice.rng.random_range(0..self.ports.clients.len());
            let request = request_of(self.ports.clients[client].type_name);
            let bytes = self.drawn(&request, at);
            out.push(Emission::Call { client, id, bytes });
            for client in 0..self.ports.action_clients.len() {
                let goal = format!("{}_Goal", self.ports.action_clients[client].type_name);
                let bytes = self.drawn(&goal, at);
                out.push(Emission::SendGoal { client, id, bytes });
            }
        }
        self.sent.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

#[test]
fn nodes_as_processes_answer_strangers_and_stop_when_they_are_asked_to() {
    namespace::alone("strangers on the wire", || {
        let mut seen = BTreeSet::new();
        for (place, tried) in TRIED.iter().enumerate() {
            // A bridge to nobody looks for its controller; one of each is enough.
            if tried.exec != "linuxcnc_bridge" && seen.insert(tried.exec) {
                let number = u16::try_from(place).unwrap();
                meets_a_stranger(tried, domain(number));
            }
        }
    });
}

fn meets_a_stranger(tried: &Tried, domain: u16) {
    let home = tempfile::tempdir().unwrap();
    let (file, node) = (tried.file(home.path()), tried.node(home.path()));
    let graph = Graph::join(domain);
    let process = Process::node(domain, tried.exec, &["--params-file", &file]);
    graph.alive(node.name(), Instant::now());
    let stranger = Stranger::of(node.name(), node.ports());
    let (sent, answered) = (Arc::clone(&stranger.sent), Arc::clone(&stranger.answered));
    let asked: BTreeSet<String> = stranger
        .ports
        .clients
        .iter()
        .map(|port| port.service.clone())
        .chain(
            stranger
                .ports
                .action_clients
                .iter()
                .map(|port| port.action.clone()),
        )
        .collect();
    let setup = Setup::new("stranger", &Arguments::default()).unwrap();
    let environment = abbe_tests::zenoh::environment(domain);
    let running = launch(&environment, vec![(setup, Box::new(stranger))]).unwrap();
    graph.wait_longer(
        Duration::from_secs(40),
        &format!("{} is sent enough and answers all", tried.exec),
        |_| {
            let enough = sent.load(Ordering::Relaxed) >= SENT;
            (enough && asked.is_subset(&answered.lock().unwrap())).then_some(())
        },
    );
    running.stop().unwrap();
    graph.alive(node.name(), Instant::now());
    let patience = Duration::from_secs_f64(node.patience().as_secs_f64());
    process.signal(Signal::SIGINT);
    let since = Instant::now();
    let ended = process.ended_within(STOPS.max(patience));
    eprintln!(
        "{}: {} rounds, stopped within {:.2} s",
        tried.exec,
        sent.load(Ordering::Relaxed),
        since.elapsed().as_secs_f64()
    );
    assert_eq!(
        ended.status.code(),
        Some(0),
        "{}: {}",
        tried.exec,
        ended.said
    );
    assert!(
        !ended.said.contains("panicked"),
        "{}: {}",
        tried.exec,
        ended.said
    );
}
