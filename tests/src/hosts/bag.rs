//! What the recorder's host has of a run.

use std::path::Path;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Wire, from_cdr};
use metrology::Stamp;
use metrology::stamp::Host;
use recorder::{Bag, Event, Order};

/// How many messages of a topic there are, and how many numbers of its one writer are missing between the first and the last.
pub fn missing(bag: &Path, topic: &str) -> (u64, u64) {
    let numbers = numbers(bag, topic);
    let (Some(first), Some(last)) = (numbers.iter().min(), numbers.iter().max()) else {
        return (0, 0);
    };
    let all: std::collections::BTreeSet<u32> = numbers.iter().copied().collect();
    let there = u64::try_from(all.len()).unwrap();
    (there, u64::from(last - first) + 1 - there)
}

/// The numbers of a topic's messages, as they came.
pub fn numbers(bag: &Path, topic: &str) -> Vec<u32> {
    let said = raw(bag, topic).into_iter();
    said.map(|said| said.sequence).collect()
}

/// A message as it was recorded.
struct Said {
    at: Stamp<Host>,
    sequence: u32,
    bytes: Vec<u8>,
}

/// Every message of a topic with the time of its arrival.
pub fn messages<M: Wire>(bag: &Path, topic: &Topic<M>) -> Vec<(Stamp<Host>, M::Inner)> {
    let read = |bytes: &[u8]| from_cdr::<M>(bytes).unwrap().into_inner().unwrap();
    raw(bag, topic.name)
        .into_iter()
        .map(|said| (said.at, read(&said.bytes)))
        .collect()
}

fn raw(bag: &Path, topic: &str) -> Vec<Said> {
    let bag = Bag::open(bag).unwrap();
    let wanted = topic.trim_start_matches('/');
    let mut events = bag.messages(Order::File);
    let mut found = Vec::new();
    while let Some(event) = events.next_event() {
        match event {
            Event::Message(message) => {
                let name = &bag.topics()[message.topic.index()].topic;
                if name.trim_start_matches('/') == wanted {
                    let at = i64::try_from(message.log_time_nanos).unwrap();
                    found.push(Said {
                        at: Stamp::from_nanos(at),
                        sequence: message.sequence,
                        bytes: message.data.to_vec(),
                    });
                }
            }
            Event::Loss(loss) => panic!("{loss}"),
        }
    }
    found
}

/// What every node counted last, by node and counter.
pub fn counters(bag: &Path) -> std::collections::BTreeMap<(String, String), u64> {
    let mut last = std::collections::BTreeMap::new();
    for said in raw(bag, topics::DIAGNOSTICS.name) {
        let array: DiagnosticArray = from_cdr(&said.bytes).unwrap();
        for status in array.status.into_iter().filter(|s| !s.name.contains(": ")) {
            for value in status.values {
                if let Ok(count) = value.value.parse() {
                    last.insert((status.name.clone(), value.key), count);
                }
            }
        }
    }
    last
}

/// The value below which a share of the values lies.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place in the list"
    )]
    let place = (share * (sorted.len() - 1) as f64).round() as usize;
    sorted[place]
}
