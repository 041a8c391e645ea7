//! Wiring nodes to each other by the names of their ports.

use std::collections::{BTreeMap, BinaryHeap, VecDeque};

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::{Message, Qos, SERVICE_EVENT_SUFFIX, topics};
use metrology::stamp::{Host, Stamp};

use super::{Harness, Reverse, Route};
use crate::node::{Node, ServicePort, TopicPort};

/// Why nodes cannot be composed.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum ComposeError {
    #[error("node \"{node}\" is there twice: names must be unique")]
    SecondNode { node: String },
    #[error("topic \"{topic}\": {node} uses type {found}, others {expected}")]
    TypeMismatch {
        topic: String,
        node: String,
        found: String,
        expected: String,
    },
    #[error("service or action \"{name}\" is offered by both {first} and {second}")]
    SecondServer {
        name: String,
        first: String,
        second: String,
    },
    #[error("no node \"{node}\" is running, so none can be restarted")]
    UnknownNode { node: String },
    #[error("node \"{node}\" has other ports than the one it replaces")]
    OtherPorts { node: String },
}

/// The topic on which a service's calls are told.
fn events_of(port: &ServicePort) -> TopicPort {
    let description = port.events.description;
    TopicPort {
        topic: format!("{}{SERVICE_EVENT_SUFFIX}", port.service),
        type_name: description.type_name,
        type_hash: description.type_hash,
        definition: description.definition,
        qos: Qos::RELIABLE,
    }
}

impl Harness {
    /// Wires `nodes` to each other; simulated time begins at `start`, each timer's first tick is one period later.
    ///
    /// # Errors
    /// When names clash or types differ.
    pub fn compose(nodes: Vec<Box<dyn Node>>, start: Stamp<Host>) -> Result<Self, ComposeError> {
        let mut harness = Self {
            now: start,
            nodes: Vec::new(),
            routes: Vec::new(),
            diagnostics: 0,
            publications: Vec::new(),
            service_servers: BTreeMap::new(),
            service_events: BTreeMap::new(),
            action_servers: BTreeMap::new(),
            timers: BinaryHeap::new(),
            periods: Vec::new(),
            inbox: VecDeque::new(),
            emissions: Vec::new(),
            asked: BTreeMap::new(),
            next_id: 1,
            stopped: Vec::new(),
            observers: Vec::new(),
            condition_observers: Vec::new(),
        };
        for node in nodes {
            harness.add(node)?;
        }
        let diagnostics = TopicPort {
            topic: topics::DIAGNOSTICS.name.to_owned(),
            type_name: DiagnosticArray::TYPE_NAME,
            type_hash: DiagnosticArray::TYPE_HASH,
            definition: DiagnosticArray::DEFINITION,
            qos: topics::DIAGNOSTICS.qos,
        };
        harness.diagnostics = harness.route("the harness", &diagnostics)?;
        Ok(harness)
    }

    fn add(&mut self, node: Box<dyn Node>) -> Result<(), ComposeError> {
        let name = node.name().to_owned();
        if self.nodes.iter().any(|other| other.name() == name) {
            return Err(ComposeError::SecondNode { node: name });
        }
        let place = self.nodes.len();
        let ports = node.ports().clone();
        for (subscription, port) in ports.subscriptions.iter().enumerate() {
            let route = self.route(&name, port)?;
            self.routes[route].listeners.push((place, subscription));
        }
        let mut publications = Vec::with_capacity(ports.publications.len());
        for port in &ports.publications {
            publications.push(self.route(&name, port)?);
        }
        self.publications.push(publications);
        for (at, port) in ports.services.iter().enumerate() {
            self.offer(false, &port.service, (place, at), &name)?;
            let events = self.route(&name, &events_of(port))?;
            self.service_events.insert(port.service.clone(), events);
        }
        for (at, port) in ports.action_servers.iter().enumerate() {
            self.offer(true, &port.action, (place, at), &name)?;
        }
        for (timer, period) in ports.timers.iter().enumerate() {
            self.timers
                .push(Reverse((self.now + *period, place, timer)));
        }
        self.periods.push(ports.timers);
        self.stopped.push(false);
        self.nodes.push(node);
        Ok(())
    }

    fn route(&mut self, node: &str, port: &TopicPort) -> Result<usize, ComposeError> {
        let Some(place) = self
            .routes
            .iter()
            .position(|route| route.port.topic == port.topic)
        else {
            self.routes.push(Route {
                port: port.clone(),
                listeners: Vec::new(),
                sequence: 0,
                latched: None,
            });
            return Ok(self.routes.len() - 1);
        };
        let known = &self.routes[place].port;
        if known.type_name != port.type_name {
            return Err(ComposeError::TypeMismatch {
                topic: port.topic.clone(),
                node: node.to_owned(),
                found: port.type_name.to_owned(),
                expected: known.type_name.to_owned(),
            });
        }
        Ok(place)
    }

    fn offer(
        &mut self,
        action: bool,
        name: &str,
        end: (usize, usize),
        node: &str,
    ) -> Result<(), ComposeError> {
        let servers = if action {
            &mut self.action_servers
        } else {
            &mut self.service_servers
        };
        if let Some(first) = servers.insert(name.to_owned(), end) {
            return Err(ComposeError::SecondServer {
                name: name.to_owned(),
                first: self
                    .nodes
                    .get(first.0)
                    .map_or(node, |other| other.name())
                    .to_owned(),
                second: node.to_owned(),
            });
        }
        Ok(())
    }

    /// Place of the running node that `fresh` is to replace.
    pub(super) fn place_of(&self, fresh: &dyn Node) -> Result<usize, ComposeError> {
        let name = fresh.name().to_owned();
        let Some(place) = self.nodes.iter().position(|node| node.name() == name) else {
            return Err(ComposeError::UnknownNode { node: name });
        };
        if self.nodes[place].ports() != fresh.ports() {
            return Err(ComposeError::OtherPorts { node: name });
        }
        Ok(place)
    }
}
