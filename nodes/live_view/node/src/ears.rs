//! From the bytes of each topic to what the page takes.

use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use abbe_msgs::msg::MachineValue;
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Wire, WireError, from_cdr};
use live_view::{Condition, Input};

/// What a message says.
type Hear = fn(&[u8]) -> Result<Vec<Input>, WireError>;

/// A topic that is listened to.
pub(crate) struct Ear {
    /// Its relative name, or the absolute one of `/diagnostics`.
    pub topic: &'static str,
    /// Whether every message counts, rather than the latest alone.
    pub is_each: bool,
    pub hear: Hear,
}

/// One message as one input.
fn one<M: Wire>(
    _: &Topic<M>,
    bytes: &[u8],
    input: fn(M::Inner) -> Input,
) -> Result<Vec<Input>, WireError> {
    let message: M = from_cdr(bytes)?;
    Ok(vec![input(message.into_inner()?)])
}

/// What stands between a node's name and a condition's in a status.
const OF_NODE: &str = ": ";

fn diagnostics(bytes: &[u8]) -> Result<Vec<Input>, WireError> {
    let message: DiagnosticArray = from_cdr(bytes)?;
    let input = |status: DiagnosticStatus| {
        // Each node of the suite says its own state first, without a condition.
        let is_node = status.name.starts_with('/') && !status.name.contains(OF_NODE);
        if is_node {
            return Input::Node(status.name);
        }
        Input::Condition(Condition {
            name: status.name,
            level: status.level,
            message: status.message,
        })
    };
    Ok(message.status.into_iter().map(input).collect())
}

/// A topic whose latest message is enough.
const fn latest(topic: &'static str, hear: Hear) -> Ear {
    Ear {
        topic,
        is_each: false,
        hear,
    }
}

/// A topic of which every message counts.
const fn each(topic: &'static str, hear: Hear) -> Ear {
    Ear {
        topic,
        is_each: true,
        hear,
    }
}

/// Every topic but the families.
pub(crate) const EARS: &[Ear] = &[
    latest(topics::AXES_STATE.name, |bytes| {
        one(&topics::AXES_STATE, bytes, Input::Axes)
    }),
    latest(topics::COMPENSATION.name, |bytes| {
        one(&topics::COMPENSATION, bytes, Input::Offsets)
    }),
    each(topics::PLAN_STATUS.name, |bytes| {
        one(&topics::PLAN_STATUS, bytes, Input::Plan)
    }),
    latest(topics::TEST_SEGMENT.name, |bytes| {
        one(&topics::TEST_SEGMENT, bytes, Input::Test)
    }),
    latest(topics::THERMAL_MODEL.name, |bytes| {
        one(&topics::THERMAL_MODEL, bytes, |model| {
            Input::Drift(Box::new(model))
        })
    }),
    each(topics::PROBE_POINT.name, |bytes| {
        one(&topics::PROBE_POINT, bytes, Input::Touch)
    }),
    latest(topics::LATENCY.name, |bytes| {
        one(&topics::LATENCY, bytes, Input::Latency)
    }),
    latest(topics::GEOMETRY_MODEL.name, |bytes| {
        one(&topics::GEOMETRY_MODEL, bytes, Input::Geometry)
    }),
    latest(topics::GEOMETRY_ROTARY.name, |bytes| {
        one(&topics::GEOMETRY_ROTARY, bytes, Input::Rotary)
    }),
    each(topics::POSITIONING_TABLE.name, |bytes| {
        one(&topics::POSITIONING_TABLE, bytes, Input::Positioning)
    }),
    latest(topics::GAP_REPORT.name, |bytes| {
        one(&topics::GAP_REPORT, bytes, Input::Gap)
    }),
    each(topics::DIAGNOSTICS.name, diagnostics),
];

/// Messages of a family, by the name of their topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    Temperature,
    Machine,
}

impl Family {
    /// What stands before the names of its members.
    pub const fn base(self) -> &'static str {
        match self {
            Self::Temperature => topics::TEMPERATURE.base,
            Self::Machine => topics::MACHINE.base,
        }
    }

    /// The family of a topic by its relative name, with the member.
    pub fn of(topic: &str) -> Option<(Self, &str)> {
        let families = [Self::Temperature, Self::Machine].into_iter();
        let mut named =
            families.filter_map(|family| Some((family, topic.strip_prefix(family.base())?)));
        named.find(|(_, member)| !member.is_empty() && !member.contains('/'))
    }

    /// What a message of a member says; the topic's name counts, for a frame has a namespace in front.
    pub fn hear(self, member: &str, bytes: &[u8]) -> Result<Vec<Input>, WireError> {
        let input = match self {
            Self::Temperature => {
                let mut sample = from_cdr::<Temperature>(bytes)?.into_inner()?;
                member.clone_into(&mut sample.sensor);
                Input::Temperature(sample)
            }
            Self::Machine => {
                let mut value = from_cdr::<MachineValue>(bytes)?.into_inner()?;
                member.clone_into(&mut value.name);
                Input::Value(value)
            }
        };
        Ok(vec![input])
    }
}
