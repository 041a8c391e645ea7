//! The deterministic runner: many nodes in one process, wired to each other in one total order.
//!
//! Time is simulated and moves from timer to timer. Everything that follows from a timer tick is
//! delivered at the same instant, first in, first out, before the next timer; timers that are due
//! together go in the order of the nodes. So the order of all events, and with it every byte that
//! is published, is a function of the nodes and their first inputs alone. Observers see each
//! publication in that order; a bag that keeps the order replays.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::sync::Arc;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::std_msgs::msg::Header;
use abbe_msgs::to_cdr;
use metrology::stamp::{Host, Span, Stamp};

use crate::clock::ros_time;
use crate::diagnostic::{Diagnostic, Level};
use crate::node::{Bytes, Emission, Event, GoalId, GoalStatus, Node, TopicPort};

mod compose;
mod deliver;
mod replay;
mod snapshot;

pub use compose::ComposeError;
pub use snapshot::{Snapshot, SnapshotError};

/// One publication as observers see it.
#[derive(Clone, Copy, Debug)]
pub struct Published<'a> {
    /// When, in simulated time.
    pub at: Stamp<Host>,
    /// Place in [`Harness::topics`].
    pub topic: usize,
    /// Counts the publications of this topic.
    pub sequence: u32,
    /// The message.
    pub bytes: &'a Bytes,
}

/// Called for every publication, in total order.
pub type Observer = Box<dyn FnMut(Published<'_>)>;

/// A condition as observers of conditions see it.
pub type ConditionObserver = Box<dyn FnMut(Stamp<Host>, &str, &Diagnostic)>;

struct Route {
    port: TopicPort,
    /// (node, subscription) of each listener.
    listeners: Vec<(usize, usize)>,
    sequence: u32,
    /// Last message of a latched topic, for nodes that join later.
    latched: Option<Bytes>,
}

/// Which node and port answers or asked.
type End = (usize, usize);

#[derive(Clone)]
enum Delivery {
    Message {
        node: usize,
        subscription: usize,
        bytes: Bytes,
    },
    Request {
        server: End,
        client: End,
        id: u64,
        bytes: Bytes,
    },
    Response {
        client: End,
        id: u64,
        bytes: Option<Bytes>,
    },
    Goal {
        server: End,
        client: End,
        id: GoalId,
        bytes: Bytes,
    },
    Cancel {
        server: End,
        id: GoalId,
    },
    Answer {
        client: End,
        id: GoalId,
        accepted: bool,
    },
    Feedback {
        client: End,
        id: GoalId,
        bytes: Bytes,
    },
    Ended {
        client: End,
        id: GoalId,
        status: GoalStatus,
        bytes: Option<Bytes>,
    },
    Shutdown {
        node: usize,
    },
}

/// Nodes wired to each other; see the module's head.
pub struct Harness {
    now: Stamp<Host>,
    nodes: Vec<Box<dyn Node>>,
    routes: Vec<Route>,
    /// Place of `/diagnostics` in `routes`.
    diagnostics: usize,
    /// Per node, publication port to place in `routes`.
    publications: Vec<Vec<usize>>,
    service_servers: BTreeMap<String, End>,
    /// By service: the route of its events.
    service_events: BTreeMap<String, usize>,
    action_servers: BTreeMap<String, End>,
    timers: BinaryHeap<Reverse<(Stamp<Host>, usize, usize)>>,
    periods: Vec<Vec<Span>>,
    inbox: VecDeque<Delivery>,
    emissions: Vec<Emission>,
    /// Server end and server-side number of a request or goal to the client's end and number.
    asked: BTreeMap<(bool, End, u64), (End, u64)>,
    next_id: u64,
    stopped: Vec<bool>,
    observers: Vec<Observer>,
    condition_observers: Vec<ConditionObserver>,
}

impl Harness {
    /// Current simulated time.
    #[must_use]
    pub fn now(&self) -> Stamp<Host> {
        self.now
    }

    /// Every topic, in the order to which [`Published::topic`] refers.
    pub fn topics(&self) -> impl Iterator<Item = &TopicPort> {
        self.routes.iter().map(|route| &route.port)
    }

    /// The nodes, in order of composition.
    pub fn nodes(&self) -> impl Iterator<Item = &dyn Node> {
        self.nodes.iter().map(AsRef::as_ref)
    }

    /// Shows every further publication to `observer`.
    pub fn observe(&mut self, observer: Observer) {
        self.observers.push(observer);
    }

    /// Shows every further condition, and every fault as one, to `observer`.
    pub fn observe_conditions(&mut self, observer: ConditionObserver) {
        self.condition_observers.push(observer);
    }

    /// Goes to the next instant at which a timer is due and handles everything that follows from it.
    /// Returns that instant; `None` when no node has a timer.
    pub fn advance(&mut self) -> Option<Stamp<Host>> {
        let &Reverse((due, ..)) = self.timers.peek()?;
        self.now = due;
        while let Some(&Reverse((at, ..))) = self.timers.peek() {
            if at != due {
                break;
            }
            self.tick_next();
            self.drain();
        }
        Some(due)
    }

    /// Advances until `until`, which becomes the current time.
    pub fn run_until(&mut self, until: Stamp<Host>) {
        while let Some(&Reverse((due, ..))) = self.timers.peek() {
            if due > until {
                break;
            }
            self.advance();
        }
        self.now = until;
    }

    /// Publishes a message on behalf of nobody: replay, tests, the scenario itself.
    ///
    /// Returns false when no node publishes or hears that topic.
    pub fn inject(&mut self, topic: &str, bytes: &[u8]) -> bool {
        let Some(route) = self
            .routes
            .iter()
            .position(|route| route.port.topic == topic)
        else {
            return false;
        };
        self.publish(route, Arc::from(bytes));
        self.drain();
        true
    }

    /// Puts a fresh node in the place of the one of the same name, as a restart does; latched messages reach it at once.
    ///
    /// # Errors
    /// When no node of that name is there or its ports differ.
    pub fn restart(&mut self, node: Box<dyn Node>) -> Result<(), ComposeError> {
        let place = self.place_of(node.as_ref())?;
        self.asked
            .retain(|(_, server, _), (client, _)| server.0 != place && client.0 != place);
        self.nodes[place] = node;
        for route in &self.routes {
            for &(listener, subscription) in &route.listeners {
                if let (true, Some(bytes)) = (listener == place, &route.latched) {
                    let bytes = bytes.clone();
                    self.inbox.push_back(Delivery::Message {
                        node: place,
                        subscription,
                        bytes,
                    });
                }
            }
        }
        self.drain();
        Ok(())
    }

    /// Asks every node to stop and advances until all have, or until `patience` has passed; true if all have.
    pub fn shutdown(&mut self, patience: Span) -> bool {
        self.ask_to_stop();
        self.drain();
        let deadline = self.now + patience;
        while !self.stopped.iter().all(|stopped| *stopped) {
            if self.now >= deadline || self.advance().is_none() {
                return false;
            }
        }
        true
    }

    /// Shows a condition to its observers, and to everybody on `/diagnostics` when it is told.
    fn report(&mut self, node: usize, diagnostic: &Diagnostic) {
        let name = self.nodes[node].name();
        for observer in &mut self.condition_observers {
            observer(self.now, name, diagnostic);
        }
        let message = DiagnosticArray {
            header: Header {
                stamp: ros_time(self.now),
                frame_id: String::new(),
            },
            status: vec![diagnostic.status(&format!("/{name}"))],
        };
        self.publish(self.diagnostics, Arc::from(to_cdr(&message)));
    }

    fn hand(&mut self, node: usize, event: Event<'_>) {
        let mut emissions = std::mem::take(&mut self.emissions);
        let result = self.nodes[node].handle(self.now, event, &mut emissions);
        for emission in emissions.drain(..) {
            self.take(node, emission);
        }
        self.emissions = emissions;
        if let Err(fault) = result {
            let diagnostic = Diagnostic::new(Level::Error, "input_refused", fault.to_string())
                .with("port", &fault.port);
            self.report(node, &diagnostic);
        }
    }
}

#[cfg(test)]
mod tests;
