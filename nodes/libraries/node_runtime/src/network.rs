//! The network as the runners see it, whichever middleware carries it.
//!
//! Names are ROS's, absolute. Types are in the form that DDS and Zenoh share, `pkg::msg::dds_::Name_`.
//! The middleware is chosen when a node joins ([`Environment::middleware`]) and known nowhere above this
//! module.

use abbe_msgs::{Conversion, Qos, Release};
use metrology::Stamp;
use metrology::stamp::Host;

use crate::dds;
use crate::environment::{Environment, Middleware};
use crate::names::{self, NodeNames};
use crate::node::Bytes;
#[cfg(feature = "zenoh")]
use crate::zenoh;

/// Names an endpoint.
pub(crate) type Guid = [u8; 16];

/// Names a request: its writer (or what the client calls so) and its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RequestIdentity {
    pub writer: Guid,
    pub sequence: i64,
}

/// A sample as it came.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub bytes: Bytes,
    pub writer: Guid,
    /// Counts the writer's samples from 1; a jump is a loss.
    pub sequence: i64,
    pub source: Option<Stamp<Host>>,
    pub received: Stamp<Host>,
    /// The request that is meant; in Cyclone DDS's mapping it stands in the payload instead.
    pub related: Option<RequestIdentity>,
}

/// Why a sample was not sent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum PublishError {
    #[error("encapsulation {found:02x?} is not little-endian plain CDR, 00 01")]
    Encapsulation { found: Vec<u8> },
    #[error("too many samples wait for an acknowledgement")]
    Full,
    #[error("{0}")]
    Broken(String),
}

impl PublishError {
    /// The reason in few words, the same for every sample of its kind.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Encapsulation { .. } => "no little-endian plain CDR",
            Self::Full => "too many samples wait for an acknowledgement",
            Self::Broken(_) => "the middleware did not take it",
        }
    }
}

const CDR_HEADER_LEN: usize = 4;
const CDR_LE: [u8; 2] = [0, 1];

/// Whether bytes can be sent: little-endian plain CDR behind its header.
pub(crate) fn check_encapsulation(bytes: &[u8]) -> Result<(), PublishError> {
    if bytes.get(..2) == Some(&CDR_LE) && bytes.len() >= CDR_HEADER_LEN {
        return Ok(());
    }
    let found = bytes.iter().take(2).copied().collect();
    Err(PublishError::Encapsulation { found })
}

/// What a reader or writer carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Messages of a topic.
    Message,
    /// Requests of a service: clients write them, its server reads them.
    Request,
    /// Replies of a service.
    Reply,
}

/// Somebody's reader or writer, as discovery describes it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Remote {
    pub guid: Guid,
    /// Full name of its node; of a process with several nodes all of them; empty where it is not known.
    pub node: String,
    pub role: Role,
    /// Of the topic or service.
    pub name: String,
    pub dds_type: String,
    /// Where the middleware tells it.
    pub type_hash: Option<String>,
    pub reliable: bool,
    pub latched: bool,
}

impl Remote {
    /// Whether this is an end of a topic or service.
    pub fn is_of(&self, role: Role, name: &str) -> bool {
        self.role == role && self.name == name
    }
}

/// A node's place on the network.
pub(crate) struct Participant {
    place: Place,
    release: Release,
}

/// The same by middleware.
enum Place {
    Dds(Box<dds::Participant>),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Participant),
}

/// Does the same with whichever middleware it is.
macro_rules! either {
    ($end:ident, $which:expr, $inner:ident => $work:expr) => {
        match $which {
            $end::Dds($inner) => $work,
            #[cfg(feature = "zenoh")]
            $end::Zenoh($inner) => $work,
        }
    };
}

impl Participant {
    /// Joins the network as `names`, inside a runtime; nobody sees the node before [`Self::announce`]. A warning comes
    /// with it where not everybody may be found.
    pub fn join(
        environment: &Environment,
        names: &NodeNames,
    ) -> anyhow::Result<(Self, Option<String>)> {
        let (place, warning) = match environment.middleware {
            Middleware::Dds => {
                let (joined, warning) = dds::Participant::join(environment, names)?;
                (Place::Dds(Box::new(joined)), warning)
            }
            #[cfg(feature = "zenoh")]
            Middleware::Zenoh => {
                let (joined, warning) = zenoh::Participant::join(environment, names)?;
                (Place::Zenoh(joined), warning)
            }
            #[cfg(not(feature = "zenoh"))]
            Middleware::Zenoh => return Err(crate::environment::EnvironmentError::NoZenoh.into()),
        };
        let release = environment.release;
        let warnings = warning
            .into_iter()
            .chain(environment.distribution_warning());
        let warnings: Vec<String> = warnings.collect();
        let warning = (!warnings.is_empty()).then(|| warnings.join("; "));
        Ok((Self { place, release }, warning))
    }

    /// Whose definitions of ROS's own messages the graph uses.
    pub const fn release(&self) -> Release {
        self.release
    }

    /// The type hash of one of Abbe's own types, as the graph writes it; none for any other type.
    pub fn own_hash(&self, dds_type: &str) -> Option<&'static str> {
        own_hash(self.release, dds_type)
    }

    /// Lets writers that are made from now on wait while the way out is full, instead of dropping: for
    /// who speaks from a thread of its own. On DDS nothing changes: there the caller waits for
    /// acknowledgements.
    pub fn wait_for_room(&mut self) {
        match &mut self.place {
            Place::Dds(_) => {}
            #[cfg(feature = "zenoh")]
            Place::Zenoh(participant) => participant.wait_for_room(),
        }
    }

    /// A writer of serialised samples by our definition of their type.
    pub fn writer(&self, topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Writer> {
        let ours = own_hash(Release::default(), dds_type);
        self.writer_of(topic, (dds_type, ours), qos)
    }

    /// A writer of serialised samples by the definition with a hash; they leave by that of the graph, where it is known.
    pub fn writer_of(
        &self,
        topic: &str,
        (dds_type, hash): (&str, Option<&str>),
        qos: Qos,
    ) -> anyhow::Result<Writer> {
        let end = match &self.place {
            Place::Dds(participant) => WriterEnd::Dds(participant.writer(topic, dds_type, qos)?),
            #[cfg(feature = "zenoh")]
            Place::Zenoh(participant) => {
                WriterEnd::Zenoh(participant.writer(topic, dds_type, qos)?)
            }
        };
        let type_name = names::ros_type(dds_type);
        let conversion = type_name
            .zip(hash)
            .and_then(|(name, hash)| self.release.conversion(&name, hash));
        Ok(Writer { end, conversion })
    }

    /// A reader of serialised samples.
    pub fn reader(&self, topic: &str, dds_type: &str, qos: Qos) -> anyhow::Result<Reader> {
        Ok(match &self.place {
            Place::Dds(participant) => {
                Reader::Dds(Box::new(participant.reader(topic, dds_type, qos)?))
            }
            #[cfg(feature = "zenoh")]
            Place::Zenoh(participant) => Reader::Zenoh(participant.reader(topic, dds_type, qos)?),
        })
    }

    /// Both ends of a service's server, for a type `pkg/srv/Name`: of requests, of replies.
    pub fn server(&self, service: &str, type_name: &str) -> anyhow::Result<(Reader, Writer)> {
        Ok(match &self.place {
            Place::Dds(participant) => {
                let (reader, writer) = participant.server(service, type_name)?;
                (
                    Reader::Dds(Box::new(reader)),
                    Writer::of(WriterEnd::Dds(writer)),
                )
            }
            #[cfg(feature = "zenoh")]
            Place::Zenoh(participant) => {
                let (reader, writer) = participant.server(service, type_name)?;
                (Reader::Zenoh(reader), Writer::of(WriterEnd::Zenoh(writer)))
            }
        })
    }

    /// Both ends of a service's client: of replies, of requests.
    pub fn client(&self, service: &str, type_name: &str) -> anyhow::Result<(Reader, Writer)> {
        Ok(match &self.place {
            Place::Dds(participant) => {
                let (reader, writer) = participant.client(service, type_name)?;
                (
                    Reader::Dds(Box::new(reader)),
                    Writer::of(WriterEnd::Dds(writer)),
                )
            }
            #[cfg(feature = "zenoh")]
            Place::Zenoh(participant) => {
                let (reader, writer) = participant.client(service, type_name)?;
                (Reader::Zenoh(reader), Writer::of(WriterEnd::Zenoh(writer)))
            }
        })
    }

    /// Whether a writer's answers reach the participant that an endpoint is of. Zenoh's go back the way of their
    /// question.
    pub fn reaches(&self, writer: &Writer, other: &Guid) -> bool {
        match (&self.place, &writer.end) {
            (Place::Dds(participant), WriterEnd::Dds(writer)) => participant.reaches(writer, other),
            #[cfg(feature = "zenoh")]
            _ => true,
        }
    }

    /// What is not heard once the clock was set back, until it shows again what it showed before.
    pub fn unheard_after_set_back(&self) -> Option<&'static str> {
        match &self.place {
            Place::Dds(_) => Some("samples of best effort and nodes that are new"),
            #[cfg(feature = "zenoh")]
            Place::Zenoh(_) => None,
        }
    }

    /// Shows the node with all its endpoints on the ROS graph.
    pub fn announce(&self) -> anyhow::Result<()> {
        either!(Place, &self.place, participant => participant.announce())
    }

    /// Takes the node off the ROS graph.
    pub fn withdraw(&self) -> anyhow::Result<()> {
        either!(Place, &self.place, participant => participant.withdraw())
    }

    /// Waits until everybody has the last news of the graph, as far as the middleware can tell.
    pub async fn graph_acknowledged(&self) {
        match &self.place {
            Place::Dds(participant) => participant.graph_acknowledged().await,
            #[cfg(feature = "zenoh")]
            Place::Zenoh(_) => {}
        }
    }

    /// Whether somebody else has announced a node of our name.
    pub fn namesake(&self) -> bool {
        either!(Place, &self.place, participant => participant.namesake())
    }

    /// Everybody's writers, ours included.
    pub fn writers(&self) -> Vec<Remote> {
        either!(Place, &self.place, participant => participant.writers())
    }

    /// Everybody's readers, ours included.
    pub fn readers(&self) -> Vec<Remote> {
        either!(Place, &self.place, participant => participant.readers())
    }
}

/// The hash of a type of ours by the definitions of a release.
pub(crate) fn own_hash(release: Release, dds_type: &str) -> Option<&'static str> {
    let type_name = names::ros_type(dds_type)?;
    release.parts_of(&type_name).map(|parts| parts.type_hash)
}

/// Reads one topic, or the requests or replies of one service.
pub(crate) enum Reader {
    Dds(Box<dds::Reader>),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Reader),
}

impl Reader {
    /// The next sample; an error is a sample that cannot be read.
    pub async fn next(&self) -> Result<Sample, String> {
        either!(Self, self, reader => reader.next().await)
    }
}

/// Writes one topic, or the requests or replies of one service. Writing never waits, unless
/// [`Participant::wait_for_room`] was asked for.
pub(crate) struct Writer {
    end: WriterEnd,
    /// Where the graph has another definition of the samples' type.
    conversion: Option<Conversion>,
}

/// The same by middleware.
enum WriterEnd {
    Dds(dds::Writer),
    #[cfg(feature = "zenoh")]
    Zenoh(zenoh::Writer),
}

impl Writer {
    const fn of(end: WriterEnd) -> Self {
        Self {
            end,
            conversion: None,
        }
    }

    pub fn guid(&self) -> Guid {
        either!(WriterEnd, &self.end, writer => writer.guid())
    }

    /// Whether the other end speaks Cyclone DDS's mapping of services.
    pub fn meets_cyclone(&self, other: &Guid) -> bool {
        match &self.end {
            WriterEnd::Dds(_) => dds::is_cyclone(other),
            #[cfg(feature = "zenoh")]
            WriterEnd::Zenoh(_) => false,
        }
    }

    /// Sends a sample; `source` is its own time where it has one, else the present.
    pub fn publish(&self, bytes: &Bytes, source: Option<Stamp<Host>>) -> Result<(), PublishError> {
        let converted = self.conversion.map(|convert| convert(bytes)).transpose();
        let converted = converted.map_err(|error| PublishError::Broken(error.to_string()))?;
        let converted: Option<Bytes> = converted.map(Bytes::from);
        let bytes = converted.as_ref().unwrap_or(bytes);
        either!(WriterEnd, &self.end, writer => writer.publish(bytes, source))
    }

    /// Sends a reply.
    pub fn reply(&self, bytes: &Bytes, to: RequestIdentity) -> Result<(), PublishError> {
        either!(WriterEnd, &self.end, writer => writer.reply(bytes, to))
    }

    /// Sends a request and says under which identity the reply will come.
    pub fn request(&self, bytes: &Bytes) -> Result<RequestIdentity, PublishError> {
        either!(WriterEnd, &self.end, writer => writer.request(bytes))
    }

    /// Waits until every reliable reader has everything that was sent; Zenoh cannot tell.
    pub async fn acknowledged(&self) {
        match &self.end {
            WriterEnd::Dds(writer) => writer.acknowledged().await,
            #[cfg(feature = "zenoh")]
            WriterEnd::Zenoh(_) => {}
        }
    }
}
