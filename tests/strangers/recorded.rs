//! What good publishers said to a node, over and over, each time later.

use abbe_tests::program::root;
use node_runtime::Node;
use recorder::{Bag, Event, Order};

use crate::form::{Form, Reader, Value, Writer};

/// A message of a recording.
pub struct Recorded {
    /// Place of the subscription.
    pub port: usize,
    /// When it was written, ns.
    pub at_nanos: i64,
    pub value: Value,
}

/// A recording of what a node hears.
pub struct Recording {
    pub messages: Vec<Recorded>,
    /// Of each subscription.
    pub forms: Vec<Form>,
}

/// Between the last message and the first of the next round, ns.
const PAUSE_NANOS: i64 = 10_000_000_000;

impl Recording {
    pub fn of(node: &dyn Node, bag: &str) -> Self {
        let subscriptions = &node.ports().subscriptions;
        let forms: Vec<Form> = subscriptions
            .iter()
            .map(|port| Form::of(port.type_name))
            .collect();
        let bag = Bag::open(root().join("bags").join(bag)).unwrap();
        let place_of = |topic: &str| {
            let relative = topic.trim_start_matches('/');
            let mut ports = subscriptions.iter();
            ports.position(|port| port.topic.trim_start_matches('/') == relative)
        };
        let mut messages = Vec::new();
        let mut events = bag.messages(Order::LogTime);
        while let Some(event) = events.next_event() {
            let Event::Message(message) = event else {
                continue;
            };
            let Some(port) = place_of(&bag.topic(message.topic).topic) else {
                continue;
            };
            if let Some(value) = Reader::message(&forms[port], message.data) {
                messages.push(Recorded {
                    port,
                    at_nanos: i64::try_from(message.log_time_nanos).unwrap(),
                    value,
                });
            }
        }
        Self { messages, forms }
    }

    /// How long one round is, ns.
    pub fn round_nanos(&self) -> i64 {
        let ends = self.messages.first().zip(self.messages.last());
        ends.map_or(0, |(first, last)| last.at_nanos - first.at_nanos) + PAUSE_NANOS
    }

    /// A message as it would be said `by_nanos` later.
    pub fn later(&self, place: usize, by_nanos: i64) -> (usize, Value) {
        let recorded = &self.messages[place];
        let mut value = recorded.value.clone();
        value.shift(by_nanos);
        (recorded.port, value)
    }

    pub fn bytes(&self, port: usize, value: &Value) -> Vec<u8> {
        Writer::message(&self.forms[port], value)
    }
}
