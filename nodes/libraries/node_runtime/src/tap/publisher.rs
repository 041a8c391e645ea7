//! Speaks on topics from any thread.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use abbe_msgs::{Durability, Qos, Reliability};
use anyhow::Context as _;
use metrology::Stamp;
use metrology::stamp::Host;
use tokio::runtime::Runtime;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio::time::Instant;

use super::rivals::{self, Rival};
use super::{ACKNOWLEDGEMENT, TappedTopic, runtime};
use crate::clock;
use crate::environment::Environment;
use crate::names::{self, NodeNames};
use crate::network::{Guid, Participant, PublishError, Remote, Role, Writer};
use crate::node::{Bytes, TopicPort};

/// Between tries to find room for a sample.
const RETRY: Duration = Duration::from_micros(200);

/// Between looks at who is on the network.
const LOOK_PERIOD: Duration = Duration::from_millis(50);
/// What a node that was met is given to name itself.
const NAMING: Duration = Duration::from_millis(300);

/// Tries until there is room for a sample, for `patience` at most: on a busy computer the library's own thread may not have
/// sent yet what came before.
async fn once_there_is_room(
    publish: impl Fn() -> Result<(), PublishError>,
    patience: Duration,
) -> Result<(), PublishError> {
    let deadline = Instant::now() + patience;
    loop {
        match publish() {
            Err(PublishError::Full) if Instant::now() < deadline => {
                tokio::time::sleep(RETRY).await;
            }
            done => return done,
        }
    }
}

/// How long a sample of the topic at `place` waits: not at all where the one before it waited in vain.
fn patience_for(full: &BTreeSet<usize>, place: usize, patience: Duration) -> Duration {
    if full.contains(&place) {
        Duration::ZERO
    } else {
        patience
    }
}

/// Notes whether the topic at `place` has room after a sample of it.
fn note_room(full: &mut BTreeSet<usize>, place: usize, sent: &Result<(), PublishError>) {
    match sent {
        Err(PublishError::Full) => {
            full.insert(place);
        }
        _ => {
            full.remove(&place);
        }
    }
}

/// A sample on its way out.
struct Sample {
    place: usize,
    source: Option<Stamp<Host>>,
    bytes: Bytes,
}

/// What the publishing thread is given.
enum Outgoing {
    Sample(Sample),
    /// Answer when everything before has been acknowledged, or at the latest in so long.
    Settle(Duration, oneshot::Sender<bool>),
}

/// Speaks on topics from any thread: the mirror of a run in one process, and a replay.
///
/// A slow network never holds the caller: what finds no room in the queue within the stated time is
/// dropped and counted.
pub struct RawPublisher {
    runtime: Runtime,
    participant: Participant,
    /// Our ends of the topics.
    own: Vec<Remote>,
    queue: mpsc::Sender<Outgoing>,
    publishing: JoinHandle<(Vec<Writer>, Unsents)>,
    patience: Duration,
    dropped: Unsents,
}

/// Why a sample found no room in the queue.
const NO_ROOM: &str = "no room in the queue in time";

/// Samples that were not sent, by topic and reason.
type Unsents = BTreeMap<(usize, &'static str), u64>;

/// Samples of one topic that were not sent for one reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unsent {
    /// Place of the topic among those that were given.
    pub place: usize,
    /// Why.
    pub reason: &'static str,
    /// How many.
    pub samples: u64,
}

/// What became of the samples given to a [`RawPublisher`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PublishReport {
    /// Found no room in the queue in time.
    pub dropped: u64,
    /// Were refused by the network: too many unacknowledged, or no little-endian CDR.
    pub refused: u64,
    /// Both by topic and reason.
    pub unsent: Vec<Unsent>,
}

/// The rivals of a publisher; the names of nodes come a little later than their endpoints, and are waited for.
fn named_rivals(participant: &Participant, own: &[Remote]) -> Vec<Rival> {
    let until = Instant::now() + NAMING;
    loop {
        // Reads the news of the graph, which name the nodes.
        let _ = participant.namesake();
        let rivals = rivals::find(own, &participant.writers(), &participant.readers());
        let has_names = rivals.iter().all(|rival| !rival.node.is_empty());
        if has_names || Instant::now() >= until {
            return rivals;
        }
        std::thread::park_timeout(LOOK_PERIOD);
    }
}

impl RawPublisher {
    /// Joins the network as the node `names` with one writer for each of `topics`; `patience` is the
    /// longest that [`Self::publish`] waits.
    ///
    /// # Errors
    /// When there is no network, or a topic's name breaks the rules of ROS.
    pub fn start(
        environment: &Environment,
        names: &NodeNames,
        topics: &[TopicPort],
        queue_len: usize,
        patience: Duration,
    ) -> anyhow::Result<Self> {
        let topics: Vec<TappedTopic> = topics
            .iter()
            .map(|port| TappedTopic {
                name: port.topic.clone(),
                type_name: port.type_name.to_owned(),
                type_hash: Some(port.type_hash.to_owned()),
                qos: port.qos,
            })
            .collect();
        Self::of_found(environment, names, &topics, queue_len, patience)
    }

    /// The same for topics that were found somewhere, e.g. in a bag.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn of_found(
        environment: &Environment,
        names: &NodeNames,
        topics: &[TappedTopic],
        queue_len: usize,
        patience: Duration,
    ) -> anyhow::Result<Self> {
        let planned = planned(names, topics)?;
        let (runtime, participant) = join(environment, names)?;
        Self::speak(runtime, participant, planned, (queue_len, patience))
    }

    /// The same where nobody is met within `meeting` who publishes on the topics or moves axes by them, else who; nothing
    /// is offered before that.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn where_alone(
        environment: &Environment,
        names: &NodeNames,
        topics: &[TappedTopic],
        (queue_len, patience): (usize, Duration),
        meeting: Duration,
    ) -> anyhow::Result<Result<Self, Vec<Rival>>> {
        let planned = planned(names, topics)?;
        let (runtime, participant) = join(environment, names)?;
        let own: Vec<Remote> = planned.iter().map(|(end, _)| end.clone()).collect();
        let until = Instant::now() + meeting;
        loop {
            let rivals = named_rivals(&participant, &own);
            if !rivals.is_empty() {
                let _inside = runtime.enter();
                let _ = participant.withdraw();
                drop(participant);
                return Ok(Err(rivals));
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            std::thread::park_timeout(left.min(LOOK_PERIOD));
        }
        Self::speak(runtime, participant, planned, (queue_len, patience)).map(Ok)
    }

    fn speak(
        runtime: Runtime,
        participant: Participant,
        planned: Vec<(Remote, Qos)>,
        (queue_len, patience): (usize, Duration),
    ) -> anyhow::Result<Self> {
        let mut writers = Vec::with_capacity(planned.len());
        let mut own = Vec::with_capacity(planned.len());
        for (mut end, qos) in planned {
            let definition = (end.dds_type.as_str(), end.type_hash.as_deref());
            let writer = participant.writer_of(&end.name, definition, qos)?;
            end.guid = writer.guid();
            own.push(end);
            writers.push(writer);
        }
        participant.announce()?;
        let (queue, outgoing) = mpsc::channel::<Outgoing>(queue_len.max(1));
        let publishing = runtime.spawn(send(outgoing, writers, patience));
        Ok(Self {
            runtime,
            participant,
            own,
            queue,
            publishing,
            patience,
            dropped: Unsents::new(),
        })
    }

    /// Publishes on the topic at `place`; `source` is the sample's own time, else the present. False
    /// when it was dropped.
    pub fn publish(&mut self, place: usize, source: Option<Stamp<Host>>, bytes: Bytes) -> bool {
        let outgoing = Outgoing::Sample(Sample {
            place,
            source,
            bytes,
        });
        let taken = match self.queue.try_send(outgoing) {
            Ok(()) => true,
            Err(mpsc::error::TrySendError::Closed(_)) => false,
            Err(mpsc::error::TrySendError::Full(outgoing)) => {
                !self.patience.is_zero() && self.wait(outgoing)
            }
        };
        if !taken {
            *self.dropped.entry((place, NO_ROOM)).or_default() += 1;
        }
        taken
    }

    /// Waits until every reliable reader has acknowledged what was published so far; false when that took longer
    /// than `patience`. Not from within an event loop.
    #[must_use]
    pub fn settle(&self, patience: Duration) -> bool {
        let (answer, settled) = oneshot::channel();
        let asked = self.queue.blocking_send(Outgoing::Settle(patience, answer));
        asked.is_ok() && settled.blocking_recv().unwrap_or(false)
    }

    /// Others who publish on these topics, and controllers whose axes move by them, as far as they have been met.
    #[must_use]
    pub fn rivals(&self) -> Vec<Rival> {
        named_rivals(&self.participant, &self.own)
    }

    /// How many samples find room in the queue now.
    #[must_use]
    pub fn room(&self) -> usize {
        self.queue.capacity()
    }

    /// Waits in the caller's thread, which may be one of another tokio runtime.
    fn wait(&self, mut outgoing: Outgoing) -> bool {
        let deadline = Instant::now() + self.patience;
        while Instant::now() < deadline {
            std::thread::park_timeout(RETRY);
            match self.queue.try_send(outgoing) {
                Ok(()) => return true,
                Err(mpsc::error::TrySendError::Full(back)) => outgoing = back,
                Err(mpsc::error::TrySendError::Closed(_)) => return false,
            }
        }
        false
    }

    /// The time now, as samples are stamped.
    #[must_use]
    pub fn now() -> Stamp<Host> {
        clock::host_now()
    }

    /// Sends what is left, waits until it has arrived, and leaves the network.
    ///
    /// # Errors
    /// When the publishing thread panicked.
    pub fn stop(self) -> anyhow::Result<PublishReport> {
        drop(self.queue);
        let participant = self.participant;
        self.runtime.block_on(async move {
            let (writers, refused) = self.publishing.await.context("publisher")?;
            let all = futures::future::join_all(writers.iter().map(Writer::acknowledged));
            let _ = tokio::time::timeout(ACKNOWLEDGEMENT, all).await;
            let _ = participant.withdraw();
            let _ = tokio::time::timeout(ACKNOWLEDGEMENT, participant.graph_acknowledged()).await;
            Ok(PublishReport {
                dropped: self.dropped.values().sum(),
                refused: refused.values().sum(),
                unsent: (self.dropped.into_iter().chain(refused))
                    .map(|((place, reason), samples)| Unsent {
                        place,
                        reason,
                        samples,
                    })
                    .collect(),
            })
        })
    }
}

/// Joins the network for a thread that speaks from now on.
fn join(environment: &Environment, names: &NodeNames) -> anyhow::Result<(Runtime, Participant)> {
    let runtime = runtime()?;
    let (mut participant, warning) = {
        let _inside = runtime.enter();
        Participant::join(environment, names)?
    };
    participant.wait_for_room();
    if let Some(warning) = warning {
        tracing::warn!("{warning}");
    }
    Ok((runtime, participant))
}

/// Ends of topics that are not made yet.
fn planned(names: &NodeNames, topics: &[TappedTopic]) -> anyhow::Result<Vec<(Remote, Qos)>> {
    let end = |topic: &TappedTopic| -> anyhow::Result<(Remote, Qos)> {
        let end = Remote {
            guid: Guid::default(),
            node: names.fully_qualified(),
            role: Role::Message,
            name: names.resolve(&topic.name)?,
            dds_type: names::dds_type(&topic.type_name),
            type_hash: topic.type_hash.clone(),
            reliable: topic.qos.reliability == Reliability::Reliable,
            latched: topic.qos.durability == Durability::TransientLocal,
        };
        Ok((end, topic.qos))
    };
    topics.iter().map(end).collect()
}

/// Sends what comes out of the queue until it is closed; with the writers what was refused.
async fn send(
    mut outgoing: mpsc::Receiver<Outgoing>,
    writers: Vec<Writer>,
    patience: Duration,
) -> (Vec<Writer>, Unsents) {
    let mut refused = Unsents::new();
    // A reader that stands still costs one patience, not one for each sample that waits behind.
    let mut full = BTreeSet::new();
    while let Some(next) = outgoing.recv().await {
        match next {
            Outgoing::Sample(sample) => {
                let place = sample.place;
                let publish = || match writers.get(place) {
                    Some(writer) => writer.publish(&sample.bytes, sample.source),
                    None => Err(PublishError::Broken("no such topic".to_owned())),
                };
                let own = patience_for(&full, place, patience);
                let sent = once_there_is_room(publish, own).await;
                note_room(&mut full, place, &sent);
                if let Err(error) = sent {
                    *refused.entry((place, error.kind())).or_default() += 1;
                }
            }
            Outgoing::Settle(patience, answer) => {
                let all = futures::future::join_all(writers.iter().map(Writer::acknowledged));
                let settled = tokio::time::timeout(patience, all).await.is_ok();
                // Who asked may have gone.
                let _ = answer.send(settled);
            }
        }
    }
    (writers, refused)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// What becomes of a sample that finds room at the try of number `room`, and after how many tries.
    fn tried(room: u32, patience: Duration) -> (bool, u32) {
        let tries = Cell::new(0);
        let publish = || {
            tries.set(tries.get() + 1);
            if tries.get() < room {
                Err(PublishError::Full)
            } else {
                Ok(())
            }
        };
        let sent = runtime()
            .unwrap()
            .block_on(once_there_is_room(publish, patience));
        (sent.is_ok(), tries.get())
    }

    #[test]
    fn a_sample_waits_until_there_is_room_for_it() {
        assert_eq!(tried(40, Duration::from_secs(60)), (true, 40));
    }

    #[test]
    fn without_patience_a_sample_is_tried_once() {
        assert_eq!(tried(2, Duration::ZERO), (false, 1));
    }

    #[test]
    fn what_the_network_refuses_is_not_tried_again() {
        let tries = Cell::new(0);
        let publish = || {
            tries.set(tries.get() + 1);
            Err(PublishError::Broken("no such topic".to_owned()))
        };
        let patience = Duration::from_secs(60);
        let sent = runtime()
            .unwrap()
            .block_on(once_there_is_room(publish, patience));
        assert!(sent.is_err());
        assert_eq!(tries.get(), 1);
    }

    #[test]
    fn a_reader_that_stands_still_costs_one_patience_and_its_return_gives_it_again() {
        let patience = Duration::from_secs(5);
        let mut full = BTreeSet::new();
        assert_eq!(patience_for(&full, 3, patience), patience);
        note_room(&mut full, 3, &Err(PublishError::Full));
        assert_eq!(patience_for(&full, 3, patience), Duration::ZERO);
        assert_eq!(patience_for(&full, 4, patience), patience);
        note_room(&mut full, 3, &Ok(()));
        assert_eq!(patience_for(&full, 3, patience), patience);
    }
}
