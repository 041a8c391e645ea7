//! From the network into a bag: every topic that is found becomes a channel, every sample a message.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use abbe_msgs::{Description, Qos, Release, description_of, topics};
use anyhow::Result;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::{RawTap, Selection, TapEvent, Tapped, TappedTopic};
use recorder::{
    Channel, ChannelId, Recorder, RecorderError, RecorderSink, RecorderStats, RecordingSummary,
    RingSink,
};

use crate::time::{Early, Stamper, Time};

/// What the listener counts and cannot put into the bag.
#[derive(Default)]
pub(crate) struct Troubles {
    lost_on_network: AtomicU64,
    early: AtomicU64,
    topics: Mutex<Vec<String>>,
    unmatched: Mutex<Vec<String>>,
}

impl Troubles {
    /// Samples that were sent and never arrived here.
    pub fn lost_on_network(&self) -> u64 {
        self.lost_on_network.load(Ordering::Relaxed)
    }

    /// Messages that wait for the first `/clock`.
    pub fn early(&self) -> u64 {
        self.early.load(Ordering::Relaxed)
    }

    /// Topics that cannot be recorded, a sentence each, since the last call.
    pub fn unrecorded(&self) -> Vec<String> {
        std::mem::take(&mut *self.topics())
    }

    /// Patterns that fitted no topic until the end, a sentence each.
    pub fn unmatched(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&self.unmatched))
    }

    fn topics(&self) -> MutexGuard<'_, Vec<String>> {
        lock(&self.topics)
    }
}

fn lock(words: &Mutex<Vec<String>>) -> MutexGuard<'_, Vec<String>> {
    words.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The warning about a pattern that picks or leaves out topics and fits none.
#[must_use]
pub fn unmatched(pattern: &str) -> String {
    format!(
        "warning: the pattern {pattern:?} of `topics` or `exclude` matched no topic: compare it with the names of the topics (`ros2 topic list`)"
    )
}

/// A recording of the network that goes on.
pub struct Capture {
    tap: RawTap,
    recorder: Recorder,
    troubles: Arc<Troubles>,
}

/// What a recording of the network came to.
#[derive(Debug)]
pub struct Captured {
    /// What is in the bag, or why it ended before.
    pub bag: Result<RecordingSummary, RecorderError>,
    /// Counts at the end.
    pub stats: RecorderStats,
    /// Samples that never arrived here.
    pub lost_on_network: u64,
    /// Topics that could not be recorded, a sentence each.
    pub unrecorded: Vec<String>,
    /// Patterns that fitted no topic, a sentence each.
    pub unmatched: Vec<String>,
}

/// The topic's own quality of service, where it is one of ours; what was found has the tap's depth.
fn offered(topic: &TappedTopic) -> Qos {
    let known = topics::all().iter().find(|entry| {
        let name = entry.name.trim_start_matches('/');
        let end = topic.name.strip_suffix(name);
        !entry.is_family && end.is_some_and(|before| before.ends_with('/'))
    });
    Qos {
        depth: known.map_or(topic.qos.depth, |entry| entry.qos.depth),
        ..topic.qos
    }
}

/// Our description of a topic's type; `None`: its name is unknown, or its writers announced another definition.
fn description(topic: &TappedTopic) -> Option<&'static Description> {
    let Some(hash) = &topic.type_hash else {
        return description_of(&topic.type_name);
    };
    let mut releases = Release::ALL.into_iter();
    releases.find_map(|release| {
        let known = release.description_of(&topic.type_name)?;
        (known.type_hash == hash).then_some(known)
    })
}

/// The topic as a bag holds it; `None`: hidden and of an unknown type, which no reader could decode.
fn channel(topic: &TappedTopic) -> Option<Channel> {
    let known = description(topic);
    if known.is_none() && topic.name.contains("/_") {
        return None;
    }
    let text = |text: Option<&str>| text.unwrap_or_default().to_owned();
    let own = known.map(|known| known.type_hash);
    Some(Channel {
        topic: topic.name.clone(),
        type_name: topic.type_name.clone(),
        type_hash: text(topic.type_hash.as_deref().or(own)),
        definition: text(known.map(|known| known.definition)),
        qos_yaml: offered(topic).offered_qos_profiles(),
    })
}

/// What can be wrong with the messages of a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Report {
    Unreadable,
    Unfollowed,
    Early,
}

/// Where messages go.
pub(crate) enum Store {
    /// Into a bag.
    Bag(RecorderSink),
    /// Into memory.
    Ring(RingSink),
}

/// Writes down what a tap hears.
pub(crate) struct Scribe {
    store: Store,
    channels: BTreeMap<String, ChannelId>,
    /// What was reported of a topic, each once.
    reported: BTreeSet<(String, Report)>,
    troubles: Arc<Troubles>,
    stamper: Stamper,
    early: Early,
}

impl Drop for Scribe {
    /// What has waited until the end is lost.
    fn drop(&mut self) {
        let early = self.early.samples.len();
        if early > 0 {
            self.lose(early as u64);
            self.troubles.topics().push(format!(
                "/clock: none came that shows an instant, so that {early} messages have no time and are not recorded: start what publishes it, or record without use_sim_time"
            ));
        }
    }
}

impl Scribe {
    pub fn new(store: Store, troubles: Arc<Troubles>, time: Time) -> Self {
        Self {
            store,
            channels: BTreeMap::new(),
            reported: BTreeSet::new(),
            troubles,
            stamper: Stamper::new(time),
            early: Early::default(),
        }
    }

    pub fn take(&mut self, event: &TapEvent) {
        match event {
            TapEvent::Found(topic) => self.found(topic),
            TapEvent::Sample(sample) => self.sample(sample),
            TapEvent::TypesDiffer { topic, found } => {
                let (name, first) = (&topic.name, &topic.type_name);
                let word = format!("{name}: somebody publishes {found}: only {first} is recorded");
                self.troubles.topics().push(word);
            }
            TapEvent::HashesDiffer { topic, found } => {
                let (name, type_name) = (&topic.name, &topic.type_name);
                let first = topic.type_hash.as_deref().unwrap_or_default();
                let word = format!(
                    "{name}: two definitions of {type_name}: {first} and {found}. All messages are recorded as {first}; build all nodes from one definition, or set ROS_DISTRO alike"
                );
                self.troubles.topics().push(word);
            }
            TapEvent::Left {
                topic,
                samples,
                behind,
            } => {
                // At least one is missing where the last that came was sent before the end.
                self.lose((*samples).max(1));
                let (name, behind_s) = (&topic.name, behind.as_secs_f64());
                let word = format!(
                    "{name}: the computer was too busy at the end: what was sent in the last {behind_s:.1} s is not recorded, {samples} messages of it are known"
                );
                self.troubles.topics().push(word);
            }
            TapEvent::Unmatched { pattern } => {
                lock(&self.troubles.unmatched).push(unmatched(pattern));
            }
            TapEvent::Unreadable { topic, reason } => {
                self.lose(1);
                self.report_once(topic, Report::Unreadable, &format!("what cannot be read is not recorded and counts as lost, the first: {reason}"));
            }
        }
    }

    fn found(&mut self, topic: &TappedTopic) {
        let Some(channel) = channel(topic) else {
            return;
        };
        let added = match &self.store {
            Store::Bag(sink) => sink.add_channel(&channel),
            Store::Ring(sink) => sink.add_channel(&channel),
        };
        match added {
            Ok(id) => {
                self.channels.insert(topic.name.clone(), id);
            }
            Err(error) => self.troubles.topics().push(error.to_string()),
        }
    }

    /// Says once of a topic what is wrong with its messages.
    fn report_once(&mut self, topic: &TappedTopic, kind: Report, reason: &str) {
        if self.reported.insert((topic.name.clone(), kind)) {
            let name = &topic.name;
            self.troubles.topics().push(format!("{name}: {reason}"));
        }
    }

    fn sample(&mut self, sample: &Tapped) {
        let Some(channel) = self.channels.get(&sample.topic.name).copied() else {
            return;
        };
        self.lose(sample.lost);
        if let Err(reason) = self.stamper.hear(sample) {
            self.report_once(
                &sample.topic,
                Report::Unfollowed,
                &format!("not followed, the first: {reason}"),
            );
        }
        if self.stamper.stamp(sample).is_none() {
            if self.early.keep(channel, sample) {
                self.troubles.early.fetch_add(1, Ordering::Relaxed);
            } else {
                self.lose(1);
                self.report_once(
                    &sample.topic,
                    Report::Early,
                    "too many messages before the first /clock: what comes until then is lost",
                );
            }
            return;
        }
        self.troubles.early.store(0, Ordering::Relaxed);
        for (channel, sample) in std::mem::take(&mut self.early).samples {
            self.write(channel, &sample);
        }
        self.write(channel, sample);
    }

    fn write(&self, channel: ChannelId, sample: &Tapped) {
        let Some(stamp) = self.stamper.stamp(sample) else {
            return;
        };
        // What finds the queue full is counted there.
        let _ = match &self.store {
            Store::Bag(sink) => sink.push(channel, stamp, &sample.bytes),
            Store::Ring(sink) => sink.push(channel, stamp, &sample.bytes),
        };
    }

    fn lose(&self, samples: u64) {
        self.troubles
            .lost_on_network
            .fetch_add(samples, Ordering::Relaxed);
    }
}

impl Capture {
    /// Records into `recorder` what `selection` picks, stamped by `time`; `look` sees every event first.
    ///
    /// # Errors
    /// When there is no network.
    pub fn start(
        environment: &Environment,
        names: &NodeNames,
        selection: Selection,
        recorder: Recorder,
        time: Time,
        mut look: impl FnMut(&TapEvent) + Send + 'static,
    ) -> Result<Self> {
        let troubles = Arc::<Troubles>::default();
        let mut scribe = Scribe::new(Store::Bag(recorder.sink()), Arc::clone(&troubles), time);
        let tap = RawTap::start(environment, names, selection, move |event| {
            look(&event);
            scribe.take(&event);
        })?;
        Ok(Self {
            tap,
            recorder,
            troubles,
        })
    }

    /// Counts as of now.
    #[must_use]
    pub fn stats(&self) -> RecorderStats {
        self.recorder.stats()
    }

    /// Samples that were sent and never arrived here.
    #[must_use]
    pub fn lost_on_network(&self) -> u64 {
        self.troubles.lost_on_network()
    }

    /// Messages that wait for the first `/clock`, where time is simulated.
    #[must_use]
    pub fn early(&self) -> u64 {
        self.troubles.early()
    }

    /// Topics that cannot be recorded, a sentence each, since the last call.
    #[must_use]
    pub fn unrecorded(&self) -> Vec<String> {
        self.troubles.unrecorded()
    }

    /// Takes what has arrived, leaves the network and closes the bag. Not from within another event loop.
    ///
    /// # Errors
    /// When the listener panicked.
    pub fn finish(self) -> Result<Captured> {
        let stopped = self.tap.stop();
        let sink = self.recorder.sink();
        let bag = self.recorder.finish();
        stopped?;
        Ok(Captured {
            bag,
            stats: sink.stats(),
            lost_on_network: self.troubles.lost_on_network(),
            unrecorded: self.troubles.unrecorded(),
            unmatched: self.troubles.unmatched(),
        })
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::builtin_interfaces::msg::Time as RosTime;
    use abbe_msgs::rosgraph_msgs::msg::Clock;
    use abbe_msgs::to_cdr;
    use metrology::stamp::Stamp;
    use recorder::{Bag, Directory, Event, Order, RecorderConfig, Recording};

    use super::*;

    fn found(name: &str, type_name: &str) -> TappedTopic {
        TappedTopic {
            name: name.to_owned(),
            type_name: type_name.to_owned(),
            type_hash: None,
            qos: Qos {
                depth: 20_000,
                ..Qos::RELIABLE
            },
        }
    }

    #[test]
    fn a_known_topic_has_its_definition_and_its_own_depth() {
        let channel = channel(&found("/m1/probe/point", "abbe_msgs/msg/ProbedPoint")).unwrap();
        assert!(channel.type_hash.starts_with("RIHS01_"));
        assert!(!channel.definition.is_empty());
        let depth = format!("depth: {}", topics::PROBE_POINT.qos.depth);
        assert!(channel.qos_yaml.contains(&depth), "{}", channel.qos_yaml);
    }

    #[test]
    fn a_foreign_topic_is_recorded_without_definition_unless_it_is_hidden() {
        let foreign = channel(&found("/camera", "other_msgs/msg/Picture")).unwrap();
        assert_eq!(foreign.definition, "");
        assert_eq!(
            channel(&found("/a/_action/x", "other_msgs/action/X_F")),
            None
        );
    }

    #[test]
    fn a_topic_has_the_definition_that_its_writers_announced() {
        let event = "lifecycle_msgs/msg/TransitionEvent";
        for release in Release::ALL {
            let own = release.description_of(event).unwrap();
            let topic = TappedTopic {
                type_hash: Some(own.type_hash.to_owned()),
                ..found("/probe/transition_event", event)
            };
            let channel = channel(&topic).unwrap();
            assert_eq!(channel.type_hash, own.type_hash);
            assert_eq!(channel.definition, own.definition);
        }
    }

    #[test]
    fn another_version_of_a_known_type_is_recorded_with_its_hash_and_without_our_definition() {
        let hash = format!("RIHS01_{}", "1".repeat(64));
        let topic = TappedTopic {
            type_hash: Some(hash.clone()),
            ..found("/probe/point", "abbe_msgs/msg/ProbedPoint")
        };
        let channel = channel(&topic).unwrap();
        assert_eq!(
            (channel.type_hash, channel.definition),
            (hash, String::new())
        );
    }

    fn sample(name: &str, type_name: &str, number: i64, bytes: Vec<u8>) -> TapEvent {
        TapEvent::Sample(Tapped {
            topic: Arc::new(found(name, type_name)),
            source: Some(Stamp::from_nanos(1_800_000_000_000_000_000)),
            received: Stamp::from_nanos(1_800_000_000_000_000_000 + number),
            sequence: number,
            lost: 0,
            bytes: bytes.into(),
        })
    }

    fn clock(sec: i32, nanosec: u32, number: i64) -> TapEvent {
        let clock = RosTime { sec, nanosec };
        sample(
            "/clock",
            "rosgraph_msgs/msg/Clock",
            number,
            to_cdr(&Clock { clock }),
        )
    }

    /// Records events by simulated time; log time (s) and topic of each message of the bag, what was lost, and the remarks.
    fn recorded(events: &[TapEvent]) -> (Vec<(u64, String)>, u64, Vec<String>) {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("bag");
        let config = RecorderConfig::default();
        let directory = Directory::create(&path).unwrap();
        let recording = Recording::begin(directory, "bag", config.clone()).unwrap();
        let recorder = Recorder::start(recording, &config).unwrap();
        let troubles = Arc::<Troubles>::default();
        let store = Store::Bag(recorder.sink());
        let mut scribe = Scribe::new(store, Arc::clone(&troubles), Time::simulated(true));
        for (name, type_name) in [
            ("/clock", "rosgraph_msgs/msg/Clock"),
            ("/word", "std_msgs/msg/String"),
        ] {
            scribe.take(&TapEvent::Found(Arc::new(found(name, type_name))));
        }
        events.iter().for_each(|event| scribe.take(event));
        drop(scribe);
        recorder.finish().unwrap();
        let bag = Bag::open(&path).unwrap();
        let mut messages = bag.messages(Order::File);
        let mut found = Vec::new();
        while let Some(Event::Message(message)) = messages.next_event() {
            assert_eq!(message.log_time_nanos, message.publish_time_nanos);
            let topic = bag.topic(message.topic).topic.clone();
            found.push((message.log_time_nanos / 1_000_000_000, topic));
        }
        (found, troubles.lost_on_network(), troubles.unrecorded())
    }

    fn word(number: i64) -> TapEvent {
        let bytes = vec![0, 1, 0, 0, 1, 0, 0, 0, 0];
        sample("/word", "std_msgs/msg/String", number, bytes)
    }

    #[test]
    fn simulated_time_stamps_what_comes_and_what_came_before_it_began() {
        let events = [
            word(1),
            clock(100, 0, 2),
            word(3),
            clock(101, 0, 4),
            word(5),
        ];
        let (messages, lost, remarks) = recorded(&events);
        let topics = ["/word", "/clock", "/word", "/clock", "/word"];
        let wanted = [100, 100, 100, 101, 101].into_iter().zip(topics);
        let wanted: Vec<_> = wanted.map(|(s, topic)| (s, topic.to_owned())).collect();
        assert_eq!((messages, lost, remarks), (wanted, 0, vec![]));
    }

    #[test]
    fn without_a_clock_nothing_has_a_time_and_that_is_told() {
        let (messages, lost, remarks) = recorded(&[word(1), word(2)]);
        assert_eq!((messages.len(), lost), (0, 2));
        assert!(
            remarks[0].contains("2 messages have no time"),
            "{remarks:?}"
        );
    }

    #[test]
    fn a_clock_that_shows_no_instant_is_recorded_and_not_followed() {
        let events = [clock(100, 0, 1), clock(200, 1_000_000_000, 2), word(3)];
        let (messages, lost, remarks) = recorded(&events);
        let times: Vec<u64> = messages.iter().map(|(s, _)| *s).collect();
        assert_eq!((times, lost), (vec![100, 100, 100], 0));
        assert!(remarks[0].contains("clock.nanosec"), "{remarks:?}");
    }
}
