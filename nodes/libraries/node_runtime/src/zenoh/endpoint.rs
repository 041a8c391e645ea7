//! Readers and writers of serialised samples: encapsulation header and CDR, in and out.
//!
//! A reliable writer numbers its samples and keeps the last ones, as many as its topic is deep; a reliable
//! reader asks for those that it missed, whether they were dropped on the way or said while a link was cut
//! ([`Recovery`]). A latched reader asks for them at its start. Writers and latched readers are Zenoh's "advanced"
//! publishers and subscribers: other subscribers of the key see plain samples.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ::zenoh::pubsub::{Publisher, Subscriber};
use ::zenoh::qos::{CongestionControl, Reliability as Delivery};
use ::zenoh::query::Queryable;
use ::zenoh::sample::SampleKind;
use ::zenoh::{Session, Wait as _, sample};
use abbe_msgs::{Durability, Qos, Reliability};
use metrology::Stamp;
use metrology::stamp::Host;
use tokio::sync::Notify;
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt as _, AdvancedSubscriber,
    AdvancedSubscriberBuilderExt as _, CacheConfig, HistoryConfig, MissDetectionConfig,
    RecoveryConfig,
};

use super::attachment::Attachment;
use super::order;
use super::query::{Answers, Asking};
use super::recovery::Recovery;
use super::token;
use crate::clock;
use crate::network::{Guid, PublishError, RequestIdentity, Sample, check_encapsulation};
use crate::node::Bytes;

/// A reader holds at least so many samples.
const ZENOH_READER_FLOOR: u32 = 64;

/// How often a writer says up to which number it has spoken, so that the last ones are missed too. Zenoh's other
/// way, to say it only after something new, waits for full links: a router whose one link was cut stood for 5 s.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// A tap asks for its topics' history up to this depth.
const MOST_HISTORY: u32 = 1_000;

/// Samples between Zenoh's thread and the node's; the oldest give way.
pub(super) struct Queue {
    samples: Mutex<VecDeque<Result<Sample, String>>>,
    arrived: Notify,
    depth: usize,
}

impl Queue {
    pub fn new(depth: u32) -> Arc<Self> {
        Arc::new(Self {
            samples: Mutex::default(),
            arrived: Notify::new(),
            depth: usize::try_from(depth.max(ZENOH_READER_FLOOR)).unwrap_or(usize::MAX),
        })
    }

    pub fn push(&self, sample: Result<Sample, String>) {
        let mut samples = self.samples.lock().unwrap_or_else(PoisonError::into_inner);
        if samples.len() >= self.depth {
            samples.pop_front();
        }
        samples.push_back(sample);
        drop(samples);
        self.arrived.notify_one();
    }

    /// Lets the reader look whether something is to be asked for.
    pub fn wake(&self) {
        self.arrived.notify_one();
    }

    fn pop(&self) -> Option<Result<Sample, String>> {
        let mut samples = self.samples.lock().unwrap_or_else(PoisonError::into_inner);
        samples.pop_front()
    }
}

/// What came, with what was attached to it.
pub(super) fn received(
    payload: &::zenoh::bytes::ZBytes,
    attached: Option<&::zenoh::bytes::ZBytes>,
) -> Result<(Attachment, Sample), String> {
    let attachment = Attachment::of(attached)?;
    let bytes: Bytes = Arc::from(payload.to_bytes().as_ref());
    match bytes.get(..4) {
        Some([0, 0 | 1, ..]) => {}
        other => return Err(format!("encapsulation {other:02x?} is not plain CDR")),
    }
    let sample = Sample {
        bytes,
        writer: attachment.sender,
        sequence: attachment.sequence,
        source: Some(Stamp::from_nanos(attachment.source_nanos)),
        received: clock::host_now(),
        related: None,
    };
    Ok((attachment, sample))
}

/// What keeps a reader's samples coming.
pub(super) enum Source {
    Plain {
        _subscriber: Subscriber<()>,
    },
    Recovering(Recovery),
    Latched {
        _subscriber: AdvancedSubscriber<()>,
    },
    Questions {
        _queryable: Queryable<()>,
    },
    /// Replies come with their questions.
    Replies,
}

/// Reads one topic, or the requests or replies of one service.
pub(crate) struct Reader {
    queue: Arc<Queue>,
    source: Source,
}

impl Reader {
    pub(super) fn new(queue: Arc<Queue>, source: Source) -> Self {
        Self { queue, source }
    }

    pub async fn next(&self) -> Result<Sample, String> {
        loop {
            let arrived = self.queue.arrived.notified();
            let mut has_gap = false;
            if let Source::Recovering(recovery) = &self.source {
                recovery.look();
                has_gap = recovery.has_gap();
            }
            if let Some(sample) = self.queue.pop() {
                return sample;
            }
            if has_gap {
                // Nobody may have an answer yet, and nothing more come by itself.
                let _ = tokio::time::timeout(order::AGAIN, arrived).await;
            } else {
                arrived.await;
            }
        }
    }
}

pub(super) fn subscriber(session: &Session, key: String, qos: Qos) -> ::zenoh::Result<Reader> {
    let queue = Queue::new(qos.depth);
    let is_latched = qos.durability == Durability::TransientLocal;
    if qos.reliability == Reliability::Reliable && !is_latched {
        let recovery = Recovery::start(session, key, qos.depth, &queue)?;
        return Ok(Reader::new(queue, Source::Recovering(recovery)));
    }
    let into = Arc::clone(&queue);
    let take = move |sample: sample::Sample| {
        if sample.kind() == SampleKind::Put {
            let read = received(sample.payload(), sample.attachment());
            into.push(read.map(|(_, sample)| sample));
        }
    };
    let plain = session.declare_subscriber(key).callback(take);
    let source = if is_latched {
        let depth = usize::try_from(qos.depth.min(MOST_HISTORY)).unwrap_or(usize::MAX);
        let history = HistoryConfig::default().detect_late_publishers();
        let recovering = plain.recovery(RecoveryConfig::default().heartbeat());
        Source::Latched {
            _subscriber: recovering.history(history.max_samples(depth)).wait()?,
        }
    } else {
        Source::Plain {
            _subscriber: plain.wait()?,
        }
    };
    Ok(Reader::new(queue, source))
}

enum Way {
    Plain(Publisher<'static>),
    Keeping(AdvancedPublisher<'static>),
    Answers(Answers),
    Questions(Asking),
}

/// Writes one topic, or the requests or replies of one service.
pub(crate) struct Writer {
    way: Way,
    guid: Guid,
    sent: AtomicI64,
}

pub(super) fn publisher(
    session: &Session,
    key: String,
    token: &str,
    qos: Qos,
    waits: bool,
) -> ::zenoh::Result<Writer> {
    let (is_reliable, is_latched) = (
        qos.reliability == Reliability::Reliable,
        qos.durability == Durability::TransientLocal,
    );
    let congestion = if is_reliable && waits {
        CongestionControl::Block
    } else {
        CongestionControl::Drop
    };
    let reliability = if is_reliable {
        Delivery::Reliable
    } else {
        Delivery::BestEffort
    };
    let plain = session
        .declare_publisher(key)
        .congestion_control(congestion)
        .reliability(reliability);
    let way = if is_reliable || is_latched {
        let depth = usize::try_from(qos.depth.max(1)).unwrap_or(usize::MAX);
        let keeping = plain.cache(CacheConfig::default().max_samples(depth));
        let numbering = MissDetectionConfig::default().heartbeat(HEARTBEAT);
        let numbered = keeping.sample_miss_detection(numbering);
        Way::Keeping(numbered.publisher_detection().wait()?)
    } else {
        Way::Plain(plain.wait()?)
    };
    Ok(Writer::new(way, token))
}

fn broken(error: ::zenoh::Error) -> PublishError {
    PublishError::Broken(error.to_string())
}

impl Writer {
    fn new(way: Way, token: &str) -> Self {
        Self {
            way,
            guid: token::guid(token),
            sent: AtomicI64::new(0),
        }
    }

    pub(super) fn answering(answers: Answers, token: &str) -> Self {
        Self::new(Way::Answers(answers), token)
    }

    pub(super) fn asking(asking: Asking, token: &str) -> Self {
        Self::new(Way::Questions(asking), token)
    }

    pub fn guid(&self) -> Guid {
        self.guid
    }

    fn attachment(&self, source: Option<Stamp<Host>>) -> Attachment {
        Attachment {
            sequence: self.sent.fetch_add(1, Ordering::Relaxed) + 1,
            source_nanos: source.unwrap_or_else(clock::host_now).nanos(),
            sender: self.guid,
        }
    }

    pub fn publish(&self, bytes: &Bytes, source: Option<Stamp<Host>>) -> Result<(), PublishError> {
        check_encapsulation(bytes)?;
        let attached = self.attachment(source).bytes();
        let put = match &self.way {
            Way::Plain(publisher) => publisher.put(&bytes[..]).attachment(attached).wait(),
            Way::Keeping(publisher) => publisher.put(&bytes[..]).attachment(attached).wait(),
            Way::Answers(_) | Way::Questions(_) => {
                return Err(PublishError::Broken("no publisher of a topic".to_owned()));
            }
        };
        put.map_err(broken)
    }

    pub fn reply(&self, bytes: &Bytes, to: RequestIdentity) -> Result<(), PublishError> {
        check_encapsulation(bytes)?;
        match &self.way {
            Way::Answers(answers) => answers.give(bytes, to).map_err(broken),
            _ => Err(PublishError::Broken("no server of a service".to_owned())),
        }
    }

    pub fn request(&self, bytes: &Bytes) -> Result<RequestIdentity, PublishError> {
        check_encapsulation(bytes)?;
        let attachment = self.attachment(None);
        match &self.way {
            Way::Questions(asking) => asking.ask(bytes, attachment).map_err(broken)?,
            _ => return Err(PublishError::Broken("no client of a service".to_owned())),
        }
        Ok(attachment.identity())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(sequence: i64) -> Sample {
        Sample {
            bytes: Arc::from([0, 1, 0, 0].as_slice()),
            writer: [1; 16],
            sequence,
            source: None,
            received: Stamp::from_nanos(0),
            related: None,
        }
    }

    #[test]
    fn a_full_queue_gives_up_its_oldest() {
        let queue = Queue::new(3);
        let floor = i64::from(ZENOH_READER_FLOOR);
        for sequence in 0..floor + 5 {
            queue.push(Ok(sample(sequence)));
        }
        let left: Vec<_> = std::iter::from_fn(|| queue.pop())
            .map(|sample| sample.unwrap().sequence)
            .collect();
        assert_eq!(left, (5..floor + 5).collect::<Vec<_>>());
    }

    #[test]
    fn what_is_not_of_ros_is_refused_with_the_reason() {
        let attached = Attachment {
            sequence: 1,
            source_nanos: 2,
            sender: [3; 16],
        };
        let attached = ::zenoh::bytes::ZBytes::from(attached.bytes());
        let plain = |bytes: &[u8]| ::zenoh::bytes::ZBytes::from(bytes);
        let (_, sample) = received(&plain(&[0, 1, 0, 0, 9]), Some(&attached)).unwrap();
        assert_eq!((sample.sequence, sample.writer), (1, [3; 16]));
        assert_eq!(sample.source, Some(Stamp::from_nanos(2)));
        let parameter_list = received(&plain(&[0, 3, 0, 0]), Some(&attached)).unwrap_err();
        assert!(parameter_list.contains("not plain CDR"), "{parameter_list}");
        assert!(received(&plain(&[]), Some(&attached)).is_err());
        let alone = received(&plain(&[0, 1, 0, 0]), None).unwrap_err();
        assert!(alone.contains("attached"), "{alone}");
    }
}
