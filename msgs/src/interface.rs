//! What every message, service and action says about itself.

use std::fmt::Debug;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A ROS 2 message.
pub trait Message:
    Clone + Debug + Default + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static
{
    /// `package/kind/Name`, such as `abbe_msgs/msg/AxisState`.
    const TYPE_NAME: &'static str;
    /// The RIHS01 hash of the type, as ROS 2 Jazzy computes it.
    const TYPE_HASH: &'static str;
    /// The `ros2msg` schema text: the definition and those of all types that it holds.
    const DEFINITION: &'static str;

    /// The three constants as values.
    const DESCRIPTION: Description = Description {
        type_name: Self::TYPE_NAME,
        type_hash: Self::TYPE_HASH,
        definition: Self::DEFINITION,
    };
}

/// Name, hash and schema text of a message type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// `package/kind/Name`.
    pub type_name: &'static str,
    /// The RIHS01 hash.
    pub type_hash: &'static str,
    /// The `ros2msg` schema text.
    pub definition: &'static str,
}

/// What is known of the message type `package/kind/Name`; `None`: none of this crate.
#[must_use]
pub fn description_of(type_name: &str) -> Option<&'static Description> {
    crate::DESCRIPTIONS
        .binary_search_by(|description| description.type_name.cmp(type_name))
        .ok()
        .map(|idx| &crate::DESCRIPTIONS[idx])
}

/// What is known of a type by its parts: a message, a service or an action, or what ROS 2 derives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TypeParts {
    /// `package/kind/Name`.
    pub type_name: &'static str,
    /// The RIHS01 hash.
    pub type_hash: &'static str,
    /// Fields in order.
    pub fields: &'static [FieldParts],
    /// Every type that it refers to, directly or not, sorted by name.
    pub referenced: &'static [&'static str],
    /// `msg`, `srv` or `action` and the file's text; `implicit` and none for what is part of another's.
    pub source: (&'static str, &'static str),
}

/// A field as `type_description_interfaces/Field` has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldParts {
    /// Its name.
    pub name: &'static str,
    /// Number in `type_description_interfaces/FieldType`.
    pub type_id: u8,
    /// Length of an array or limit of a sequence; 0: neither.
    pub capacity: u64,
    /// Limit of a string; 0: none.
    pub string_capacity: u64,
    /// The type that it holds; empty: a basic one.
    pub nested: &'static str,
    /// Its default as the file has it; empty: none.
    pub default: &'static str,
}

/// The parts of the type `package/kind/Name`; `None`: none of this crate.
#[must_use]
pub fn parts_of(type_name: &str) -> Option<&'static TypeParts> {
    crate::TYPE_PARTS
        .binary_search_by(|parts| parts.type_name.cmp(type_name))
        .ok()
        .map(|idx| &crate::TYPE_PARTS[idx])
}

/// A ROS 2 service.
pub trait Service: Clone + Copy + Debug + Default + PartialEq + Send + Sync + 'static {
    /// What the client sends.
    type Request: Message;
    /// What the server answers.
    type Response: Message;
    /// `package/kind/Name`, such as `std_srvs/srv/SetBool`.
    const TYPE_NAME: &'static str;
    /// The RIHS01 hash of the whole service.
    const TYPE_HASH: &'static str;
    /// The message on `<service>/_service_event`: [`crate::ServiceEvent`].
    const EVENT: Description;
}

/// A ROS 2 action.
///
/// [`crate::SendGoal`], [`crate::GetResult`] and [`crate::FeedbackMessage`] are what ROS 2 derives
/// from it; cancelling and status use `action_msgs`.
pub trait Action: Clone + Copy + Debug + Default + PartialEq + Send + Sync + 'static {
    /// What is wanted.
    type Goal: Message;
    /// What came of it.
    type Result: Message;
    /// How far it is.
    type Feedback: Message;
    /// `package/action/Name`, such as `abbe_msgs/action/RunProgram`.
    const TYPE_NAME: &'static str;
    /// The RIHS01 hash of the whole action.
    const TYPE_HASH: &'static str;
    /// The service `<action>/_action/send_goal`.
    const SEND_GOAL: Description;
    /// Its request.
    const SEND_GOAL_REQUEST: Description;
    /// Its response.
    const SEND_GOAL_RESPONSE: Description;
    /// Its event.
    const SEND_GOAL_EVENT: Description;
    /// The service `<action>/_action/get_result`.
    const GET_RESULT: Description;
    /// Its request.
    const GET_RESULT_REQUEST: Description;
    /// Its response.
    const GET_RESULT_RESPONSE: Description;
    /// Its event.
    const GET_RESULT_EVENT: Description;
    /// The message on `<action>/_action/feedback`.
    const FEEDBACK_MESSAGE: Description;
}
