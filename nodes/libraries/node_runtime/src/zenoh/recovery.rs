//! Reads a reliable topic: samples that were dropped on the way, or said while a link was cut, are fetched from
//! their writer, as Zenoh's "advanced" publishers offer it.

use std::str::FromStr as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ::zenoh::pubsub::Subscriber;
use ::zenoh::query::{ConsolidationMode, QueryTarget, Reply, ReplyKeyExpr};
use ::zenoh::sample::{self, SampleKind};
use ::zenoh::session::{EntityGlobalId, ZenohId};
use ::zenoh::{Session, Wait as _};
use tokio::time::Instant;

use super::endpoint::{Queue, received};
use super::order::{Order, Question};
use crate::network::Sample;

/// Writers of a topic that are kept in mind; the oldest give way.
const MAX_RECOVERED_WRITERS: usize = 256;

type Taken = Result<Sample, String>;

/// The writers that were heard, and what of them is missing.
struct Writers {
    queue: Arc<Queue>,
    depth: u32,
    orders: Mutex<Vec<(EntityGlobalId, Order<Taken>)>>,
    has_gap: AtomicBool,
}

impl Writers {
    fn orders(&self) -> MutexGuard<'_, Vec<(EntityGlobalId, Order<Taken>)>> {
        self.orders.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with a writer's order and hands on what is then ready.
    fn with<R>(&self, writer: &EntityGlobalId, work: impl FnOnce(&mut Order<Taken>) -> R) -> R {
        let mut orders = self.orders();
        let known = orders.iter().position(|(known, _)| known == writer);
        let place = known.unwrap_or_else(|| {
            if orders.len() >= MAX_RECOVERED_WRITERS {
                orders.remove(0);
            }
            orders.push((*writer, Order::new(self.depth)));
            orders.len() - 1
        });
        let order = &mut orders[place].1;
        let done = work(order);
        for sample in order.ready.drain(..) {
            self.queue.push(sample);
        }
        let has_gap = orders.iter().any(|(_, order)| order.has_gap());
        self.has_gap.store(has_gap, Ordering::Relaxed);
        done
    }

    fn take(&self, sample: &sample::Sample) {
        if sample.kind() != SampleKind::Put {
            return;
        }
        let read = received(sample.payload(), sample.attachment()).map(|(_, sample)| sample);
        match sample.source_info() {
            Some(source) => {
                let number = source.source_sn();
                let now = Instant::now();
                self.with(source.source_id(), |order| order.take(number, read, now));
            }
            // A writer that does not number what it says.
            None => self.queue.push(read),
        }
    }

    fn heartbeat(&self, sample: &sample::Sample) {
        let Some(writer) = writer_of(sample.key_expr().as_str()) else {
            return;
        };
        if let Ok(number) = zenoh_ext::z_deserialize::<u32>(sample.payload()) {
            let now = Instant::now();
            self.with(&writer, |order| order.told(number, now));
            self.queue.wake();
        }
    }
}

/// Whose heartbeat it is: `…/@adv/pub/<session>/<number>/…`.
pub(super) fn writer_of(key: &str) -> Option<EntityGlobalId> {
    let (_, after) = key.split_once("/@adv/pub/")?;
    let mut words = after.split('/');
    let session = ZenohId::from_str(words.next()?).ok()?;
    let number = words.next()?.parse().ok()?;
    Some(EntityGlobalId::new(session, number))
}

/// A question that ends when nobody can answer it any more.
struct Open {
    writers: Arc<Writers>,
    writer: EntityGlobalId,
    question: u64,
}

impl Drop for Open {
    fn drop(&mut self) {
        let now = Instant::now();
        self.writers
            .with(&self.writer, |order| order.ended(self.question, now));
        self.writers.queue.wake();
    }
}

/// A reader's subscriptions, and its questions.
pub(super) struct Recovery {
    session: Session,
    key: String,
    writers: Arc<Writers>,
    _samples: Subscriber<()>,
    _heartbeats: Subscriber<()>,
}

impl Recovery {
    pub fn start(
        session: &Session,
        key: String,
        depth: u32,
        queue: &Arc<Queue>,
    ) -> ::zenoh::Result<Self> {
        let writers = Arc::new(Writers {
            queue: Arc::clone(queue),
            depth,
            orders: Mutex::default(),
            has_gap: AtomicBool::new(false),
        });
        let own = Arc::clone(&writers);
        let heartbeats = session
            .declare_subscriber(format!("{key}/@adv/pub/**"))
            .callback(move |sample| own.heartbeat(&sample))
            .wait()?;
        let own = Arc::clone(&writers);
        let samples = session
            .declare_subscriber(key.clone())
            .callback(move |sample| own.take(&sample))
            .wait()?;
        Ok(Self {
            session: session.clone(),
            key,
            writers,
            _samples: samples,
            _heartbeats: heartbeats,
        })
    }

    /// Whether something is missing.
    pub fn has_gap(&self) -> bool {
        self.writers.has_gap.load(Ordering::Relaxed)
    }

    /// Asks for what is missing, where it is time to.
    pub fn look(&self) {
        if !self.has_gap() {
            return;
        }
        let now = Instant::now();
        let known: Vec<EntityGlobalId> = self.writers.orders().iter().map(|(id, _)| *id).collect();
        for writer in known {
            let question = self.writers.with(&writer, |order| order.question(now));
            if let Some(question) = question {
                self.ask(writer, question);
            }
        }
    }

    fn ask(&self, writer: EntityGlobalId, Question { id, first, last }: Question) {
        let (session, number) = (writer.zid(), writer.eid());
        let selector = format!(
            "{}/@adv/*/{session}/{number}/**?_sn={first}..{last}",
            self.key
        );
        let open = Open {
            writers: Arc::clone(&self.writers),
            writer,
            question: id,
        };
        let take = move |reply: Reply| {
            if let Ok(sample) = reply.result() {
                open.writers.take(sample);
            }
        };
        // Where it cannot be asked it has ended, and is asked again.
        let _ = self
            .session
            .get(selector)
            .callback(take)
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .wait();
    }
}
