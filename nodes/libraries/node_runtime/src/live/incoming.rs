//! What reaches a node's owner through its one queue, and the tasks that put it there.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use abbe_msgs::msg::HostClock as HostClockMessage;
use abbe_msgs::rosgraph_msgs::msg::Clock as ClockMessage;
use abbe_msgs::{Wire, from_cdr};
use metrology::Stamp;
use metrology::sample::HostClock;
use metrology::stamp::Host;
use tokio::sync::mpsc::Sender;
use tokio::task::JoinSet;

use crate::network::{Guid, Reader, RequestIdentity, Sample};
use crate::node::Bytes;

use super::service::{self, ReplyTo};

/// Room in a node's queue. When it is full, samples wait in the readers' caches, which hold the
/// topic's depth.
pub(super) const NODE_QUEUE_LEN: usize = 1_024;

/// One thing that happened.
#[derive(Debug)]
pub(super) enum Incoming {
    /// A message for the node.
    Message {
        subscription: usize,
        bytes: Bytes,
        received: Stamp<Host>,
        writer: Guid,
        after: After,
    },
    /// A sample that is no plain CDR.
    Unreadable { topic: Arc<str>, reason: String },
    /// A request at one of our servers.
    Request {
        server: usize,
        client: Guid,
        to: ReplyTo,
        bytes: Bytes,
    },
    /// A reply to one of our clients.
    Reply {
        client: usize,
        identity: RequestIdentity,
        bytes: Bytes,
    },
    /// Feedback of an action that we use.
    Feedback { client: usize, bytes: Bytes },
    /// A timer of the computer's clock is due; `missed` periods went by unserved.
    Timer { timer: usize, missed: u64 },
    /// Simulated time.
    Clock(Stamp<Host>),
    /// How the clock of a host stands to the reference's.
    HostClock(Box<HostClock>),
}

/// How a message follows what came on its topic before.
#[derive(Clone, Copy, Debug)]
pub(super) struct After {
    /// Samples of its writer that never came since the one before.
    pub lost: u64,
    /// Whether another writer spoke in between: [`Turns::take`].
    pub takes_turns: bool,
}

/// Writers of one topic that are remembered; where more come, all are forgotten and counted anew.
const MAX_COUNTED_WRITERS: usize = 4_096;

/// Counts what a topic's writers sent and we never got.
#[derive(Debug, Default)]
pub(crate) struct GapCounter {
    last: BTreeMap<Guid, i64>,
}

impl GapCounter {
    /// Samples missing between this one and the last of its writer.
    pub fn count(&mut self, writer: Guid, sequence: i64) -> u64 {
        match self.last.get_mut(&writer) {
            Some(last) if sequence > *last => {
                let lost = sequence - *last - 1;
                *last = sequence;
                u64::try_from(lost).unwrap_or(0)
            }
            // Out of order: counted as lost before, or a repetition.
            Some(_) => 0,
            None => {
                if self.last.len() >= MAX_COUNTED_WRITERS {
                    self.last.clear();
                }
                self.last.insert(writer, sequence);
                0
            }
        }
    }
}

/// Tells writers that speak by turns from one that took over: who was started anew does not fall silent again.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    speaks: Option<Guid>,
    spoke: BTreeSet<Guid>,
}

impl Turns {
    /// Whether `writer`, whose sample came, had spoken before another one did.
    pub fn take(&mut self, writer: Guid) -> bool {
        match self.speaks.replace(writer) {
            Some(before) if before != writer => {
                if self.spoke.len() >= MAX_COUNTED_WRITERS {
                    self.spoke.clear();
                }
                self.spoke.insert(before);
                self.spoke.contains(&writer)
            }
            _ => false,
        }
    }
}

/// The reading tasks of a node; they end with it.
pub(super) struct Readers {
    tasks: JoinSet<()>,
    queue: Sender<Incoming>,
}

impl Readers {
    pub fn new(queue: Sender<Incoming>) -> Self {
        Self {
            tasks: JoinSet::new(),
            queue,
        }
    }

    /// Reads a topic until the node ends.
    pub fn spawn(
        &mut self,
        topic: &str,
        reader: Reader,
        mut form: impl FnMut(Sample) -> Option<Incoming> + Send + 'static,
    ) {
        let queue = self.queue.clone();
        let topic: Arc<str> = Arc::from(topic);
        self.tasks.spawn(async move {
            loop {
                let incoming = match reader.next().await {
                    Ok(sample) => form(sample),
                    Err(reason) => Some(Incoming::Unreadable {
                        topic: Arc::clone(&topic),
                        reason,
                    }),
                };
                if let Some(incoming) = incoming
                    && queue.send(incoming).await.is_err()
                {
                    return;
                }
            }
        });
    }

    pub fn messages(&mut self, topic: &str, reader: Reader, subscription: usize) {
        let mut gaps = GapCounter::default();
        let mut turns = Turns::default();
        self.spawn(topic, reader, move |sample| {
            let after = After {
                lost: gaps.count(sample.writer, sample.sequence),
                takes_turns: turns.take(sample.writer),
            };
            let Sample {
                bytes,
                received,
                writer,
                ..
            } = sample;
            Some(Incoming::Message {
                subscription,
                bytes,
                received,
                writer,
                after,
            })
        });
    }

    pub fn requests(&mut self, topic: &str, reader: Reader, server: usize) {
        self.spawn(topic, reader, move |sample| {
            let client = sample.writer;
            let (to, bytes) = service::request(sample)?;
            Some(Incoming::Request {
                server,
                client,
                to,
                bytes,
            })
        });
    }

    pub fn replies(&mut self, topic: &str, reader: Reader, client: usize) {
        self.spawn(topic, reader, move |sample| {
            let (identity, bytes) = service::reply(sample)?;
            Some(Incoming::Reply {
                client,
                identity,
                bytes,
            })
        });
    }

    pub fn feedback(&mut self, topic: &str, reader: Reader, client: usize) {
        self.spawn(topic, reader, move |sample| {
            Some(Incoming::Feedback {
                client,
                bytes: sample.bytes,
            })
        });
    }

    pub fn clock(&mut self, topic: &str, reader: Reader) {
        let name: Arc<str> = Arc::from(topic);
        self.spawn(topic, reader, move |sample| {
            Some(match from_cdr::<ClockMessage>(&sample.bytes) {
                Ok(message) => match abbe_msgs::instant(&message.clock) {
                    Some(now) => Incoming::Clock(now),
                    None => Incoming::Unreadable {
                        topic: Arc::clone(&name),
                        reason: format!(
                            "clock: {} ns: must be below 1000000000 ns",
                            message.clock.nanosec
                        ),
                    },
                },
                Err(error) => Incoming::Unreadable {
                    topic: Arc::clone(&name),
                    reason: error.to_string(),
                },
            })
        });
    }

    pub fn host_clock(&mut self, topic: &str, reader: Reader) {
        let name: Arc<str> = Arc::from(topic);
        self.spawn(topic, reader, move |sample| {
            let read = from_cdr::<HostClockMessage>(&sample.bytes).and_then(Wire::into_inner);
            Some(match read {
                Ok(clock) => Incoming::HostClock(Box::new(clock)),
                Err(error) => Incoming::Unreadable {
                    topic: Arc::clone(&name),
                    reason: error.to_string(),
                },
            })
        });
    }

    /// Ends all reading.
    pub async fn stop(mut self) {
        self.tasks.shutdown().await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_per_writer() {
        let (a, b) = ([1; 16], [2; 16]);
        let mut gaps = GapCounter::default();
        let lost: Vec<_> = [(a, 5), (a, 6), (b, 1), (a, 9), (a, 8), (b, 2), (a, 10)]
            .map(|(writer, sequence)| gaps.count(writer, sequence))
            .into();
        assert_eq!(lost, [0, 0, 0, 2, 0, 0, 0]);
    }

    #[test]
    fn writers_without_end_are_not_remembered() {
        let (mut gaps, mut turns) = (GapCounter::default(), Turns::default());
        for n in 0..3 * u128::try_from(MAX_COUNTED_WRITERS).unwrap() {
            let writer = n.to_be_bytes();
            gaps.count(writer, 1);
            turns.take(writer);
            assert!(
                gaps.last.len() <= MAX_COUNTED_WRITERS && turns.spoke.len() <= MAX_COUNTED_WRITERS
            );
        }
    }

    #[test]
    fn a_writer_that_comes_back_takes_turns_and_one_that_takes_over_does_not() {
        let (a, b, c) = ([1; 16], [2; 16], [3; 16]);
        let mut turns = Turns::default();
        let found: Vec<_> = [a, a, b, b, c, c, b, c, c].map(|w| turns.take(w)).into();
        let expected = [false, false, false, false, false, false, true, true, false];
        assert_eq!(found, expected);
    }
}
