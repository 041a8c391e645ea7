//! The graph as a test sees it: every topic, and a voice on some.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use abbe_msgs::diagnostic_msgs::msg::DiagnosticStatus;
use abbe_msgs::topics::{self, Topic, TopicFamily};
use abbe_msgs::{Message, Wire, from_cdr, to_cdr};
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::node::TopicPort;
use node_runtime::tap::{RawPublisher, RawTap, Selection, TapEvent};

/// How long anything may take to be seen on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

#[derive(Default)]
struct Heard {
    /// When, absolute topic, bytes; in the order of arrival.
    samples: Vec<(Instant, String, Arc<[u8]>)>,
}

/// Everything that is said in a domain.
pub struct Graph {
    environment: Environment,
    tap: Option<RawTap>,
    heard: Arc<Mutex<Heard>>,
}

impl Graph {
    /// Joins it as a node that only listens.
    ///
    /// # Panics
    /// When there is no network.
    #[must_use]
    pub fn join(domain: u16) -> Self {
        Self::join_by(crate::zenoh::environment(domain))
    }

    /// Joins the network that `environment` tells of, as [`Self::join`] does that of this computer.
    ///
    /// # Panics
    /// When there is no network.
    #[must_use]
    pub fn join_by(environment: Environment) -> Self {
        let names = NodeNames::new("witness", &[]).unwrap();
        let heard = Arc::<Mutex<Heard>>::default();
        let ear = Arc::clone(&heard);
        let tap = RawTap::start(&environment, &names, Selection::All, move |event| {
            if let TapEvent::Sample(sample) = event {
                let line = (Instant::now(), sample.topic.name.clone(), sample.bytes);
                ear.lock().unwrap().samples.push(line);
            }
        });
        Self {
            environment,
            tap: Some(tap.unwrap()),
            heard,
        }
    }

    /// A node that can speak on `topics`.
    ///
    /// # Panics
    /// When there is no network.
    #[must_use]
    pub fn voice(&self, topics: &[TopicPort]) -> Voice {
        let names = NodeNames::new("voice", &[]).unwrap();
        let patience = Duration::from_millis(100);
        Voice(RawPublisher::start(&self.environment, &names, topics, 4096, patience).unwrap())
    }

    /// Messages of a topic since `since`, with the time of their arrival.
    ///
    /// # Panics
    /// When one cannot be decoded.
    #[must_use]
    pub fn since<M: Message>(&self, topic: &Topic<M>, since: Instant) -> Vec<(Instant, M)> {
        self.named_since(topic.name, since)
    }

    /// The same of one topic of a family.
    ///
    /// # Panics
    /// As [`Self::since`], or when no topic can have such a name.
    #[must_use]
    pub fn member_since<M: Message>(
        &self,
        family: &TopicFamily<M>,
        member: &str,
        since: Instant,
    ) -> Vec<(Instant, M)> {
        self.named_since(&family.of(member).unwrap(), since)
    }

    fn named_since<M: Message>(&self, name: &str, since: Instant) -> Vec<(Instant, M)> {
        let name = format!("/{}", name.trim_start_matches('/'));
        let heard = self.heard.lock().unwrap();
        let of_topic = heard
            .samples
            .iter()
            .rev()
            .take_while(|(at, ..)| *at >= since);
        let mut found: Vec<_> = of_topic
            .filter(|(_, topic, _)| *topic == name)
            .map(|(at, _, bytes)| (*at, from_cdr(bytes).unwrap()))
            .collect();
        found.reverse();
        found
    }

    /// Every message of an absolute topic so far, as it came.
    ///
    /// # Panics
    /// When the listener has panicked.
    #[must_use]
    pub fn bytes_of(&self, topic: &str) -> Vec<Vec<u8>> {
        let heard = self.heard.lock().unwrap();
        let of_topic = heard.samples.iter().filter(|(_, name, _)| name == topic);
        of_topic.map(|(_, _, bytes)| bytes.to_vec()).collect()
    }

    /// The same in inner units.
    ///
    /// # Panics
    /// When one has no inner form.
    #[must_use]
    pub fn inner_since<M: Wire>(&self, topic: &Topic<M>, since: Instant) -> Vec<M::Inner> {
        let messages = self.since(topic, since);
        messages
            .into_iter()
            .map(|(_, message)| message.into_inner().unwrap())
            .collect()
    }

    /// Waits until `look` finds what it looks for.
    ///
    /// # Panics
    /// When it does not within 60 s.
    pub fn wait<T>(&self, what: &str, look: impl FnMut(&Self) -> Option<T>) -> T {
        self.wait_longer(PATIENCE, what, look)
    }

    /// The same with a patience of its own.
    ///
    /// # Panics
    /// When it does not within `patience`.
    pub fn wait_longer<T>(
        &self,
        patience: Duration,
        what: &str,
        mut look: impl FnMut(&Self) -> Option<T>,
    ) -> T {
        let deadline = Instant::now() + patience;
        loop {
            if let Some(found) = look(self) {
                return found;
            }
            assert!(Instant::now() < deadline, "{what}: not within {patience:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits for a message of `topic` since `since` that `pick` takes.
    ///
    /// # Panics
    /// As [`Self::wait`].
    pub fn next<M: Message>(
        &self,
        topic: &Topic<M>,
        since: Instant,
        pick: impl Fn(&M) -> bool,
    ) -> M {
        self.wait(topic.name, |graph| {
            let messages = graph.since(topic, since);
            messages.into_iter().map(|(_, m)| m).find(&pick)
        })
    }

    /// Waits until `node` says anything about itself since `since`.
    ///
    /// # Panics
    /// As [`Self::wait`].
    pub fn alive(&self, node: &str, since: Instant) {
        let name = format!("/{node}");
        self.wait(
            &format!("{node} on {}", topics::DIAGNOSTICS.name),
            |graph| {
                let all = graph.since(&topics::DIAGNOSTICS, since);
                let statuses = all.into_iter().flat_map(|(_, array)| array.status);
                statuses.map(|status| status.name).find(|n| *n == name)
            },
        );
    }

    /// Waits for a condition of `node`, above OK, whose message holds all of `words`.
    ///
    /// # Panics
    /// As [`Self::wait`].
    pub fn condition(
        &self,
        node: &str,
        condition: &str,
        words: &[&str],
        since: Instant,
    ) -> DiagnosticStatus {
        self.condition_within(PATIENCE, node, condition, words, since)
    }

    /// What `node` said of its conditions since `since`, each once.
    fn conditions_of(&self, node: &str, since: Instant) -> BTreeSet<String> {
        let all = self.since(&topics::DIAGNOSTICS, since);
        let statuses = all.into_iter().flat_map(|(_, array)| array.status);
        let own = statuses.filter(|status| status.name.starts_with(&format!("/{node}: ")));
        own.map(|status| format!("{} {}: {}", status.level, status.name, status.message))
            .collect()
    }

    /// A condition of `node`, above OK, that was said since `since` and whose message holds all of `words`.
    #[must_use]
    pub fn hears_condition(
        &self,
        node: &str,
        condition: &str,
        words: &[&str],
        since: Instant,
    ) -> Option<DiagnosticStatus> {
        let name = format!("/{node}: {condition}");
        let all = self.since(&topics::DIAGNOSTICS, since);
        let mut statuses = all.into_iter().flat_map(|(_, array)| array.status);
        statuses.find(|status| {
            status.name.starts_with(&name)
                && status.level > 0
                && words.iter().all(|word| status.message.contains(word))
        })
    }

    /// The same with a patience of its own.
    ///
    /// # Panics
    /// As [`Self::wait_longer`].
    pub fn condition_within(
        &self,
        patience: Duration,
        node: &str,
        condition: &str,
        words: &[&str],
        since: Instant,
    ) -> DiagnosticStatus {
        let deadline = Instant::now() + patience;
        let found = loop {
            if let Some(found) = self.hears_condition(node, condition, words, since) {
                break found;
            }
            assert!(
                Instant::now() < deadline,
                "/{node}: {condition} with {words:?}: not within {patience:?}, but {:?}",
                self.conditions_of(node, since)
            );
            std::thread::sleep(Duration::from_millis(20));
        };
        eprintln!("{}: {}", found.name, found.message);
        found
    }
}

impl Drop for Graph {
    fn drop(&mut self) {
        if let Some(tap) = self.tap.take() {
            let _ = tap.stop();
        }
    }
}

/// Says what it is told, on the topics with which it was made, by their places.
pub struct Voice(RawPublisher);

impl Voice {
    /// Says a message on the topic at `place`.
    ///
    /// # Panics
    /// As [`Self::bytes`].
    pub fn say(&mut self, place: usize, message: &impl Message) {
        self.bytes(place, &to_cdr(message));
    }

    /// Says bytes.
    ///
    /// # Panics
    /// When they find no room within 100 ms.
    pub fn bytes(&mut self, place: usize, bytes: &[u8]) {
        assert!(self.0.publish(place, None, Arc::from(bytes)));
    }

    /// Waits until everybody has what was said.
    ///
    /// # Panics
    /// When somebody has not within 10 s.
    pub fn settle(&self) {
        assert!(self.0.settle(Duration::from_secs(10)));
    }

    /// Leaves.
    ///
    /// # Panics
    /// When its thread panicked.
    pub fn stop(self) {
        self.0.stop().unwrap();
    }
}

/// A topic of ours as a port.
#[must_use]
pub fn port<M: Message>(topic: &Topic<M>) -> TopicPort {
    TopicPort {
        topic: topic.name.to_owned(),
        type_name: M::TYPE_NAME,
        type_hash: M::TYPE_HASH,
        definition: M::DEFINITION,
        qos: topic.qos,
    }
}

/// Now, as the wire has it.
///
/// # Panics
/// When the computer's clock is beyond 2106.
#[must_use]
pub fn now() -> abbe_msgs::builtin_interfaces::msg::Time {
    let at = RawPublisher::now();
    assert!(metrology::epoch::holds(at), "{at:?}");
    abbe_msgs::time(at)
}
