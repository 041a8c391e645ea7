//! The Zenoh backend: the wire of `rmw_zenoh_cpp`, and the only modules that know Zenoh.
//!
//! One session per process, as one context of ROS has; nodes are numbered in it. The ROS graph is made of
//! liveliness tokens ([`token`]); topics are keys, services are queries. Endpoints are Zenoh's own with
//! serialised samples in and out: ros2-client 0.12.1 knows type hashes of its own types only, has no
//! cache for those who come late, and cannot wait.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ::zenoh::Wait as _;
use ::zenoh::liveliness::LivelinessToken;
use abbe_msgs::{Qos, Release};
use anyhow::anyhow;

use crate::environment::Environment;
use crate::names::{self, NodeNames};
use crate::network::{Remote, Role, own_hash};

mod attachment;
mod endpoint;
mod graph;
mod order;
mod query;
mod recovery;
mod session;
mod settings;
mod token;

pub(crate) use endpoint::{Reader, Writer};

use session::Shared;
use token::{End, Kind, NodeId};

/// Requests and replies.
const SERVICE_QOS: Qos = Qos::RELIABLE;

/// Whether somebody's key is that of an end or a node of ROS, or of a writer's heartbeat.
pub(crate) fn is_read(key: &str) -> bool {
    token::parse(key).is_some() || recovery::writer_of(key).is_some()
}

/// Whether bytes are what is attached to a sample.
pub(crate) fn is_attachment(bytes: &[u8]) -> bool {
    let read = attachment::Attachment::read(bytes);
    read.is_some_and(|attachment| attachment.bytes() == bytes)
}

/// Tokens that wait for the node's announcement, and those that everybody sees.
#[derive(Default)]
struct Tokens {
    waiting: Vec<String>,
    shown: Vec<LivelinessToken>,
}

/// A node's place on the network.
pub(crate) struct Participant {
    shared: Arc<Shared>,
    id: NodeId,
    next_end: AtomicU64,
    tokens: Mutex<Tokens>,
    waits_for_room: bool,
    release: Release,
}

impl Participant {
    /// Joins the network as `names`; nobody sees the node before [`Self::announce`]. A warning comes
    /// with it where there is no router.
    pub fn join(
        environment: &Environment,
        names: &NodeNames,
    ) -> anyhow::Result<(Self, Option<String>)> {
        let (shared, warning) = Shared::of(environment)?;
        let node = shared.next_node.fetch_add(1, Ordering::Relaxed);
        let id = NodeId {
            session: shared.session.zid().to_string(),
            node,
            namespace: names.namespace.clone(),
            name: names.name.clone(),
        };
        let tokens = Tokens {
            waiting: vec![token::of_node(shared.domain, &id)],
            shown: Vec::new(),
        };
        let joined = Self {
            shared,
            id,
            next_end: AtomicU64::new(0),
            tokens: Mutex::new(tokens),
            waits_for_room: false,
            release: environment.release,
        };
        Ok((joined, warning))
    }

    pub fn wait_for_room(&mut self) {
        self.waits_for_room = true;
    }

    /// The hash of a type: ours, else as somebody on the network tells it.
    fn hash(&self, name: &str, dds_type: &str) -> Option<String> {
        match own_hash(self.release, dds_type) {
            Some(hash) => Some(hash.to_owned()),
            None => self.shared.graph.hash_of(name, dds_type),
        }
    }

    /// Makes an end and keeps its token until the node is announced.
    fn end(&self, kind: Kind, name: &str, dds_type: &str, qos: Qos) -> (End, String) {
        let end = End {
            kind,
            name: name.to_owned(),
            dds_type: dds_type.to_owned(),
            hash: self.hash(name, dds_type),
            qos,
        };
        // The node itself has the number 0 nowhere: an end's begin above it.
        let number = self.next_end.fetch_add(1, Ordering::Relaxed) + 1;
        let token = token::of_end(self.shared.domain, &self.id, number, &end);
        self.tokens().waiting.push(token.clone());
        (end, token)
    }

    fn tokens(&self) -> std::sync::MutexGuard<'_, Tokens> {
        self.tokens.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The key on which an end sends.
    fn sending_key(&self, end: &End) -> String {
        let hash = token::sent_hash(end.hash.as_deref());
        token::key(self.shared.domain, &end.name, &end.dds_type, Some(hash))
    }

    /// A writer of serialised samples.
    pub fn writer(&self, topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Writer> {
        let (end, token) = self.end(Kind::Publisher, topic, dds_type, qos);
        let key = self.sending_key(&end);
        let made = endpoint::publisher(&self.shared.session, key, &token, qos, self.waits_for_room);
        made.map_err(|error| anyhow!("Zenoh publisher of {topic}: {error}"))
    }

    /// A reader of serialised samples.
    pub fn reader(&self, topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Reader> {
        let (end, _) = self.end(Kind::Subscription, topic, dds_type, qos);
        let hash = end.hash.as_deref();
        let key = token::key(self.shared.domain, topic, dds_type, hash);
        let made = endpoint::subscriber(&self.shared.session, key, qos);
        made.map_err(|error| anyhow!("Zenoh subscriber of {topic}: {error}"))
    }

    /// Both ends of a service's server: of requests, of replies.
    pub fn server(&self, service: &str, type_name: &str) -> anyhow::Result<(Reader, Writer)> {
        let dds_type = names::dds_type(type_name);
        let (end, token) = self.end(Kind::Server, service, &dds_type, SERVICE_QOS);
        let made = query::server(&self.shared.session, &self.sending_key(&end), &token);
        made.map_err(|error| anyhow!("Zenoh queryable of {service}: {error}"))
    }

    /// Both ends of a service's client: of replies, of requests.
    pub fn client(&self, service: &str, type_name: &str) -> anyhow::Result<(Reader, Writer)> {
        let dds_type = names::dds_type(type_name);
        let (end, token) = self.end(Kind::Client, service, &dds_type, SERVICE_QOS);
        let key = self.sending_key(&end);
        Ok(query::client(&self.shared.session, key, &token))
    }

    /// Shows the node on the ROS graph, with the ends that it has by now.
    pub fn announce(&self) -> anyhow::Result<()> {
        let mut tokens = self.tokens();
        let Tokens { waiting, shown } = &mut *tokens;
        for token in waiting.drain(..) {
            let liveliness = self.shared.session.liveliness();
            let declared = liveliness.declare_token(&token).wait();
            shown.push(declared.map_err(|error| anyhow!("Zenoh token {token}: {error}"))?);
        }
        Ok(())
    }

    /// Takes the node off the ROS graph.
    pub fn withdraw(&self) -> anyhow::Result<()> {
        let shown = std::mem::take(&mut self.tokens().shown);
        // Ends first: an end without its node is an oddity, a node without ends is none.
        for token in shown.into_iter().rev() {
            let undeclared = token.undeclare().wait();
            undeclared.map_err(|error| anyhow!("Zenoh token: {error}"))?;
        }
        Ok(())
    }

    /// Whether somebody else has a node of our name.
    pub fn namesake(&self) -> bool {
        self.shared.graph.has_namesake(&self.id)
    }

    /// Everybody's writers, ours included.
    pub fn writers(&self) -> Vec<Remote> {
        self.shared.graph.ends(|kind| match kind {
            Kind::Publisher => Some(Role::Message),
            Kind::Client => Some(Role::Request),
            Kind::Server => Some(Role::Reply),
            Kind::Node | Kind::Subscription => None,
        })
    }

    /// Everybody's readers, ours included.
    pub fn readers(&self) -> Vec<Remote> {
        self.shared.graph.ends(|kind| match kind {
            Kind::Subscription => Some(Role::Message),
            Kind::Server => Some(Role::Request),
            Kind::Client => Some(Role::Reply),
            Kind::Node | Kind::Publisher => None,
        })
    }
}
