//! Runs a bag's inputs through its nodes and holds what comes out against what was recorded.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;

use metrology::stamp::{Host, Stamp};
use node_runtime::harness::Published;
use node_runtime::{Bytes, Harness, Node};
use recorder::{Bag, Event, Loss, MessageOrder, Order, RecordedCall, RecordedRun};
use serde::Serialize;

use crate::difference::{Difference, Discrepancy};
use crate::error::ReplayError;
use crate::inputs;

/// Messages of one topic that were held against computed ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Compared {
    /// Messages in the bag.
    pub messages: u64,
    /// Messages that differ, are missing, or are too many.
    pub differing: u64,
}

/// What a replay came to.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// By topic.
    pub compared: BTreeMap<String, Compared>,
    /// The first difference, `None`: the bag was computed again byte for byte.
    pub first: Option<Difference>,
    /// Messages and service calls that were put in.
    pub inputs: u64,
    /// What of the bag could not be read.
    pub losses: Vec<Loss>,
}

/// What is done with a topic of the bag.
#[derive(Clone, Copy)]
enum Role {
    Input {
        route: usize,
    },
    Result {
        route: usize,
    },
    /// Nobody here hears it, or it is about the programs themselves.
    Aside,
}

struct Said {
    route: usize,
    at: Stamp<Host>,
    bytes: Bytes,
}

type SaidQueue = Rc<RefCell<VecDeque<Said>>>;

struct Replay<'b> {
    bag: &'b Bag,
    harness: Harness,
    said: SaidQueue,
    roles: Vec<Role>,
    stop: Option<Stamp<Host>>,
    outcome: Outcome,
}

/// Replays a bag on `nodes`, which are all nodes of the run but its sources, with their recorded parameters, in their
/// recorded order. Nodes that publish nothing that is computed are left out.
///
/// # Errors
/// When the bag is none of a composed run, or has messages of another version.
pub fn check(
    bag: &Bag,
    run: &RecordedRun,
    nodes: Vec<Box<dyn Node>>,
) -> Result<Outcome, ReplayError> {
    if run.order != MessageOrder::Total {
        return Err(ReplayError::Arrival);
    }
    if i64::try_from(run.start_time_nanos).is_err() {
        return Err(ReplayError::Start {
            nanos: run.start_time_nanos,
        });
    }
    let nodes: Vec<_> = nodes
        .into_iter()
        .filter(|node| inputs::computes(node.as_ref()))
        .collect();
    let computed: Vec<String> = nodes
        .iter()
        .flat_map(|node| &node.ports().publications)
        .map(|port| port.topic.clone())
        .collect();
    let mut harness = Harness::compose(nodes, stamp(run.start_time_nanos))?;
    let roles = roles(bag, &harness, &computed)?;
    let said = listen(&mut harness, &roles);
    let mut replay = Replay {
        bag,
        harness,
        said,
        roles,
        stop: run.stop_time_nanos.map(stamp),
        outcome: Outcome::default(),
    };
    replay.run();
    Ok(replay.outcome)
}

fn roles(bag: &Bag, harness: &Harness, computed: &[String]) -> Result<Vec<Role>, ReplayError> {
    let of = |topic: &recorder::TopicInfo| {
        let name = topic.topic.trim_start_matches('/');
        let (Some(entry), Some(route)) = (inputs::entry_of(name), harness.place_of_topic(name))
        else {
            return Ok(Role::Aside);
        };
        let known = entry.description.type_hash;
        if !topic.type_hash.is_empty() && topic.type_hash != known {
            return Err(ReplayError::OtherVersion {
                topic: topic.topic.clone(),
                type_name: topic.type_name.clone(),
                recorded: topic.type_hash.clone(),
                known: known.to_owned(),
            });
        }
        Ok(match entry.origin {
            abbe_msgs::topics::Origin::Housekeeping => Role::Aside,
            _ if computed.iter().any(|own| own == name) => Role::Result { route },
            _ => Role::Input { route },
        })
    };
    bag.topics().iter().map(of).collect()
}

/// Queues what the nodes say on topics that are compared.
fn listen(harness: &mut Harness, roles: &[Role]) -> SaidQueue {
    let mut is_result = vec![false; harness.topics().count()];
    for role in roles {
        if let Role::Result { route } = role {
            is_result[*route] = true;
        }
    }
    let said = SaidQueue::default();
    let queue = Rc::clone(&said);
    harness.observe(Box::new(move |published: Published<'_>| {
        if is_result[published.topic] {
            queue.borrow_mut().push_back(Said {
                route: published.topic,
                at: published.at,
                bytes: published.bytes.clone(),
            });
        }
    }));
    said
}

fn stamp(nanos: u64) -> Stamp<Host> {
    Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}

impl Replay<'_> {
    fn run(&mut self) {
        let mut messages = self.bag.messages(Order::File);
        let mut last = None;
        let mut calls = RecordedCall::all_of(self.bag).into_iter().peekable();
        let mut read = 0;
        while let Some(event) = messages.next_event() {
            let message = match event {
                Event::Message(message) => message,
                Event::Loss(loss) => {
                    self.outcome.losses.push(loss);
                    continue;
                }
            };
            while let Some(call) = calls.next_if(|call| call.after_messages <= read) {
                self.arrive(stamp(call.time_nanos), &mut last);
                let is_request = self.harness.put_request(&call.topic, &call.event);
                self.outcome.inputs += u64::from(is_request);
            }
            read += 1;
            let at = stamp(message.log_time_nanos);
            self.arrive(at, &mut last);
            let topic = message.topic.index();
            match self.roles[topic] {
                Role::Input { route } => {
                    self.outcome.inputs += 1;
                    self.harness.put(route, message.data);
                }
                Role::Result { route } => self.compare(topic, route, at, message.data),
                Role::Aside => {}
            }
        }
        // What a cut file would have gone on with is not known.
        if let (Some(last), true) = (last, self.outcome.losses.is_empty()) {
            self.go_on(|due| due <= last);
            self.nothing_is_left();
        }
    }

    /// Lets everything happen that is due before `at`, when time goes on.
    fn arrive(&mut self, at: Stamp<Host>, last: &mut Option<Stamp<Host>>) {
        if last.is_none_or(|last| at > last) {
            self.go_on(|due| due < at);
            self.nothing_is_left();
            self.harness.wait_until(at);
            *last = Some(at);
        }
    }

    /// Delivers what waits and hands out the ticks (and the end of the run) that are due.
    fn go_on(&mut self, is_due: impl Fn(Stamp<Host>) -> bool) {
        while self.step(&is_due) {}
    }

    /// The next delivery, tick, or the end of the run; false when nothing is due.
    fn step(&mut self, is_due: &impl Fn(Stamp<Host>) -> bool) -> bool {
        if self.harness.deliver_next() {
            return true;
        }
        let tick = self.harness.next_tick();
        match self.stop {
            Some(stop) if is_due(stop) && tick.is_none_or(|tick| tick > stop) => {
                self.stop = None;
                self.harness.wait_until(stop);
                self.harness.ask_to_stop();
                true
            }
            _ if tick.is_some_and(is_due) => {
                self.harness.tick_next();
                true
            }
            _ => false,
        }
    }

    /// Lets the nodes go on until they say something on the recorded message's topic, and compares.
    fn compare(&mut self, topic: usize, route: usize, at: Stamp<Host>, recorded: &[u8]) {
        let of_route = |said: &VecDeque<Said>| said.iter().position(|said| said.route == route);
        let place = loop {
            let place = of_route(&self.said.borrow());
            if place.is_some() || !self.step(&|due| due <= at) {
                break place;
            }
        };
        let info = &self.bag.topics()[topic];
        let found = place.and_then(|place| Some((place, self.said.borrow_mut().remove(place)?)));
        let discrepancy = match found {
            None => Some(Discrepancy::NotComputed),
            Some((_, said)) if *said.bytes != *recorded => {
                Some(Discrepancy::between(info, recorded, &said.bytes))
            }
            Some((0, _)) => None,
            Some(_) => Some(Discrepancy::Order),
        };
        let name = info.topic.clone();
        self.outcome
            .compared
            .entry(name.clone())
            .or_default()
            .messages += 1;
        if let Some(discrepancy) = discrepancy {
            self.differs(name, at, discrepancy);
        }
    }

    /// What was said and not met in the bag before time went on.
    fn nothing_is_left(&mut self) {
        loop {
            let Some(said) = self.said.borrow_mut().pop_front() else {
                return;
            };
            let ports = self.harness.topics().nth(said.route);
            let name = ports.map_or_else(String::new, |port| format!("/{}", port.topic));
            self.differs(name, said.at, Discrepancy::NotRecorded);
        }
    }

    fn differs(&mut self, topic: String, at: Stamp<Host>, discrepancy: Discrepancy) {
        let compared = self.outcome.compared.entry(topic.clone()).or_default();
        compared.differing += 1;
        let message = compared.messages.saturating_sub(1);
        self.outcome.first.get_or_insert(Difference {
            at_nanos: at.nanos(),
            topic,
            message,
            discrepancy,
        });
    }
}
