//! Messages of ROS 2 that its releases define differently, and the way from one definition to the other.
//!
//! Nodes and simulated bags use the definitions of Jazzy. Only the network's edge knows the release of the graph.

use metrology::Stamp;
use metrology::stamp::Host;

use crate::lifecycle_msgs::msg::TransitionEvent;
use crate::{
    Description, Message, TypeParts, WireError, description_of, from_cdr, instant, lyrical,
    parts_of, time, to_cdr,
};

/// A release of ROS 2, as far as its definitions differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Release {
    /// Jazzy and Kilted.
    #[default]
    Jazzy,
    /// Lyrical and newer.
    Lyrical,
}

/// Writes a sample's bytes by another definition.
pub type Conversion = fn(&[u8]) -> Result<Vec<u8>, WireError>;

impl Release {
    /// Every release.
    pub const ALL: [Self; 2] = [Self::Jazzy, Self::Lyrical];

    /// What is known of the message type `package/kind/Name`; `None`: none of this crate.
    #[must_use]
    pub fn description_of(self, type_name: &str) -> Option<&'static Description> {
        let is_it = |description: &&Description| description.type_name == type_name;
        let newer = match self {
            Self::Jazzy => None,
            Self::Lyrical => lyrical::DESCRIPTIONS.iter().find(is_it),
        };
        newer.or_else(|| description_of(type_name))
    }

    /// The parts of the type `package/kind/Name`; `None`: none of this crate.
    #[must_use]
    pub fn parts_of(self, type_name: &str) -> Option<&'static TypeParts> {
        let is_it = |parts: &&TypeParts| parts.type_name == type_name;
        let newer = match self {
            Self::Jazzy => None,
            Self::Lyrical => lyrical::TYPE_PARTS.iter().find(is_it),
        };
        newer.or_else(|| parts_of(type_name))
    }

    /// How samples of the definition with the hash `found` become this release's; `None`: they are written alike.
    #[must_use]
    pub fn conversion(self, type_name: &str, found: &str) -> Option<Conversion> {
        if type_name != TransitionEvent::TYPE_NAME {
            return None;
        }
        match (self, found) {
            (Self::Lyrical, TransitionEvent::TYPE_HASH) => Some(stamped_event),
            (Self::Jazzy, lyrical::lifecycle_msgs::msg::TransitionEvent::TYPE_HASH) => {
                Some(counted_event)
            }
            _ => None,
        }
    }
}

/// The event of Lyrical: its stamp is a `Time`.
fn stamped_event(bytes: &[u8]) -> Result<Vec<u8>, WireError> {
    let TransitionEvent {
        timestamp,
        transition,
        start_state,
        goal_state,
    } = from_cdr(bytes)?;
    // An instant beyond i64 has no wire form, as `time` writes it.
    let at = Stamp::<Host>::from_nanos(i64::try_from(timestamp).unwrap_or(i64::MAX));
    Ok(to_cdr(&lyrical::lifecycle_msgs::msg::TransitionEvent {
        stamp: time(at),
        transition,
        start_state,
        goal_state,
    }))
}

/// The event in Jazzy's definition: a stamp in nanoseconds, 0 where it is absent.
fn counted_event(bytes: &[u8]) -> Result<Vec<u8>, WireError> {
    let lyrical::lifecycle_msgs::msg::TransitionEvent {
        stamp,
        transition,
        start_state,
        goal_state,
    } = from_cdr(bytes)?;
    let at = instant::<Host>(&stamp).map_or(0, Stamp::nanos);
    Ok(to_cdr(&TransitionEvent {
        timestamp: u64::try_from(at).unwrap_or(0),
        transition,
        start_state,
        goal_state,
    }))
}
