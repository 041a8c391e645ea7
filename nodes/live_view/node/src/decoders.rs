//! Decodes the messages of each topic to inputs of the page.

use abbe_msgs::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus};
use abbe_msgs::msg::MachineValue;
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Wire, WireError, from_cdr};
use live_view::{Condition, Input};

/// Decodes a message.
type Decode = fn(&[u8]) -> Result<Vec<Input>, WireError>;

/// A subscribed topic.
pub(crate) struct Decoder {
    /// Its relative name, or the absolute one of `/diagnostics`.
    pub topic: &'static str,
    /// Whether every message counts, rather than the latest alone.
    pub is_each: bool,
    pub decode: Decode,
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

/// Separator of node and condition in a status.
const OF_NODE: &str = ": ";

fn diagnostics(bytes: &[u8]) -> Result<Vec<Input>, WireError> {
    let message: DiagnosticArray = from_cdr(bytes)?;
    let input = |status: DiagnosticStatus| {
        // Each node of the suite reports its own state first, without a condition.
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

/// A topic with the decoder of its messages.
macro_rules! decoder {
    ($topic:ident, $input:expr, is_each: $is_each:literal) => {
        Decoder {
            topic: topics::$topic.name,
            is_each: $is_each,
            decode: |bytes| one(&topics::$topic, bytes, $input),
        }
    };
}

/// Topics with one name.
pub(crate) const DECODERS: &[Decoder] = &[
    decoder!(AXES_STATE, Input::Axes, is_each: false),
    decoder!(COMPENSATION, Input::Offsets, is_each: false),
    decoder!(PLAN_STATUS, Input::Plan, is_each: true),
    decoder!(TEST_SEGMENT, Input::Test, is_each: false),
    decoder!(THERMAL_MODEL, |model| Input::Drift(Box::new(model)), is_each: false),
    decoder!(PROBE_POINT, Input::Touch, is_each: true),
    decoder!(LATENCY, Input::Latency, is_each: false),
    decoder!(GEOMETRY_MODEL, Input::Geometry, is_each: false),
    decoder!(GEOMETRY_ROTARY, Input::Rotary, is_each: false),
    decoder!(POSITIONING_TABLE, Input::Positioning, is_each: true),
    decoder!(GAP_REPORT, Input::Gap, is_each: false),
    Decoder {
        topic: topics::DIAGNOSTICS.name,
        is_each: true,
        decode: diagnostics,
    },
];

/// Topics with a member's name at their end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    Temperature,
    Machine,
}

impl Family {
    /// Prefix of its members.
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

    /// Decodes a member's message; its name is that of the topic, since a frame has the namespace in front.
    pub fn decode(self, member: &str, bytes: &[u8]) -> Result<Vec<Input>, WireError> {
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
