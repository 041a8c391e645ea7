//! Messages that wait for the next update: of most topics only the latest, so that 1 kHz topics cost no decoding.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use abbe_msgs::WireError;
use live_view::Input;
use metrology::Stamp;
use metrology::stamp::Host;
use node_runtime::Bytes;

use crate::decoders::{DECODERS, Family};

/// Most messages between two updates of topics whose every message counts; older ones are dropped and counted.
const MOST_WAITING: usize = 1_000;
/// Most topics.
const MOST_MEMBERS: usize = 512;
/// Longest decoded message, bytes.
const MOST_BYTES: usize = 16 << 20;
/// The same of a topic whose every message counts.
const MOST_BYTES_OF_EACH: usize = 64 << 10;

/// A subscribed topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot(Key);

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    /// Place in [`DECODERS`].
    One(usize),
    Temperature(Arc<str>),
    Machine(Arc<str>),
}

struct Sample {
    key: Key,
    at: Stamp<Host>,
    bytes: Bytes,
}

#[derive(Default)]
struct Waiting {
    latest: BTreeMap<Key, (Stamp<Host>, Bytes)>,
    each: VecDeque<Sample>,
    left_out: u64,
}

/// Takes messages and hands them over decoded. Clones share one feed.
#[derive(Clone, Default)]
pub struct Feed(Arc<Mutex<Waiting>>);

impl Key {
    fn is_each(&self) -> bool {
        matches!(self, Self::One(place) if DECODERS.get(*place).is_some_and(|key| key.is_each))
    }

    fn decode(&self, bytes: &[u8]) -> Result<Vec<Input>, WireError> {
        match self {
            Self::One(place) => DECODERS
                .get(*place)
                .map_or_else(|| Ok(Vec::new()), |key| (key.decode)(bytes)),
            Self::Temperature(member) => Family::Temperature.decode(member, bytes),
            Self::Machine(member) => Family::Machine.decode(member, bytes),
        }
    }

    fn topic(&self) -> String {
        match self {
            Self::One(place) => DECODERS
                .get(*place)
                .map_or_else(String::new, |key| key.topic.to_owned()),
            Self::Temperature(member) => format!("{}{member}", Family::Temperature.base()),
            Self::Machine(member) => format!("{}{member}", Family::Machine.base()),
        }
    }

    /// Inputs of a message, or its refusal.
    fn inputs(&self, bytes: &[u8]) -> Vec<Input> {
        self.decode(bytes).unwrap_or_else(|error| {
            let (topic, reason) = (self.topic(), error.to_string());
            vec![Input::Refused { topic, reason }]
        })
    }
}

impl Feed {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The slot of a topic by its relative name; `None`: it is not shown.
    #[must_use]
    pub fn slot(topic: &str) -> Option<Slot> {
        if let Some(place) = DECODERS.iter().position(|key| key.topic == topic) {
            return Some(Slot(Key::One(place)));
        }
        let (family, member) = Family::of(topic)?;
        Some(Slot(match family {
            Family::Temperature => Key::Temperature(member.into()),
            Family::Machine => Key::Machine(member.into()),
        }))
    }

    /// Takes a message received `at` an instant.
    pub fn take(&self, slot: &Slot, at: Stamp<Host>, bytes: &Bytes) {
        let key = &slot.0;
        let mut waiting = self.waiting();
        let most = if key.is_each() {
            MOST_BYTES_OF_EACH
        } else {
            MOST_BYTES
        };
        let is_new = !waiting.latest.contains_key(key);
        if bytes.len() > most || (is_new && waiting.latest.len() >= MOST_MEMBERS) {
            waiting.left_out += 1;
        } else if !key.is_each() {
            waiting.latest.insert(key.clone(), (at, Arc::clone(bytes)));
        } else {
            if waiting.each.len() >= MOST_WAITING {
                waiting.each.pop_front();
                waiting.left_out += 1;
            }
            let (key, bytes) = (key.clone(), Arc::clone(bytes));
            waiting.each.push_back(Sample { key, at, bytes });
        }
    }

    /// Empties the feed into `out`: each waiting input with its time of receipt and, stamped `now`, how many were left out.
    pub fn hand_over(&self, now: Stamp<Host>, out: &mut Vec<(Stamp<Host>, Input)>) {
        let waited = std::mem::take(&mut *self.waiting());
        for sample in waited.each {
            let inputs = sample.key.inputs(&sample.bytes).into_iter();
            out.extend(inputs.map(|input| (sample.at, input)));
        }
        for (key, (at, bytes)) in waited.latest {
            out.extend(key.inputs(&bytes).into_iter().map(|input| (at, input)));
        }
        if waited.left_out > 0 {
            out.push((now, Input::LeftOut(waited.left_out)));
        }
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
    use abbe_msgs::sensor_msgs::msg::Temperature;
    use abbe_msgs::{Message, Wire, to_cdr, topics};
    use metrology::sample::TemperatureSample;

    use super::*;

    fn at(nanos: i64) -> Stamp<Host> {
        Stamp::from_nanos(nanos)
    }

    fn received(feed: &Feed) -> Vec<(Stamp<Host>, Input)> {
        let mut out = Vec::new();
        feed.hand_over(at(9), &mut out);
        out
    }

    fn bytes<M: Message>(message: &M) -> Bytes {
        Arc::from(to_cdr(message))
    }

    fn reading(degc: f64) -> TemperatureSample {
        TemperatureSample {
            at: at(5),
            sensor: "mill_3/bed".to_owned(),
            temperature_degc: degc,
            variance_k2: 0.0,
        }
    }

    #[test]
    fn of_a_sensor_the_latest_is_handed_over_once_under_the_name_of_its_topic() {
        let feed = Feed::default();
        let slot = Feed::slot(&topics::TEMPERATURE.of("bed").unwrap()).unwrap();
        for degc in [20.0, 21.0, 22.5] {
            let message = Temperature::from_inner(&reading(degc));
            feed.take(&slot, at(1), &bytes(&message));
        }
        let expected = TemperatureSample {
            sensor: "bed".to_owned(),
            ..reading(22.5)
        };
        assert_eq!(received(&feed), [(at(1), Input::Temperature(expected))]);
        assert_eq!(received(&feed), []);
    }

    #[test]
    fn every_condition_is_handed_over_and_those_beyond_the_most_are_counted() {
        let feed = Feed::default();
        let slot = Feed::slot(topics::DIAGNOSTICS.name).unwrap();
        let status = |name: &str| DiagnosticStatus {
            name: name.to_owned(),
            level: 1,
            ..DiagnosticStatus::default()
        };
        let message = DiagnosticArray {
            status: vec![status("/probe"), status("/probe: old")],
            ..DiagnosticArray::default()
        };
        for _ in 0..MOST_WAITING + 2 {
            feed.take(&slot, at(1), &bytes(&message));
        }
        let all = received(&feed);
        assert_eq!(all.len(), 2 * MOST_WAITING + 1);
        assert_eq!(all[0].1, Input::Node("/probe".to_owned()));
        assert!(matches!(&all[1].1, Input::Condition(one) if one.name == "/probe: old"));
        assert_eq!(all.last().unwrap(), &(at(9), Input::LeftOut(2)));
    }

    #[test]
    fn a_damaged_message_is_reported_and_a_topic_that_is_not_shown_has_no_slot() {
        let feed = Feed::default();
        let slot = Feed::slot(topics::AXES_STATE.name).unwrap();
        feed.take(&slot, at(1), &Bytes::from([0, 1, 0, 0, 7]));
        let all = received(&feed);
        let refused = |input: &Input| matches!(input, Input::Refused { topic, .. } if topic == topics::AXES_STATE.name);
        assert!(all.len() == 1 && refused(&all[0].1), "{all:?}");
        for other in [topics::TF.name, topics::TEMPERATURE.base, "x/y"] {
            assert_eq!(Feed::slot(other), None, "{other}");
        }
    }
}
