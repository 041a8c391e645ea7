//! Services: a server is a queryable, a request a query, and the answer goes back the way it came.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ::zenoh::query::{ConsolidationMode, Query, QueryTarget, Reply};
use ::zenoh::{Session, Wait as _};

use super::attachment::Attachment;
use super::endpoint::{Queue, Reader, Source, Writer, received};
use crate::clock;
use crate::network::RequestIdentity;
use crate::node::Bytes;

/// Requests that wait for their answer at a server; the oldest give way and are then never answered.
const MOST_OPEN: usize = 1_024;
/// Requests and replies on their way to the node.
const QUERY_DEPTH: u32 = 1_024;
/// How long Zenoh keeps a question open. A goal's result may be long in coming, and the node itself
/// decides how long it waits for an answer.
const QUERY_TIMEOUT: Duration = Duration::from_secs(30 * 24 * 3_600);

/// Queries without an answer yet.
#[derive(Default)]
struct Open {
    queries: BTreeMap<RequestIdentity, Query>,
    order: VecDeque<RequestIdentity>,
}

impl Open {
    fn insert(&mut self, identity: RequestIdentity, query: Query) {
        self.order.retain(|known| self.queries.contains_key(known));
        while self.queries.len() >= MOST_OPEN {
            let Some(oldest) = self.order.pop_front() else {
                break;
            };
            self.queries.remove(&oldest);
        }
        self.order.push_back(identity);
        self.queries.insert(identity, query);
    }
}

/// Gives answers.
pub(super) struct Answers {
    open: Arc<Mutex<Open>>,
}

impl Answers {
    pub fn give(&self, bytes: &Bytes, to: RequestIdentity) -> ::zenoh::Result<()> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(query) = open.queries.remove(&to) else {
            return Err("the request is not open any more".into());
        };
        drop(open);
        let attachment = Attachment {
            sequence: to.sequence,
            source_nanos: clock::host_now().nanos(),
            sender: to.writer,
        };
        query
            .reply(query.key_expr().clone(), &bytes[..])
            .attachment(attachment.bytes())
            .wait()
    }
}

pub(super) fn server(
    session: &Session,
    key: &str,
    token: &str,
) -> ::zenoh::Result<(Reader, Writer)> {
    let queue = Queue::new(QUERY_DEPTH);
    let open = Arc::<Mutex<Open>>::default();
    let (into, kept) = (Arc::clone(&queue), Arc::clone(&open));
    let take = move |query: Query| {
        let nothing = ::zenoh::bytes::ZBytes::new();
        let payload = query.payload().unwrap_or(&nothing);
        let read = received(payload, query.attachment()).map(|(attachment, mut sample)| {
            sample.related = Some(attachment.identity());
            let mut open = kept.lock().unwrap_or_else(PoisonError::into_inner);
            open.insert(attachment.identity(), query);
            sample
        });
        into.push(read);
    };
    let queryable = session
        .declare_queryable(key)
        .complete(true)
        .callback(take)
        .wait()?;
    let source = Source::Questions {
        _queryable: queryable,
    };
    let reader = Reader::new(queue, source);
    Ok((reader, Writer::answering(Answers { open }, token)))
}

/// Asks a service.
pub(super) struct Asking {
    session: Session,
    key: String,
    replies: Arc<Queue>,
}

impl Asking {
    pub fn ask(&self, bytes: &Bytes, attachment: Attachment) -> ::zenoh::Result<()> {
        let replies = Arc::clone(&self.replies);
        let take = move |reply: Reply| {
            // An error is Zenoh's word that nobody is there any more; the node sees that by itself.
            if let Ok(sample) = reply.result() {
                let read = received(sample.payload(), sample.attachment());
                replies.push(read.map(|(echoed, mut sample)| {
                    sample.related = Some(echoed.identity());
                    sample
                }));
            }
        };
        self.session
            .get(&self.key)
            .payload(&bytes[..])
            .attachment(attachment.bytes())
            .target(QueryTarget::AllComplete)
            .consolidation(ConsolidationMode::None)
            .timeout(QUERY_TIMEOUT)
            .callback(take)
            .wait()
    }
}

pub(super) fn client(session: &Session, key: String, token: &str) -> (Reader, Writer) {
    let replies = Queue::new(QUERY_DEPTH);
    let asking = Asking {
        session: session.clone(),
        key,
        replies: Arc::clone(&replies),
    };
    let reader = Reader::new(replies, Source::Replies);
    (reader, Writer::asking(asking, token))
}
