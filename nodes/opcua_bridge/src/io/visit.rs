//! One connection, from the choice of the endpoint to its end.
//!
//! A break of the connection does not end it: the session is taken up again while the server keeps it, what was missed is
//! asked for by its number (republish), and what holds is read. A server that has begun anew does not know the session:
//! then the visit ends, and the next one looks up the namespaces again.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use futures::StreamExt;
use metrology::stamp::{Host, Stamp};
use opcua::client::{
    MonitoredItemMap, OnSubscriptionNotificationCore, Session, SessionConnectMode,
    SessionDropGuard, SessionPollResult,
};
use opcua::types::{
    DataChangeNotification, DataValue, Error, MonitoredItemCreateRequest, MonitoringMode,
    MonitoringParameters, NodeId, NotificationMessage, ReadValueId, StatusChangeNotification,
    StatusCode, TimestampsToReturn,
};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::task::JoinHandle;
use tokio::time::Instant;

use super::client::{Clients, Events, duration, host_now};
use super::convert::{self, change, words};
use super::sequence::{Place, Sequence};
use super::{Credentials, endpoint, nodes};
use crate::config::Settings;
use crate::engineering_unit::ShownUnit;
use crate::stage::IoEvent;
use crate::value::Change;

/// Messages of the server that wait at most, each with at most [`CHANGES`].
const WAITING: usize = 256;
/// Changes in one message at most.
const CHANGES: u32 = 1000;
/// Nodes in one request at most.
const NODES_CHUNK: usize = 500;
/// Messages that are asked for again at most, after one break.
const REPUBLISHED: u64 = 10_000;
/// The server's subscription lives so many times its keep-alive.
const LIFETIMES: u32 = 3;

/// A message with the instant at which it came.
type Note = (Stamp<Host>, NotificationMessage);

/// What is to be given up at the end.
#[derive(Default)]
pub(super) struct Held {
    guard: Option<SessionDropGuard>,
    pump: Option<JoinHandle<()>>,
}

impl Held {
    /// Closes the session, in at most this time.
    pub(super) async fn leave(self, limit: Duration) {
        drop(self.guard);
        if let Some(mut pump) = self.pump
            && tokio::time::timeout(limit, &mut pump).await.is_err()
        {
            pump.abort();
        }
    }
}

/// What the client's loop reports of the connection.
enum Link {
    Made(SessionConnectMode),
    Lost(StatusCode),
    NotMade(StatusCode),
    Ended(StatusCode),
}

/// Hands messages over as they come.
struct Mailbox {
    notes: Sender<Note>,
    dropped: Arc<AtomicU64>,
}

impl OnSubscriptionNotificationCore for Mailbox {
    fn on_subscription_notification(
        &mut self,
        message: NotificationMessage,
        _: MonitoredItemMap<'_>,
    ) {
        // Waiting here would stop the client's loop, which a republish needs.
        if self.notes.try_send((host_now(), message)).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// A subscription at work.
struct Visit<'a> {
    session: Arc<Session>,
    settings: &'a Settings,
    events: &'a Events,
    nodes: Vec<(usize, NodeId)>,
    subscription: u32,
    sequence: Sequence,
    notes: Receiver<Note>,
    dropped: Arc<AtomicU64>,
    /// Marks of what each item sent last.
    sent: BTreeMap<usize, u64>,
    /// Messages were lost since every node was read last.
    has_lost: bool,
}

/// The same for the same value and status.
fn mark(change: &Change) -> u64 {
    let mut hasher = DefaultHasher::new();
    (change.payload.text(), change.status.0).hash(&mut hasher);
    hasher.finish()
}

/// Connects, subscribes and hands over; returns why it ended.
pub(super) async fn visit(
    clients: &Clients,
    settings: &Settings,
    credentials: &Credentials,
    events: &Events,
    held: &mut Held,
) -> IoEvent {
    let endpoint = match endpoint::choose(&clients.discovery, settings).await {
        Ok(endpoint) => endpoint,
        Err(ended) => return ended,
    };
    let security = endpoint::security(&endpoint);
    let built = clients
        .session
        .session_builder()
        .user_identity_token(endpoint::token(&settings.security, credentials))
        .connect_to_endpoint_directly(endpoint)
        .and_then(|builder| builder.build(Arc::clone(clients.session.certificate_store())));
    let (session, event_loop) = match built {
        Ok(built) => built,
        Err(error) => return ended(error),
    };
    held.guard = Some(session.close_on_drop());
    let (links, mut link) = channel(WAITING);
    held.pump = Some(tokio::spawn(async move {
        let stream = event_loop.enter();
        tokio::pin!(stream);
        while let Some(polled) = stream.next().await {
            let link = match polled {
                Ok(SessionPollResult::Reconnected(mode)) => Link::Made(mode),
                Ok(SessionPollResult::ConnectionLost(status)) => Link::Lost(status),
                Ok(SessionPollResult::ReconnectFailed(status)) => Link::NotMade(status),
                Ok(_) => continue,
                Err(status) => Link::Ended(status),
            };
            // The visit has ended, or does not look any more: the guard ends this loop.
            let _ = links.try_send(link);
        }
    }));
    match link.recv().await {
        Some(Link::Made(_)) => {}
        Some(Link::NotMade(status) | Link::Lost(status) | Link::Ended(status)) => {
            return endpoint::not_made(status, credentials);
        }
        None => return said("the connection ended before it was made"),
    }
    let user = match settings.security.user.as_str() {
        "" => "anonymous".to_owned(),
        user => user.to_owned(),
    };
    match Visit::begin(session, settings, events, (security, user)).await {
        Ok(mut visit) => visit.go_on(&mut link).await,
        Err(ended) => ended,
    }
}

fn said(reason: &str) -> IoEvent {
    let reason = reason.to_owned();
    IoEvent::Ended { reason }
}

/// Whether an answer is beyond what this side, or the server, puts into one message.
fn is_too_long(status: StatusCode) -> bool {
    let beyond = [
        StatusCode::BadEncodingLimitsExceeded,
        StatusCode::BadResponseTooLarge,
        StatusCode::BadTcpMessageTooLarge,
    ];
    beyond.contains(&status)
}

fn ended(error: impl std::fmt::Display) -> IoEvent {
    let reason = convert::reason(&error);
    IoEvent::Ended { reason }
}

impl<'a> Visit<'a> {
    /// Looks up the nodes and subscribes to them.
    async fn begin(
        session: Arc<Session>,
        settings: &'a Settings,
        events: &'a Events,
        (security, user): (String, String),
    ) -> Result<Self, IoEvent> {
        let found = nodes::find(&session, &settings.items)
            .await
            .map_err(ended)?;
        let (notes, receiver) = channel(WAITING);
        let dropped = Arc::new(AtomicU64::new(0));
        let mailbox = Mailbox {
            notes,
            dropped: Arc::clone(&dropped),
        };
        let publishing = Duration::from_millis(settings.subscription.publishing_ms.into());
        let keep_alives = settings.keep_alive.as_secs_f64() / publishing.as_secs_f64();
        let keep_alives = (keep_alives.ceil() as u32).max(1);
        let lives = settings.session.as_secs_f64() / publishing.as_secs_f64();
        let lifetime = (lives.ceil() as u32).max(keep_alives.saturating_mul(LIFETIMES));
        let subscription = session
            .create_subscription(publishing, lifetime, keep_alives, CHANGES, 0, true, mailbox)
            .await
            .map_err(ended)?;
        let mut visit = Visit {
            session,
            settings,
            events,
            nodes: Vec::new(),
            subscription,
            sequence: Sequence::default(),
            notes: receiver,
            dropped,
            sent: BTreeMap::new(),
            has_lost: false,
        };
        let mut missing = found.missing;
        let granted = visit.monitor(found.nodes, &mut missing).await?;
        missing.sort();
        let units = visit.units().await;
        let up = IoEvent::Up {
            security,
            user,
            missing,
            units,
            given_ms: granted.map(|(ms, _)| ms),
            given_queue: granted.map_or(0, |(_, queue)| queue),
        };
        events.send(host_now(), up);
        Ok(visit)
    }

    /// Subscribes to nodes; returns the longest sampling interval in ms and the shortest queue that were granted.
    async fn monitor(
        &mut self,
        found: Vec<(usize, NodeId)>,
        missing: &mut Vec<(usize, String)>,
    ) -> Result<Option<(f64, u32)>, IoEvent> {
        let mut granted: Option<(f64, u32)> = None;
        for chunk in found.chunks(NODES_CHUNK) {
            let requests = chunk.iter().map(|(item, node)| self.request(*item, node));
            let created = self
                .session
                .create_monitored_items(
                    self.subscription,
                    TimestampsToReturn::Both,
                    requests.collect(),
                )
                .await
                .map_err(ended)?;
            // A server that leaves answers out has not subscribed to what they belong to.
            for (item, _) in chunk.iter().skip(created.len()) {
                missing.push((*item, "the server gave no answer".to_owned()));
            }
            for ((item, node), created) in chunk.iter().zip(created) {
                let result = created.result;
                if result.status_code.is_bad() {
                    missing.push((*item, words(result.status_code)));
                    continue;
                }
                let (ms, queue) = granted.unwrap_or((0.0, u32::MAX));
                granted = Some((
                    ms.max(result.revised_sampling_interval),
                    queue.min(result.revised_queue_size),
                ));
                self.nodes.push((*item, node.clone()));
            }
        }
        Ok(granted)
    }

    /// What the server says of the units of the numbers; one that does not let itself be asked says nothing.
    async fn units(&self) -> Vec<(usize, ShownUnit)> {
        let mapping = &self.settings.mapping;
        let has_unit = |item: usize| {
            let item = self.settings.items.get(item);
            item.is_some_and(|item| mapping.unit(&item.key).is_some())
        };
        let numbers = self.nodes.iter().filter(|(item, _)| has_unit(*item));
        let numbers: Vec<_> = numbers.cloned().collect();
        nodes::units(&self.session, &numbers)
            .await
            .unwrap_or_default()
    }

    fn request(&self, item: usize, node: &NodeId) -> MonitoredItemCreateRequest {
        let wanted = &self.settings.subscription;
        MonitoredItemCreateRequest {
            item_to_monitor: ReadValueId::from(node.clone()),
            monitoring_mode: MonitoringMode::Reporting,
            requested_parameters: MonitoringParameters {
                // 0 would be replaced by the client.
                client_handle: u32::try_from(item + 1).unwrap_or(u32::MAX),
                sampling_interval: f64::from(wanted.sampling_ms),
                queue_size: wanted.queue,
                discard_oldest: true,
                ..MonitoringParameters::default()
            },
        }
    }

    /// Hands over what comes until the end.
    async fn go_on(&mut self, link: &mut Receiver<Link>) -> IoEvent {
        let mut broken_at: Option<Instant> = None;
        loop {
            let ended = tokio::select! {
                note = self.notes.recv() => match note {
                    Some(note) => self.take(note).await,
                    None => Some(said("the subscription ended")),
                },
                news = link.recv() => match news {
                    Some(Link::Lost(status)) => {
                        broken_at = broken_at.or_else(|| Some(Instant::now()));
                        let reason = words(status);
                        self.send(IoEvent::Broken { reason })
                    }
                    Some(Link::NotMade(status)) => {
                        let since = broken_at.get_or_insert_with(Instant::now).elapsed();
                        let is_over = since > duration(self.settings.session);
                        is_over.then(|| said(&words(status)))
                    }
                    Some(Link::Made(SessionConnectMode::ReactivatedSession(_))) => {
                        broken_at = None;
                        self.resume().await
                    }
                    Some(Link::Made(SessionConnectMode::NewSession(_))) => {
                        Some(said("the server does not know the session any more: it has begun anew, or kept it too short"))
                    }
                    Some(Link::Ended(status)) => Some(said(&words(status))),
                    None => Some(said("closed")),
                },
            };
            if let Some(ended) = ended {
                return ended;
            }
        }
    }

    /// Hands an event over; the end where nobody listens.
    fn send(&self, event: IoEvent) -> Option<IoEvent> {
        let is_heard = self.events.send(host_now(), event);
        (!is_heard).then(|| said("nobody listens"))
    }

    /// Takes a message; what is missing before it is asked for again first.
    async fn take(&mut self, (at, message): Note) -> Option<IoEvent> {
        let dropped = self.dropped.swap(0, Ordering::Relaxed);
        if dropped > 0
            && let Some(ended) = self.send(IoEvent::Dropped { count: dropped })
        {
            return Some(ended);
        }
        let data = message.notification_data.as_ref();
        let has_data = data.is_some_and(|data| !data.is_empty());
        match self.sequence.take(message.sequence_number, has_data) {
            Place::Known => return None,
            Place::Next => {}
            Place::Behind { from, count } => {
                if let Some(ended) = self.fetch(from, count).await {
                    return Some(ended);
                }
            }
        }
        if let Some(ended) = self.hand_over(at, message) {
            return Some(ended);
        }
        self.catch_up().await
    }

    /// Reads every node once what waits is handed over, where messages were lost: what changed in them alone comes by nothing
    /// else. A server that does not answer now is asked again after its next message.
    async fn catch_up(&mut self) -> Option<IoEvent> {
        if !self.has_lost || !self.notes.is_empty() {
            return None;
        }
        match self.read_again(|is_as_sent| !is_as_sent).await {
            Ok(ended) => {
                self.has_lost = false;
                ended
            }
            Err(_) => None,
        }
    }

    /// Asks for messages again, and reports which are gone.
    async fn fetch(&mut self, from: u32, count: u32) -> Option<IoEvent> {
        let mut lost = 0_u64;
        for behind in 0..count {
            if lost >= REPUBLISHED {
                // The server keeps none of them: the rest is not asked for.
                lost += u64::from(count - behind);
                break;
            }
            let number = from.wrapping_add(behind);
            match self.session.republish(self.subscription, number).await {
                Ok(message) if message.sequence_number == number => {
                    if let Some(ended) = self.hand_over(host_now(), message) {
                        return Some(ended);
                    }
                }
                // Some servers send another message, without changes, in place of one that they do not keep.
                Ok(_) | Err(_) => lost += 1,
            }
        }
        if lost == 0 {
            return None;
        }
        self.has_lost = true;
        self.send(IoEvent::Lost { from, count: lost })
    }

    /// The session was taken up again: what was missed is asked for, then what holds is read.
    async fn resume(&mut self) -> Option<IoEvent> {
        let mut republished = 0;
        while republished < REPUBLISHED {
            let number = self.sequence.expected();
            match self.session.republish(self.subscription, number).await {
                Ok(message) if message.sequence_number != number => break,
                Ok(message) => {
                    self.sequence.take(number, true);
                    republished += 1;
                    if let Some(ended) = self.hand_over(host_now(), message) {
                        return Some(ended);
                    }
                }
                Err(error) if error.status() == StatusCode::BadMessageNotAvailable => break,
                Err(error) => return Some(ended(error)),
            }
        }
        // The client asks for no message after a break before this command.
        self.session.trigger_publish_now();
        if let Some(ended) = self.send(IoEvent::Resumed { republished }) {
            return Some(ended);
        }
        // What is another than was sent last waits in the subscription, and comes in its order.
        let read = self.read_again(|is_as_sent| is_as_sent).await;
        read.unwrap_or_else(|error| Some(ended(error)))
    }

    /// Reads every node, and hands those over that are as they were sent last, or those that are not; the end where nobody
    /// listens.
    async fn read_again(&mut self, is_wanted: fn(bool) -> bool) -> Result<Option<IoEvent>, Error> {
        for begin in (0..self.nodes.len()).step_by(NODES_CHUNK) {
            let end = (begin + NODES_CHUNK).min(self.nodes.len());
            let values = self.read(&self.nodes[begin..end]).await?;
            let items = self.nodes[begin..end].iter().map(|(item, _)| *item);
            let held = items
                .zip(values)
                .map(|(item, value)| change(item, value, true));
            let mut wanted: Vec<Change> = Vec::new();
            for change in held {
                let mark = mark(&change);
                if is_wanted(self.sent.get(&change.item) == Some(&mark)) {
                    self.sent.insert(change.item, mark);
                    wanted.push(change);
                }
            }
            if let Some(ended) = self.send(IoEvent::Changed(wanted)) {
                return Ok(Some(ended));
            }
        }
        Ok(None)
    }

    /// Values of some nodes. Where the answer is too long they are read one by one, and a value that is too long by itself is
    /// absent with that status.
    async fn read(&self, nodes: &[(usize, NodeId)]) -> Result<Vec<DataValue>, Error> {
        let asked = |(_, node): &(usize, NodeId)| ReadValueId::from(node.clone());
        let all: Vec<ReadValueId> = nodes.iter().map(asked).collect();
        let read = self.session.read(&all, TimestampsToReturn::Both, 0.0);
        match read.await {
            Err(error) if is_too_long(error.status()) => {}
            read => return read,
        }
        let mut values = Vec::with_capacity(nodes.len());
        for one in all.chunks(1) {
            let read = self.session.read(one, TimestampsToReturn::Both, 0.0);
            match read.await {
                Ok(read) => values.push(read.into_iter().next().unwrap_or_default()),
                Err(error) if is_too_long(error.status()) => values.push(DataValue {
                    status: Some(error.status()),
                    ..DataValue::default()
                }),
                Err(error) => return Err(error),
            }
        }
        Ok(values)
    }

    /// Hands the changes of a message over.
    fn hand_over(&mut self, at: Stamp<Host>, message: NotificationMessage) -> Option<IoEvent> {
        let mut changes: Vec<Change> = Vec::new();
        for data in message.notification_data.into_iter().flatten() {
            if let Some(status) = data.inner_as::<StatusChangeNotification>() {
                return Some(said(&format!(
                    "the server ended the subscription: {}",
                    words(status.status)
                )));
            }
            let Some(data) = data.into_inner_as::<DataChangeNotification>() else {
                continue;
            };
            for one in data.monitored_items.into_iter().flatten() {
                // A handle that was not given out is one behind all items: the stage counts it.
                let item = usize::try_from(one.client_handle).unwrap_or(usize::MAX);
                let item = item.checked_sub(1).unwrap_or(usize::MAX);
                let change = change(item, one.value, false);
                if item < self.settings.items.len() {
                    self.sent.insert(item, mark(&change));
                }
                changes.push(change);
            }
        }
        if changes.is_empty() {
            return None;
        }
        let is_heard = self.events.send(at, IoEvent::Changed(changes));
        (!is_heard).then(|| said("nobody listens"))
    }
}
