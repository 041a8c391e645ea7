//! A node as its runners see it: named ports, events in, emissions out, everything serialised.
//!
//! Shells never implement [`Node`]; they build one from a stage with [`crate::Wiring`]. Two runners
//! drive it: the live one on DDS ([`crate::run`]) and the deterministic one in simulated time
//! ([`crate::Harness`]). Neither the trait nor its types name DDS, so that a second middleware can
//! be added beside it.

use std::any::Any;
use std::sync::Arc;

use abbe_msgs::service_msgs::msg::ServiceEventInfo;
use abbe_msgs::{Defect, Description, Qos, Service, ServiceEvent, WireError, from_cdr, to_cdr};
use metrology::Author;
use metrology::stamp::{Host, Span, Stamp};

use crate::diagnostic::Diagnostic;
use crate::parameter::Parameter;

/// Serialised message: encapsulation header and CDR.
pub type Bytes = Arc<[u8]>;

/// A copy of all that a node holds beside its table; only a node of the same table can tell what it is.
pub type Saved = Box<dyn Any + Send>;

/// How long winding down may take unless a node says otherwise.
pub const STOP_TIMEOUT: Span = Span::from_nanos(5_000_000_000);

/// Names a goal between a node and its runner; unique per server or client port.
pub type GoalId = u64;

/// Names a request between a node and its runner; unique per service or client port.
pub type RequestId = u64;

/// A topic end: relative or absolute ROS name, type and quality of service.
#[derive(Clone, Debug, PartialEq)]
pub struct TopicPort {
    /// Name before remapping and namespace.
    pub topic: String,
    /// Type, e.g. `abbe_msgs/msg/AxisState`.
    pub type_name: &'static str,
    /// RIHS01 hash of the type.
    pub type_hash: &'static str,
    /// `ros2msg` text of the type and all that it uses.
    pub definition: &'static str,
    /// Quality of service.
    pub qos: Qos,
}

/// How the calls of a service are told on `<service>/_service_event`.
#[derive(Clone, Copy, Debug)]
pub struct ServiceEvents {
    /// The message.
    pub description: Description,
    /// Forms the message that a request was sent, out of the serialised request.
    pub sent: fn(ServiceEventInfo, &[u8]) -> Result<Bytes, WireError>,
    /// The serialised request in such a message; `None`: it tells of another step.
    pub request: fn(&[u8]) -> Result<Option<Bytes>, WireError>,
}

impl PartialEq for ServiceEvents {
    fn eq(&self, other: &Self) -> bool {
        self.description == other.description
    }
}

impl ServiceEvents {
    /// Of the calls of the service `V`.
    #[must_use]
    pub fn of<V: Service>() -> Self {
        Self {
            description: V::EVENT,
            sent: |info, request| {
                let request = vec![from_cdr(request)?];
                let event = ServiceEvent::<V> {
                    info,
                    request,
                    response: Vec::new(),
                };
                Ok(Arc::from(to_cdr(&event)))
            },
            request: |bytes| {
                let event: ServiceEvent<V> = from_cdr(bytes)?;
                let is_sent = event.info.event_type == ServiceEventInfo::REQUEST_SENT;
                let request = event.request.first().filter(|_| is_sent);
                Ok(request.map(|request| Arc::from(to_cdr(request))))
            },
        }
    }
}

/// A service end.
#[derive(Clone, Debug, PartialEq)]
pub struct ServicePort {
    /// Name before remapping and namespace.
    pub service: String,
    /// Type, e.g. `std_srvs/srv/SetBool`.
    pub type_name: &'static str,
    /// How its calls are told.
    pub events: ServiceEvents,
}

/// An action end.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionPort {
    /// Name before remapping and namespace.
    pub action: String,
    /// Type, e.g. `abbe_msgs/action/RunProgram`.
    pub type_name: &'static str,
}

/// Everything a node is connected by; events and emissions name ports by their place in these lists.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ports {
    /// Topics that it listens to.
    pub subscriptions: Vec<TopicPort>,
    /// Topics that it speaks on.
    pub publications: Vec<TopicPort>,
    /// Periods of its timers.
    pub timers: Vec<Span>,
    /// Services that it offers.
    pub services: Vec<ServicePort>,
    /// Services that it calls.
    pub clients: Vec<ServicePort>,
    /// Actions that it offers.
    pub action_servers: Vec<ActionPort>,
    /// Actions that it uses.
    pub action_clients: Vec<ActionPort>,
}

/// How a goal ended (the values of `action_msgs/msg/GoalStatus`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GoalStatus {
    /// It reached its end.
    Succeeded = 4,
    /// Its client called it off.
    Canceled = 5,
    /// It failed.
    Aborted = 6,
}

/// What a runner tells a node. `usize` fields are places in [`Ports`].
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "fields are named in the variant's sentence")]
pub enum Event<'a> {
    /// A message came.
    Message {
        subscription: usize,
        bytes: &'a [u8],
    },
    /// A timer is due.
    Timer { timer: usize },
    /// A service is called; answer with [`Emission::Respond`].
    Request {
        service: usize,
        id: RequestId,
        bytes: &'a [u8],
    },
    /// The answer to [`Emission::Call`]; `None`: no server answered in time.
    Response {
        client: usize,
        id: RequestId,
        bytes: Option<&'a [u8]>,
    },
    /// A goal is proposed; answer with [`Emission::AcceptGoal`] or [`Emission::RejectGoal`].
    Goal {
        server: usize,
        id: GoalId,
        bytes: &'a [u8],
    },
    /// The client calls a goal off; the node finishes it with [`GoalStatus::Canceled`] when it has stopped.
    Cancel { server: usize, id: GoalId },
    /// Whether a server took our goal; false also when no server answered in time.
    GoalAnswer {
        client: usize,
        id: GoalId,
        accepted: bool,
    },
    /// News of our goal.
    GoalFeedback {
        client: usize,
        id: GoalId,
        bytes: &'a [u8],
    },
    /// Our goal ended; `bytes` is the serialised response of `get_result` (status, result), absent when
    /// the server vanished.
    GoalResult {
        client: usize,
        id: GoalId,
        status: GoalStatus,
        bytes: Option<&'a [u8]>,
    },
    /// The process is asked to stop; the node winds down and says [`Emission::Stopped`].
    Shutdown,
}

/// What a node tells its runner. `usize` fields are places in [`Ports`].
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "fields are named in the variant's sentence")]
pub enum Emission {
    /// Publish a message.
    Publish { publication: usize, bytes: Bytes },
    /// Answer a request.
    Respond {
        service: usize,
        id: RequestId,
        bytes: Bytes,
    },
    /// Call a service.
    Call {
        client: usize,
        id: RequestId,
        bytes: Bytes,
    },
    /// Take a goal.
    AcceptGoal { server: usize, id: GoalId },
    /// Refuse a goal.
    RejectGoal { server: usize, id: GoalId },
    /// News of a goal.
    Feedback {
        server: usize,
        id: GoalId,
        bytes: Bytes,
    },
    /// A goal has ended; `bytes` is the serialised response of `get_result` (status, result), since
    /// only who knows the type can align a result behind its status.
    FinishGoal {
        server: usize,
        id: GoalId,
        status: GoalStatus,
        bytes: Bytes,
    },
    /// Propose a goal to a server.
    SendGoal {
        client: usize,
        id: GoalId,
        bytes: Bytes,
    },
    /// Call our goal off.
    CancelGoal { client: usize, id: GoalId },
    /// A condition for `/diagnostics`, the log and the bag.
    Diagnostic(Diagnostic),
    /// The answer to [`Event::Shutdown`]: nothing is left to do.
    Stopped,
}

/// An event that a node could not take: its input broke a contract. The node goes on.
#[derive(Debug, thiserror::Error)]
#[error("{node}: {port}: {reason}")]
pub struct NodeFault {
    /// Name of the node.
    pub node: String,
    /// Topic, service or action by name, or "timer".
    pub port: String,
    /// The error, with place, value and limit.
    pub reason: String,
    /// What is wrong with the bytes; none: the node does not take what they say.
    pub defect: Option<Defect>,
}

/// Why an event could not be taken.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Refusal {
    /// The error, with place, value and limit.
    pub reason: String,
    /// What is wrong with the bytes; none: the node does not take what they say.
    pub defect: Option<Defect>,
}

impl Refusal {
    /// By the node itself.
    pub fn by_node(error: impl ToString) -> Self {
        Self {
            reason: error.to_string(),
            defect: None,
        }
    }

    /// As the fault of a node and its port.
    pub fn fault(self, node: &str, port: &str) -> NodeFault {
        NodeFault {
            node: node.to_owned(),
            port: port.to_owned(),
            reason: self.reason,
            defect: self.defect,
        }
    }
}

impl From<WireError> for Refusal {
    fn from(error: WireError) -> Self {
        Self {
            defect: Some(error.defect()),
            reason: error.to_string(),
        }
    }
}

/// A node, ready to be driven by a runner.
pub trait Node: Send {
    /// ROS node name.
    fn name(&self) -> &str;

    /// What it is connected by.
    fn ports(&self) -> &Ports;

    /// Its parameters as resolved at the start; frozen from then on.
    fn parameters(&self) -> &[Parameter];

    /// How long it may take from [`Event::Shutdown`] to [`Emission::Stopped`]; it is stopped by force after that.
    fn patience(&self) -> Span {
        STOP_TIMEOUT
    }

    /// Whether it stops only when the others have, as a controller that others wind down through.
    fn stops_last(&self) -> bool {
        false
    }

    /// Whether it goes by its computer's clock as it is, and by the moment at which an event is handed to it: a node that
    /// compares clocks.
    fn keeps_own_time(&self) -> bool {
        false
    }

    /// The node is put on a live graph: real time passes while it computes. Told once, before any event; a node in the
    /// harness is never told.
    fn goes_live(&mut self) {}

    /// So many publishers of a subscription's topic are on the graph, looked at once a second. The harness, where
    /// everybody is known, never says it.
    fn sees_publishers(&mut self, _subscription: usize, _publishers: usize) {}

    /// A message of a subscription comes from this publisher, whether it can be read or not; this comes before the message. The
    /// harness, where each topic has one publisher, never sends it.
    fn hears_from(&mut self, _at: Stamp<Host>, _subscription: usize, _author: Author) {}

    /// Copies everything that what it will say depends on; `None`: it cannot, or not now.
    fn save(&self) -> Option<Saved> {
        None
    }

    /// Goes on from what a node of the same table saved, whatever happened to it before; false: that is no such copy.
    fn resume(&mut self, _saved: &Saved) -> bool {
        false
    }

    /// Handles one event that happened `at`.
    ///
    /// # Errors
    /// When the event breaks a contract; the node stays usable and the runner reports the fault.
    fn handle(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault>;
}
