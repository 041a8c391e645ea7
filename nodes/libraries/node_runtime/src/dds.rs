//! The DDS backend: the only modules that know RustDDS and ros2-client.
//!
//! One participant per node. Endpoints are RustDDS's own with serialised samples in and out; they
//! are put into the ROS graph by our own `ros_discovery_info`, since ros2-client registers only
//! endpoints whose samples it decodes itself. What leaves this module is free of DDS types: Zenoh
//! stands beside it.

use std::collections::BTreeMap;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};

use abbe_msgs::{Qos, Reliability};
use anyhow::{Context as _, anyhow};
use ros2_client::builtin_topics::ros_discovery;
use ros2_client::entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo};
use ros2_client::{Gid, NodeName};
use rustdds::{
    CDRDeserializerAdapter, CDRSerializerAdapter, DomainParticipant, DomainParticipantBuilder,
    RTPSEntity, TopicKind, no_key,
};

use crate::environment::{self, DiscoveryRange, Environment};
use crate::names::{self, NodeNames};
use crate::network::{Guid, Remote, Role};
use absent::Absent;
use first_sample::FirstSamples;
use first_word::FirstWords;
use meetings::Meetings;
use peers::{Peers, Way};
use reply::LongReplies;

mod absent;
mod endpoint;
mod first_sample;
mod first_word;
mod meetings;
mod peers;
mod policies;
mod ports;
mod reply;
mod rtps;
mod user_data;

pub(crate) use endpoint::{Reader, Writer};

/// Requests and replies: reliable, volatile.
const SERVICE_QOS: Qos = Qos::RELIABLE;

type GraphWriter =
    no_key::DataWriter<ParticipantEntitiesInfo, CDRSerializerAdapter<ParticipantEntitiesInfo>>;
type GraphReader = no_key::SimpleDataReader<
    ParticipantEntitiesInfo,
    CDRDeserializerAdapter<ParticipantEntitiesInfo>,
>;

/// What makes a participant where `environment` says.
fn builder(environment: &Environment) -> DomainParticipantBuilder {
    let builder = DomainParticipantBuilder::new(environment.domain_id);
    match environment.range {
        DiscoveryRange::Subnet => builder,
        DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
    }
}

/// Gives a participant the credentials of its node; a warning where it goes without.
#[cfg(feature = "security")]
fn secured(
    builder: DomainParticipantBuilder,
    environment: &Environment,
    names: &NodeNames,
) -> anyhow::Result<(DomainParticipantBuilder, Option<String>)> {
    use rustdds::DomainParticipantSecurityConfigFiles;
    let Some(security) = &environment.security else {
        return Ok((builder, None));
    };
    match security.credentials(&names.fully_qualified()) {
        Ok(folder) => {
            let files =
                DomainParticipantSecurityConfigFiles::with_ros_default_names(folder, String::new());
            Ok((builder.builtin_security(files), None))
        }
        Err(missing) if security.enforced => Err(missing.into()),
        Err(missing) => Ok((builder, Some(format!("{missing}; goes unsecured")))),
    }
}

#[cfg(not(feature = "security"))]
fn secured(
    builder: DomainParticipantBuilder,
    environment: &Environment,
    _: &NodeNames,
) -> anyhow::Result<(DomainParticipantBuilder, Option<String>)> {
    if environment.security.is_some() {
        return Err(environment::EnvironmentError::NoSecurity.into());
    }
    Ok((builder, None))
}

pub(crate) const CYCLONE_VENDOR: [u8; 2] = [0x01, 0x10];

/// Whose endpoint it is: the vendor is in the first two bytes.
pub(crate) fn is_cyclone(guid: &Guid) -> bool {
    guid[..2] == CYCLONE_VENDOR
}

/// What a DDS topic carries and its name in ROS; `None` for what is not of ROS.
pub(crate) fn role_of(dds_topic: &str) -> Option<(Role, &str)> {
    let (role, rest) = match dds_topic.split_at_checked(2)? {
        ("rt", rest) => (Role::Message, rest),
        ("rq", rest) => (Role::Request, rest.strip_suffix("Request")?),
        ("rr", rest) => (Role::Reply, rest.strip_suffix("Reply")?),
        _ => return None,
    };
    rest.starts_with('/').then_some((role, rest))
}

/// What a node sends past the library.
struct ByHand {
    first_samples: FirstSamples,
    first_words: FirstWords,
    socket: Arc<UdpSocket>,
}

impl ByHand {
    /// Opens the socket and begins to listen for writers that were met.
    fn of(participant: &DomainParticipant) -> std::io::Result<(Self, Meetings)> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        socket.set_nonblocking(true)?;
        let socket = Arc::new(socket);
        let (first_samples, ask) = FirstSamples::of(participant, Arc::clone(&socket));
        let (first_words, tell) = FirstWords::of(participant, Arc::clone(&socket));
        let meetings = Meetings::of(participant, ask, tell);
        let by_hand = Self {
            first_samples,
            first_words,
            socket,
        };
        Ok((by_hand, meetings))
    }
}

/// What is done about other hosts, where there may be some.
struct Others {
    _absent: Option<Absent>,
    _peers: Option<Peers>,
}

/// Message where named hosts cannot be reached.
const UNREACHED: &str = "ROS_STATIC_PEERS is not followed: the graph is encrypted and no interface has the MULTICAST flag; \
    `ip link set DEVICE multicast on` cures it, also where the network carries none";

/// The way to the named hosts, and a warning of those without an address.
fn way_to_peers(
    environment: &Environment,
    interfaces: &[environment::Interface],
) -> anyhow::Result<(Option<Way>, Option<String>)> {
    let (hosts, unknown) = peers::resolve(environment.reachable_peers());
    let way = Way::to(&hosts, environment.domain_id, interfaces)
        .context("multicast, for ROS_STATIC_PEERS")?;
    let unfound = (!unknown.is_empty()).then(|| {
        let names = unknown.join(", ");
        format!("ROS_STATIC_PEERS: no IPv4 address of {names}; start again when the name is known")
    });
    Ok((way, unfound))
}

/// Participants whose nodes are kept by name.
const MOST_NEIGHBOURS: usize = 1_000;
/// Nodes of one participant that are named.
const MAX_NAMED_NODES: usize = 4;

/// A node's place on the network.
///
/// The participant comes last, so that it is dropped last: an endpoint that outlives it complains.
pub(crate) struct Participant {
    graph_writer: GraphWriter,
    graph_reader: GraphReader,
    publisher: rustdds::Publisher,
    subscriber: rustdds::Subscriber,
    node: NodeName,
    entities: Mutex<NodeEntitiesInfo>,
    /// Names of the nodes of other participants.
    neighbours: Mutex<BTreeMap<[u8; 12], String>>,
    /// What is sent past the library; nothing where packets are encrypted.
    by_hand: Option<ByHand>,
    meetings: Meetings,
    _others: Others,
    participant: DomainParticipant,
}

impl Participant {
    /// Joins the network as `names`, inside a runtime; nobody sees the node before [`Self::announce`]. A warning comes
    /// with it where not every node of this computer may be found.
    pub fn join(
        environment: &Environment,
        names: &NodeNames,
    ) -> anyhow::Result<(Self, Option<String>)> {
        let interfaces = environment::interfaces();
        environment.check_interfaces(&interfaces)?;
        let (_, unsecured) = secured(builder(environment), environment, names)?;
        let (way, unfound) = way_to_peers(environment, &interfaces)?;
        let participant = ports::with_its_port(|| {
            let (builder, _) = secured(builder(environment), environment, names)?;
            let domain = environment.domain_id;
            builder
                .build()
                .map_err(|error| anyhow!("DDS participant in domain {domain}: {error}"))
        })?;
        let hidden = environment.multicast_warning(&interfaces, participant.participant_id());
        let absent = (environment.range == DiscoveryRange::Subnet)
            .then(|| Absent::of(&participant, &interfaces))
            .transpose()
            .context("announcements of other hosts")?;
        let is_encrypted = environment.security.is_some() && unsecured.is_none();
        let is_unreached = is_encrypted && way.as_ref().is_some_and(Way::needs_stand_ins);
        let unreached = is_unreached.then(|| UNREACHED.to_owned());
        let peers = environment.peers_warning().or(unfound).or(unreached);
        let others = Others {
            _absent: absent,
            _peers: way.map(|way| way.reach(&participant)),
        };
        let warnings: Vec<String> = unsecured.into_iter().chain(hidden).chain(peers).collect();
        let warning = (!warnings.is_empty()).then(|| warnings.join("; "));
        let node = NodeName::new(&names.namespace, &names.name)
            .map_err(|error| anyhow!("node {}: {error:?}", names.fully_qualified()))?;
        Ok((
            Self::of(participant, others, node, is_encrypted).context("ROS graph on DDS")?,
            warning,
        ))
    }

    fn of(
        participant: DomainParticipant,
        others: Others,
        node: NodeName,
        is_encrypted: bool,
    ) -> anyhow::Result<Self> {
        let default = policies::policies(Qos::RELIABLE, policies::Side::Reader);
        let publisher = participant.create_publisher(&default)?;
        let subscriber = participant.create_subscriber(&default)?;
        let topic = participant.create_topic(
            ros_discovery::TOPIC_NAME.to_owned(),
            ros_discovery::TYPE_NAME.to_owned(),
            &ros_discovery::QOS_PUB,
            TopicKind::NoKey,
        )?;
        let graph_writer =
            publisher.create_datawriter_no_key(&topic, Some(ros_discovery::QOS_PUB.clone()))?;
        // ros2-client reads it volatile with depth 1: it misses nodes that a Cyclone participant
        // announced earlier, and all but the last 64 of a large graph.
        let graph_reader =
            subscriber.create_simple_datareader_no_key(&topic, Some(policies::graph_reader()))?;
        let entities = Mutex::new(NodeEntitiesInfo::new(node.clone()));
        let (by_hand, meetings) = if is_encrypted {
            (None, Meetings::of(&participant, |_, _| {}, |_, _| {}))
        } else {
            let (by_hand, meetings) = ByHand::of(&participant)?;
            (Some(by_hand), meetings)
        };
        Ok(Self {
            by_hand,
            meetings,
            _others: others,
            participant,
            publisher,
            subscriber,
            graph_writer,
            graph_reader,
            node,
            entities,
            neighbours: Mutex::default(),
        })
    }

    /// Whether a writer of ours sends to a reader of the participant that an endpoint is of.
    pub fn reaches(&self, writer: &Writer, other: &Guid) -> bool {
        self.meetings.reaches(writer.guid(), other)
    }

    fn topic(&self, name: &str, type_name: &str, qos: Qos) -> anyhow::Result<rustdds::Topic> {
        self.participant
            .create_topic(
                name.to_owned(),
                type_name.to_owned(),
                &policies::policies(qos, policies::Side::Reader),
                TopicKind::NoKey,
            )
            .map_err(|error| anyhow!("DDS topic {name}: {error}"))
    }

    /// A writer of serialised samples of a topic of ROS.
    pub fn writer(&self, topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Writer> {
        self.writer_of(&names::dds_topic(topic), dds_type, qos)
    }

    /// A reader of serialised samples of a topic of ROS.
    pub fn reader(&self, topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Reader> {
        self.reader_of(&names::dds_topic(topic), dds_type, qos)
    }

    /// Both ends of a service's server: of requests, of replies.
    pub fn server(&self, service: &str, type_name: &str) -> anyhow::Result<(Reader, Writer)> {
        let [(requests, request), (replies, reply)] = service_topics(service, type_name);
        let reader = self.reader_of(&requests, &request, SERVICE_QOS)?;
        let writer = self.writer_of(&replies, &reply, SERVICE_QOS)?;
        let Some(by_hand) = &self.by_hand else {
            return Ok((reader, writer));
        };
        let socket = Arc::clone(&by_hand.socket);
        let long_replies = LongReplies::new(socket, self.participant.clone(), replies);
        Ok((reader, writer.with_long_replies(long_replies)))
    }

    /// Both ends of a service's client: of replies, of requests.
    pub fn client(&self, service: &str, type_name: &str) -> anyhow::Result<(Reader, Writer)> {
        let [(requests, request), (replies, reply)] = service_topics(service, type_name);
        let writer = self.writer_of(&requests, &request, SERVICE_QOS)?;
        Ok((self.reader_of(&replies, &reply, SERVICE_QOS)?, writer))
    }

    fn writer_of(&self, dds_topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Writer> {
        let topic = self.topic(dds_topic, dds_type, qos)?;
        let policies = policies::policies(qos, policies::Side::Writer);
        let make = || {
            self.publisher
                .create_datawriter_no_key(&topic, Some(policies))
        };
        let made = match &self.by_hand {
            Some(by_hand) if qos.reliability == Reliability::Reliable => by_hand
                .first_words
                .take_care(make, |writer| writer.guid().to_bytes()),
            _ => make(),
        };
        let writer = made.map_err(|error| anyhow!("DDS writer of {dds_topic}: {error}"))?;
        self.entities().add_writer(Gid::from(writer.guid()));
        Ok(Writer::new(writer))
    }

    fn reader_of(&self, dds_topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Reader> {
        let topic = self.topic(dds_topic, dds_type, qos)?;
        let policies = policies::policies(qos, policies::Side::Reader);
        let make = || {
            self.subscriber
                .create_simple_datareader_no_key(&topic, Some(policies))
        };
        let made = match &self.by_hand {
            Some(by_hand) if qos.reliability == Reliability::Reliable => by_hand
                .first_samples
                .take_care(make, |reader| reader.guid().to_bytes()),
            _ => make(),
        };
        let reader = made.map_err(|error| anyhow!("DDS reader of {dds_topic}: {error}"))?;
        self.entities().add_reader(Gid::from(reader.guid()));
        Ok(Reader::new(reader))
    }

    fn entities(&self) -> std::sync::MutexGuard<'_, NodeEntitiesInfo> {
        self.entities.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows the node with all its endpoints on the ROS graph.
    pub fn announce(&self) -> anyhow::Result<()> {
        let nodes = vec![self.entities().clone()];
        self.publish_graph(nodes)
    }

    /// Takes the node off the ROS graph.
    pub fn withdraw(&self) -> anyhow::Result<()> {
        self.publish_graph(Vec::new())
    }

    fn publish_graph(&self, nodes: Vec<NodeEntitiesInfo>) -> anyhow::Result<()> {
        let info = ParticipantEntitiesInfo::new(Gid::from(self.participant.guid()), nodes);
        self.graph_writer
            .write(info, Some(rustdds::Timestamp::now()))
            .map_err(|error| anyhow!("ros_discovery_info: {error}"))
    }

    /// Waits until everybody has the last news of the graph.
    pub async fn graph_acknowledged(&self) {
        let _ = self.graph_writer.async_wait_for_acknowledgments().await;
    }

    /// Whether another participant has announced a node of our name since the last call.
    pub fn namesake(&self) -> bool {
        let mine = Gid::from(self.participant.guid());
        let wanted = self.node.fully_qualified_name();
        let mut found = false;
        loop {
            self.graph_reader.drain_read_notifications();
            match self.graph_reader.try_take_one() {
                Ok(Some(change)) => {
                    let info = change.into_value();
                    self.meet(&info);
                    found |= info.gid() != mine
                        && info
                            .nodes()
                            .iter()
                            .any(|node| node.fully_qualified_name() == wanted);
                }
                // A node whose name ros2-client refuses is no namesake of ours.
                Err(_) => {}
                Ok(None) => return found,
            }
        }
    }

    /// Keeps the names of a participant's nodes.
    fn meet(&self, info: &ParticipantEntitiesInfo) {
        let gid = info.gid();
        let Some(participant) = gid.as_bytes().first_chunk::<12>().copied() else {
            return;
        };
        let mut neighbours = self
            .neighbours
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        // Participants beyond this number are reported without a name.
        if neighbours.len() < MOST_NEIGHBOURS || neighbours.contains_key(&participant) {
            let names = info.nodes().iter().take(MAX_NAMED_NODES);
            let names: Vec<String> = names.map(NodeEntitiesInfo::fully_qualified_name).collect();
            neighbours.insert(participant, names.join(" or "));
        }
    }

    /// The node, or nodes, of an endpoint.
    fn node_of(&self, guid: [u8; 16]) -> String {
        let neighbours = self
            .neighbours
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let prefix = guid.first_chunk::<12>();
        let name = prefix.and_then(|prefix| neighbours.get(prefix));
        name.cloned().unwrap_or_default()
    }

    /// Everybody's writers, ours included.
    pub fn writers(&self) -> Vec<Remote> {
        let describe = |found: rustdds::discovery::DiscoveredWriterData| {
            let data = found.publication_topic_data;
            let (role, name) = role_of(&data.topic_name)?;
            Some(Remote {
                guid: data.key.to_bytes(),
                node: self.node_of(data.key.to_bytes()),
                role,
                name: name.to_owned(),
                dds_type: data.type_name.clone(),
                type_hash: user_data::type_hash(&found.user_data),
                reliable: policies::is_reliable(data.reliability),
                latched: policies::is_latched(data.durability),
            })
        };
        let all = self.participant.discovered_writers();
        all.into_iter().filter_map(describe).collect()
    }

    /// Everybody's readers, ours included.
    pub fn readers(&self) -> Vec<Remote> {
        let describe = |found: rustdds::discovery::DiscoveredReaderData| {
            let data = found.subscription_topic_data;
            let (role, name) = role_of(data.topic_name())?;
            let qos = data.qos();
            Some(Remote {
                guid: data.key().to_bytes(),
                node: self.node_of(data.key().to_bytes()),
                role,
                name: name.to_owned(),
                dds_type: data.type_name().clone(),
                type_hash: user_data::type_hash(&found.user_data),
                reliable: policies::is_reliable(qos.reliability()),
                latched: policies::is_latched(qos.durability()),
            })
        };
        let all = self.participant.discovered_readers();
        all.into_iter().filter_map(describe).collect()
    }
}

/// Whether USER_DATA of an endpoint holds the hash of its type.
pub(crate) fn has_type_hash(user_data: &[u8]) -> bool {
    user_data::type_hash(user_data).is_some()
}

/// Whether a datagram announces a participant, or that it takes its leave.
pub(crate) fn is_announcement(datagram: &[u8]) -> bool {
    rtps::announcement(datagram).is_some()
}

/// DDS topic and type of requests and of replies.
fn service_topics(service: &str, type_name: &str) -> [(String, String); 2] {
    [
        (
            names::dds_request_topic(service),
            names::dds_type(&format!("{type_name}_Request")),
        ),
        (
            names::dds_reply_topic(service),
            names::dds_type(&format!("{type_name}_Response")),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_dds_tell_what_they_carry() {
        let request = names::dds_request_topic("/cell/save");
        assert_eq!(role_of(&request), Some((Role::Request, "/cell/save")));
        let reply = names::dds_reply_topic("/cell/save");
        assert_eq!(role_of(&reply), Some((Role::Reply, "/cell/save")));
        assert_eq!(
            role_of("rt/axes/state"),
            Some((Role::Message, "/axes/state"))
        );
        for other in ["ros_discovery_info", "rtx", "rq/save", "é", ""] {
            assert_eq!(role_of(other), None, "{other}");
        }
    }
}
