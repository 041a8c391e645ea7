//! Every topic of the network, serialised: what a recorder listens to, and what a replay speaks on.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use abbe_msgs::{Durability, Qos, Reliability};
use anyhow::Context as _;
use metrology::Stamp;
use metrology::stamp::{Host, Span};
use tokio::runtime::Runtime;
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;

use crate::clock;
use crate::environment::Environment;
use crate::log;
use crate::names::{self, NodeNames};
use crate::network::{Participant, Remote, Role};
use crate::node::Bytes;

mod ending;
mod publisher;
mod rivals;

use ending::{End, LONGEST, Reading};
pub use publisher::{PublishReport, RawPublisher, Unsent};
pub use rivals::{Rival, Use};

/// A topic that was found on the network.
#[derive(Clone, Debug, PartialEq)]
pub struct TappedTopic {
    /// Absolute name.
    pub name: String,
    /// Type, e.g. `abbe_msgs/msg/AxisState`.
    pub type_name: String,
    /// RIHS01 hash of its definition; `None`: neither announced nor one of ours.
    pub type_hash: Option<String>,
    /// What its writers offer; the depth is the tap's own.
    pub qos: Qos,
}

/// A sample as the tap saw it.
#[derive(Clone, Debug)]
pub struct Tapped {
    /// Which topic.
    pub topic: Arc<TappedTopic>,
    /// When its writer sent it, by the writer's clock.
    pub source: Option<Stamp<Host>>,
    /// When it was received.
    pub received: Stamp<Host>,
    /// Counts the writer's samples from 1.
    pub sequence: i64,
    /// Samples of this writer that never came between this one and the one before.
    pub lost: u64,
    /// Encapsulation header and CDR.
    pub bytes: Bytes,
}

/// What a tap reports: a topic that was found, a sample, or what is wrong with either.
#[derive(Clone, Debug)]
pub enum TapEvent {
    /// A topic was found, and is listened to from now on.
    Found(Arc<TappedTopic>),
    /// A topic has writers of several types; it is listened to as the first that was found.
    TypesDiffer {
        /// Which.
        topic: Arc<TappedTopic>,
        /// The other type.
        found: String,
    },
    /// A topic has writers whose definitions of its type differ; all are listened to.
    HashesDiffer {
        /// Which.
        topic: Arc<TappedTopic>,
        /// The other hash.
        found: String,
    },
    /// A sample came.
    Sample(Tapped),
    /// A sample is no plain CDR.
    Unreadable {
        /// Which topic.
        topic: Arc<TappedTopic>,
        /// Why.
        reason: String,
    },
    /// Samples that were sent before the end could not be handed over in time.
    Left {
        /// Which topic.
        topic: Arc<TappedTopic>,
        /// How many of them were counted; there may be more.
        samples: u64,
        /// How long before the end the last sample that was handed over had been sent.
        behind: Span,
    },
    /// At the end: a pattern of the selection fits no topic that was on the network.
    Unmatched {
        /// The pattern.
        pattern: String,
    },
}

/// Which topics a tap listens to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selection {
    /// All but the tap's own.
    All,
    /// Those whose absolute names fit one of the patterns; `*` is any run of characters.
    Matching(Vec<String>),
    /// Those of another selection whose names fit none of the patterns.
    Without(Box<Selection>, Vec<String>),
}

impl Selection {
    /// Whether a topic is selected.
    #[must_use]
    pub fn takes(&self, topic: &str) -> bool {
        match self {
            Self::All => true,
            Self::Matching(patterns) => fits_any(patterns, topic),
            Self::Without(selection, patterns) => {
                selection.takes(topic) && !fits_any(patterns, topic)
            }
        }
    }

    /// The same without those whose absolute names fit one of the patterns.
    #[must_use]
    pub fn without(self, patterns: Vec<String>) -> Self {
        Self::Without(Box::new(self), patterns)
    }

    /// Its patterns that fit none of these topics, as one with a typing error.
    pub fn unmatched<'t>(&self, topics: impl IntoIterator<Item = &'t str>) -> Vec<String> {
        let mut patterns = self.patterns();
        for topic in topics {
            patterns.retain(|pattern| !fits(pattern, topic));
        }
        patterns
    }

    /// Whether every name that fits one of `topics` fits one of `exclude` as well.
    #[must_use]
    pub fn leaves_nothing(topics: &[String], exclude: &[String]) -> bool {
        // A `*` of one pattern fits into a `*` of another; each name begins with /, also where a pattern leaves that open.
        topics.iter().all(|topic| match topic.strip_prefix('*') {
            Some(rest) => fits_any(exclude, &format!("/*{rest}")),
            None => fits_any(exclude, topic),
        })
    }

    fn patterns(&self) -> Vec<String> {
        match self {
            Self::All => vec![],
            Self::Matching(patterns) => patterns.clone(),
            Self::Without(selection, patterns) => {
                let mut all = selection.patterns();
                all.extend(patterns.iter().cloned());
                all
            }
        }
    }
}

fn fits_any(patterns: &[String], topic: &str) -> bool {
    patterns.iter().any(|pattern| fits(pattern, topic))
}

fn fits(pattern: &str, text: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == text,
        Some((before, after)) => text.strip_prefix(before).is_some_and(|rest| {
            rest.char_indices()
                .map(|(at, _)| at)
                .chain([rest.len()])
                .any(|at| fits(after, &rest[at..]))
        }),
    }
}

/// Samples that wait in a reader while the callback is slow: 20 s at 1 kHz.
const TAP_DEPTH: u32 = 20_000;
/// Samples between the readers and the callback.
const TAP_QUEUE_LEN: usize = 4_096;
/// Between looks for new topics.
const TOPIC_PERIOD: Duration = Duration::from_millis(100);
/// How long what was sent before the end may take to arrive.
const ACKNOWLEDGEMENT: Duration = Duration::from_secs(1);

fn runtime() -> anyhow::Result<Runtime> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("tap")
        .enable_all()
        .build()
        .context("tokio runtime")
}

/// Listens to the network.
pub struct RawTap {
    runtime: Runtime,
    stop: oneshot::Sender<()>,
    looking: JoinHandle<Participant>,
    handing: JoinHandle<()>,
}

impl RawTap {
    /// Joins the network as the node `names` and hands everything to `take`, which is called from one
    /// thread and in the order of arrival.
    ///
    /// # Errors
    /// When there is no network.
    pub fn start(
        environment: &Environment,
        names: &NodeNames,
        selection: Selection,
        mut take: impl FnMut(TapEvent) + Send + 'static,
    ) -> anyhow::Result<Self> {
        // Without a log nobody hears that the network's library has given up.
        log::start(&[], environment);
        let runtime = runtime()?;
        let (participant, warning) = {
            let _inside = runtime.enter();
            Participant::join(environment, names)?
        };
        if let Some(warning) = warning {
            tracing::warn!("{warning}");
        }
        participant.announce()?;
        let (queue, mut events) = mpsc::channel(TAP_QUEUE_LEN);
        let (stop, stopped) = oneshot::channel();
        let looking = runtime.spawn(look(participant, selection, queue, stopped));
        // Writing a bag blocks, so it has a thread on which that is allowed.
        let handing = runtime.spawn_blocking(move || {
            while let Some(event) = events.blocking_recv() {
                take(event);
            }
        });
        Ok(Self {
            runtime,
            stop,
            looking,
            handing,
        })
    }

    /// Stops listening, hands over what was sent before (what is not there within 3 s is counted), and leaves the network.
    ///
    /// # Errors
    /// When the callback panicked.
    pub fn stop(self) -> anyhow::Result<()> {
        let _ = self.stop.send(());
        self.runtime.block_on(async {
            let participant = self.looking.await.context("tap")?;
            self.handing.await.context("callback of the tap")?;
            let _ = participant.withdraw();
            let _ = tokio::time::timeout(ACKNOWLEDGEMENT, participant.graph_acknowledged()).await;
            Ok(())
        })
    }
}

async fn look(
    participant: Participant,
    selection: Selection,
    queue: mpsc::Sender<TapEvent>,
    mut stopped: oneshot::Receiver<()>,
) -> Participant {
    let mut found: BTreeMap<String, (Arc<TappedTopic>, Vec<String>)> = BTreeMap::new();
    let mut readers = tokio::task::JoinSet::new();
    let (ending, end) = watch::channel(None);
    let mut unmatched = selection.patterns();
    loop {
        let writers = participant.writers();
        unmatched.retain(|pattern| !is_met(pattern, &writers));
        for (name, writers) in offered(&writers, &selection) {
            let Some(first) = writers.first() else {
                continue;
            };
            if !found.contains_key(&name) {
                let qos = common_qos(&writers);
                let Ok(reader) = participant.reader(&name, &first.dds_type, qos) else {
                    continue;
                };
                let topic = Arc::new(tapped(&participant, &name, &writers, qos));
                let _ = participant.announce();
                if queue
                    .send(TapEvent::Found(Arc::clone(&topic)))
                    .await
                    .is_err()
                {
                    return participant;
                }
                let reading = Reading::new(Arc::clone(&topic), queue.clone(), end.clone());
                readers.spawn(reading.run(reader, clock::host_now));
                found.insert(name.clone(), (topic, vec![first.dds_type.clone()]));
            }
            let Some((topic, types)) = found.get_mut(&name) else {
                continue;
            };
            for differs in writers
                .iter()
                .filter_map(|writer| differing(topic, types, writer))
            {
                let _ = queue.send(differs).await;
            }
        }
        tokio::select! {
            _ = &mut stopped => break,
            () = tokio::time::sleep(TOPIC_PERIOD) => {}
        }
    }
    tell_unmatched(unmatched, &queue).await;
    ending.send_replace(Some(End {
        asked: clock::host_now(),
        latest: Instant::now() + LONGEST,
    }));
    // Each ends by itself, as soon as the callback has room for its last sample.
    while readers.join_next().await.is_some() {}
    participant
}

/// Types and definitions of a topic that are reported; further ones are not.
const MOST_DIFFERING: usize = 16;

/// That a writer has another type than its topic, or another definition of it; once for each of `known`.
fn differing(
    topic: &Arc<TappedTopic>,
    known: &mut Vec<String>,
    writer: &Remote,
) -> Option<TapEvent> {
    if known.len() >= MOST_DIFFERING {
        return None;
    }
    let topic = Arc::clone(topic);
    if !known.contains(&writer.dds_type) {
        known.push(writer.dds_type.clone());
        let found = writer.dds_type.clone();
        return Some(TapEvent::TypesDiffer { topic, found });
    }
    let is_type = known.first() == Some(&writer.dds_type);
    let found = writer.type_hash.clone().filter(|_| is_type)?;
    if topic.type_hash.as_ref()? == &found || known.contains(&found) {
        return None;
    }
    known.push(found.clone());
    Some(TapEvent::HashesDiffer { topic, found })
}

async fn tell_unmatched(patterns: Vec<String>, queue: &mpsc::Sender<TapEvent>) {
    for pattern in patterns {
        // Who listened may have gone.
        let _ = queue.send(TapEvent::Unmatched { pattern }).await;
    }
}

/// A topic as its first writer describes it; the hash is what a writer of its type announced, else our own.
fn tapped(participant: &Participant, name: &str, writers: &[&Remote], qos: Qos) -> TappedTopic {
    let dds_type = writers.first().map_or("", |first| first.dds_type.as_str());
    let mut alike = writers.iter().filter(|it| it.dds_type == dds_type);
    let announced = alike.find_map(|writer| writer.type_hash.clone());
    TappedTopic {
        name: name.to_owned(),
        type_name: names::ros_type(dds_type).unwrap_or_else(|| dds_type.to_owned()),
        type_hash: announced.or_else(|| participant.own_hash(dds_type).map(str::to_owned)),
        qos,
    }
}

/// Whether a pattern fits a topic of messages.
fn is_met(pattern: &str, writers: &[Remote]) -> bool {
    let mut topics = writers.iter().filter(|it| it.role == Role::Message);
    topics.any(|writer| fits(pattern, &writer.name))
}

/// Selected topics of messages with their writers.
fn offered<'w>(writers: &'w [Remote], selection: &Selection) -> BTreeMap<String, Vec<&'w Remote>> {
    let mut offered: BTreeMap<String, Vec<&Remote>> = BTreeMap::new();
    for writer in writers {
        if writer.role == Role::Message && selection.takes(&writer.name) {
            offered.entry(writer.name.clone()).or_default().push(writer);
        }
    }
    offered
}

/// The strongest quality of service that every writer offers.
fn common_qos(writers: &[&Remote]) -> Qos {
    let all =
        |offers: fn(&&&Remote) -> bool| writers.iter().filter(offers).count() == writers.len();
    Qos {
        reliability: if all(|writer| writer.reliable) {
            Reliability::Reliable
        } else {
            Reliability::BestEffort
        },
        durability: if all(|writer| writer.latched) {
            Durability::TransientLocal
        } else {
            Durability::Volatile
        },
        depth: TAP_DEPTH,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_select_by_absolute_name() {
        let some = Selection::Matching(vec!["/axes/*".to_owned(), "*state".to_owned()]);
        for (topic, taken) in [
            ("/axes/state", true),
            ("/axes/", true),
            ("/cell/axes/state", true),
            ("/cell/axes/x", false),
            ("/latency", false),
        ] {
            assert_eq!(some.takes(topic), taken, "{topic}");
        }
        assert!(Selection::All.takes("/anything"));
        let less = some.without(vec!["/cell/*".to_owned()]);
        assert!(less.takes("/axes/state") && !less.takes("/cell/axes/state"));
        assert!(!less.takes("/latency"));
    }

    #[test]
    fn patterns_that_fit_no_topic_are_found() {
        let words = |words: &[&str]| -> Vec<String> { words.iter().map(|&w| w.into()).collect() };
        let topics = ["/axes/state", "/compensation", "/tf"];
        for (include, exclude, unmatched) in [
            (&["*"][..], &[][..], &[][..]),
            (&["*"], &["/compensatoin", "/tf"], &["/compensatoin"]),
            (&["/axes/*", "/axis/*"], &["/t*"], &["/axis/*"]),
            (&["/nope"], &["/neither", "*state"], &["/nope", "/neither"]),
        ] {
            let picked = Selection::Matching(words(include)).without(words(exclude));
            assert_eq!(picked.unmatched(topics), words(unmatched), "{exclude:?}");
        }
        assert_eq!(Selection::All.unmatched(topics), words(&[]));
        assert_eq!(Selection::All.without(words(&["*"])).unmatched([]), ["*"]);
    }

    #[test]
    fn a_tap_asks_for_what_every_writer_offers() {
        let writer = |reliable, latched| Remote {
            guid: [0; 16],
            node: String::new(),
            role: Role::Message,
            name: "/x".to_owned(),
            dds_type: "t".to_owned(),
            type_hash: None,
            reliable,
            latched,
        };
        let (strong, weak) = (writer(true, true), writer(false, false));
        assert_eq!(
            common_qos(&[&strong, &strong]),
            Qos {
                depth: TAP_DEPTH,
                ..Qos::LATCHED
            }
        );
        let both = common_qos(&[&strong, &weak]);
        let expected = (Reliability::BestEffort, Durability::Volatile);
        assert_eq!((both.reliability, both.durability), expected);
    }

    #[test]
    fn another_type_and_another_definition_are_each_found_once() {
        let writer = |dds_type: &str, type_hash: Option<&str>| Remote {
            guid: [0; 16],
            node: String::new(),
            role: Role::Message,
            name: "/x".to_owned(),
            dds_type: dds_type.to_owned(),
            type_hash: type_hash.map(str::to_owned),
            reliable: true,
            latched: false,
        };
        let topic = Arc::new(TappedTopic {
            name: "/x".to_owned(),
            type_name: "t".to_owned(),
            type_hash: Some("RIHS01_a".to_owned()),
            qos: Qos::RELIABLE,
        });
        let mut known = vec!["t".to_owned()];
        let mut seen = |dds_type: &str, hash: Option<&str>| match differing(
            &topic,
            &mut known,
            &writer(dds_type, hash),
        ) {
            Some(TapEvent::TypesDiffer { found, .. }) => format!("type {found}"),
            Some(TapEvent::HashesDiffer { found, .. }) => format!("hash {found}"),
            _ => String::new(),
        };
        assert_eq!(seen("t", None), "");
        assert_eq!(seen("t", Some("RIHS01_a")), "");
        assert_eq!(seen("t", Some("RIHS01_b")), "hash RIHS01_b");
        assert_eq!(seen("t", Some("RIHS01_b")), "");
        assert_eq!(seen("u", Some("RIHS01_c")), "type u");
        assert_eq!(seen("u", Some("RIHS01_c")), "");
        // Whoever announces without end is reported so often and no more.
        let more = (0..1000).map(|n| seen("t", Some(&format!("RIHS01_{n}"))));
        assert_eq!(
            more.filter(|said| !said.is_empty()).count(),
            MOST_DIFFERING - 3
        );
    }
}
