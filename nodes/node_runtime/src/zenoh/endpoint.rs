//! Readers and writers of serialised samples: encapsulation header and CDR, in and out.
//!
//! A reliable writer numbers its samples and keeps the last ones, as many as its topic is deep; a reliable
//! reader asks for those that it missed, whether they were dropped on the way or said while a link was cut.
//! A latched reader asks for them at its start. All this is Zenoh's "advanced" publisher and subscriber: other
//! subscribers of the key see plain samples.

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
use super::query::{Answers, Asking};
use super::token;
use crate::clock;
use crate::network::{Guid, PublishError, RequestIdentity, Sample, check_encapsulation};
use crate::node::Bytes;

/// A reader holds at least so many samples.
const READER_FLOOR: u32 = 64;

/// How often a writer that has something new says up to which number, so that the last ones are missed too.
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
            depth: usize::try_from(depth.max(READER_FLOOR)).unwrap_or(usize::MAX),
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

    fn pop(&self) -> Option<Result<Sample, String>> {
        let mut samples = self.samples.lock().unwrap_or_else(PoisonError::into_inner);
        samples.pop_front()
    }

    async fn next(&self) -> Result<Sample, String> {
        loop {
            let arrived = self.arrived.notified();
            if let Some(sample) = self.pop() {
                return sample;
            }
            arrived.await;
        }
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
    Recovering {
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
    _source: Source,
}

impl Reader {
    pub(super) fn new(queue: Arc<Queue>, source: Source) -> Self {
        Self {
            queue,
            _source: source,
        }
    }

    pub async fn next(&self) -> Result<Sample, String> {
        self.queue.next().await
    }
}

pub(super) fn subscriber(session: &Session, key: String, qos: Qos) -> ::zenoh::Result<Reader> {
    let queue = Queue::new(qos.depth);
    let into = Arc::clone(&queue);
    let take = move |sample: sample::Sample| {
        if sample.kind() == SampleKind::Put {
            let read = received(sample.payload(), sample.attachment());
            into.push(read.map(|(_, sample)| sample));
        }
    };
    let plain = session.declare_subscriber(key).callback(take);
    let is_latched = qos.durability == Durability::TransientLocal;
    let source = if qos.reliability == Reliability::BestEffort && !is_latched {
        Source::Plain {
            _subscriber: plain.wait()?,
        }
    } else {
        let recovering = plain.recovery(RecoveryConfig::default().heartbeat());
        let _subscriber = if is_latched {
            let depth = usize::try_from(qos.depth.min(MOST_HISTORY)).unwrap_or(usize::MAX);
            let history = HistoryConfig::default().detect_late_publishers();
            recovering.history(history.max_samples(depth)).wait()?
        } else {
            recovering.wait()?
        };
        Source::Recovering { _subscriber }
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
        let numbering = MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT);
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
        let floor = i64::from(READER_FLOOR);
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
