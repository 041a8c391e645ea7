//! What the recorder's host has of a run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Wire, from_cdr};
use metrology::Stamp;
use metrology::stamp::{Host, Span};
use recorder::{Bag, Event, Order};

/// How long a writer and a reader that have only just heard of each other may need to meet. A reader takes what a writer
/// sends to others before the writer knows of it, and such a sample is not sent again when it is lost (DDS 1.4, 2.2.3.4: a
/// volatile reader is owed nothing from before).
const MEETING: Span = Span::from_nanos(2_000_000_000);

/// How many messages of a topic there are once its writer and the recorder have met, and which numbers are missing from there
/// to the last. What is sent after the meeting has a higher number than all that came until then; of what was sent before
/// some may still come.
pub fn missing(bag: &Path, topic: &str) -> (usize, Vec<u32>) {
    let all = raw(bag, topic);
    let Some(met) = all.first().map(|first| first.at + MEETING) else {
        return (0, vec![]);
    };
    let until_then = all.iter().filter(|said| said.at < met);
    let first = until_then.map(|said| said.sequence).max().unwrap_or(0) + 1;
    let there: BTreeSet<u32> = all.iter().map(|said| said.sequence).collect();
    let last = there.last().copied().unwrap_or(0);
    let count = there.range(first..).count();
    let missing: Vec<u32> = (first..=last).filter(|n| !there.contains(n)).collect();
    if let (Some(gap), Some(begun)) = (missing.first(), all.first().map(|said| said.at)) {
        for said in all.iter().filter(|said| said.sequence.abs_diff(*gap) < 20) {
            eprintln!(
                "{topic} {}: {} s",
                said.sequence,
                (said.at - begun).as_secs_f64()
            );
        }
    }
    (count, missing)
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

/// The bytes of a topic's messages, as they came.
pub fn bytes(bag: &Path, topic: &str) -> Vec<Vec<u8>> {
    let said = raw(bag, topic).into_iter();
    said.map(|said| said.bytes).collect()
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

/// What every node counted since it had met the others, by node and counter.
pub fn counters(bag: &Path) -> BTreeMap<(String, String), u64> {
    let mut counts = BTreeMap::<(String, String), (Stamp<Host>, u64, u64)>::new();
    for said in raw(bag, topics::DIAGNOSTICS.name) {
        let array: DiagnosticArray = from_cdr(&said.bytes).unwrap();
        for status in array.status.into_iter().filter(|s| !s.name.contains(": ")) {
            for value in status.values {
                if let Ok(count) = value.value.parse() {
                    let key = (status.name.clone(), value.key);
                    let (begun, met, last) = counts.entry(key).or_insert((said.at, count, count));
                    if said.at < *begun + MEETING {
                        *met = count;
                    }
                    *last = count;
                }
            }
        }
    }
    let since = |(key, (_, met, last)): (_, (_, u64, u64))| (key, last - met);
    counts.into_iter().map(since).collect()
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
