//! Nodes that publish on the topics of a replay, or move axes by its messages.
//!
//! Recorded messages among those of a running cell are taken for the cell's own: positions, tests and offsets of another
//! day. So a replay looks at the graph before it speaks, and while it does.

use std::collections::BTreeSet;
use std::fmt;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::msg::AxisCompensation;
use abbe_msgs::rcl_interfaces::msg::{Log, ParameterEvent};
use abbe_msgs::tf2_msgs::msg::TFMessage;
use abbe_msgs::{Message as _, topics};

use crate::names;
use crate::network::{Guid, Remote, Role};

/// Types of topics on which every node may speak.
const SHARED: [&str; 4] = [
    DiagnosticArray::TYPE_NAME,
    Log::TYPE_NAME,
    ParameterEvent::TYPE_NAME,
    TFMessage::TYPE_NAME,
];
/// What stands behind the name of an action where goals are sent.
const GOALS: &str = "/_action/send_goal";
/// Bytes of a name of an endpoint that name its participant.
const PREFIX_BYTES: usize = 12;

/// What another node does with a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Use {
    /// It publishes on it.
    Publishes,
    /// It is a controller, whose axes move by it.
    Moves,
}

/// Another node that speaks on a topic, or whose axes move by it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Rival {
    /// The topic.
    pub topic: String,
    /// What it does with it.
    pub uses: Use,
    /// Full name of the node; empty where it is not known.
    pub node: String,
}

impl fmt::Display for Rival {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let topic = &self.topic;
        let node = match self.node.as_str() {
            "" => "a node without a name",
            node => node,
        };
        match self.uses {
            Use::Publishes => write!(f, "{node} publishes {topic}"),
            Use::Moves => write!(f, "{node} moves its axes by {topic}"),
        }
    }
}

/// The rivals of a publisher with the endpoints `own`, in order.
pub(super) fn find(own: &[Remote], writers: &[Remote], readers: &[Remote]) -> Vec<Rival> {
    let guids: BTreeSet<Guid> = own.iter().map(|end| end.guid).collect();
    let is_controller = |reader: &Remote| {
        let mut servers = readers.iter().filter(|other| is_server_of_programs(other));
        servers.any(|server| is_of_one_node(server, reader))
    };
    let mut found = BTreeSet::new();
    for end in own {
        let type_name = names::ros_type(&end.dds_type);
        let type_name = type_name.as_deref().unwrap_or_default();
        let rival = |other: &Remote, uses| Rival {
            topic: end.name.clone(),
            uses,
            node: other.node.clone(),
        };
        let is_other =
            |it: &&Remote| it.is_of(Role::Message, &end.name) && !guids.contains(&it.guid);
        if !SHARED.contains(&type_name) {
            let others = writers.iter().filter(is_other);
            found.extend(others.map(|other| rival(other, Use::Publishes)));
        }
        if type_name == AxisCompensation::TYPE_NAME {
            let others = readers.iter().filter(is_other);
            let controllers = others.filter(|other| is_controller(other));
            found.extend(controllers.map(|other| rival(other, Use::Moves)));
        }
    }
    found.into_iter().collect()
}

/// Whether an endpoint takes programs for a machine.
fn is_server_of_programs(end: &Remote) -> bool {
    let action = end.name.strip_suffix(GOALS);
    end.role == Role::Request
        && action.is_some_and(|action| action.ends_with(topics::RUN_PROGRAM.name))
}

fn is_of_one_node(one: &Remote, other: &Remote) -> bool {
    let is_named = !one.node.is_empty() && one.node == other.node;
    is_named || one.guid[..PREFIX_BYTES] == other.guid[..PREFIX_BYTES]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An endpoint of the participant `of`.
    fn end(of: u8, entity: u8, node: &str, (role, name): (Role, &str), type_name: &str) -> Remote {
        let mut guid = [of; 16];
        guid[15] = entity;
        Remote {
            guid,
            node: node.to_owned(),
            role,
            name: name.to_owned(),
            dds_type: names::dds_type(type_name),
            type_hash: None,
            reliable: true,
            latched: false,
        }
    }

    const STATE: &str = "abbe_msgs/msg/AxisState";
    const OFFSETS: &str = AxisCompensation::TYPE_NAME;

    fn of(topic: &str) -> (Role, &str) {
        (Role::Message, topic)
    }

    /// What a bag is played as.
    fn own() -> Vec<Remote> {
        vec![
            end(9, 1, "/replayer_voice", of("/axes/state"), STATE),
            end(9, 2, "/replayer_voice", of("/compensation"), OFFSETS),
            end(9, 3, "/replayer_voice", of("/diagnostics"), SHARED[0]),
            end(9, 4, "/replayer_voice", of("/rosout"), SHARED[1]),
            end(9, 5, "/replayer_voice", of("/tf"), SHARED[3]),
        ]
    }

    fn said(writers: &[Remote], readers: &[Remote]) -> Vec<String> {
        let mut writers = writers.to_vec();
        writers.extend(own());
        let found = find(&own(), &writers, readers);
        found.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn another_publisher_of_a_topic_is_a_rival_and_of_what_everybody_says_is_not() {
        assert!(said(&[], &[]).is_empty(), "it is alone");
        let cnc = end(1, 1, "/fake_cnc", of("/axes/state"), STATE);
        let unnamed = end(2, 1, "", of("/compensation"), OFFSETS);
        let other_type = end(3, 1, "/shop", of("/axes/state"), "std_msgs/msg/String");
        let elsewhere = end(4, 1, "/m2/fake_cnc", of("/m2/axes/state"), STATE);
        let service = end(5, 1, "/x", (Role::Reply, "/axes/state"), STATE);
        let shared = own().into_iter().skip(2).map(|mine| Remote {
            guid: [7; 16],
            ..mine
        });
        let mut writers = vec![cnc.clone(), cnc, unnamed, other_type, elsewhere, service];
        writers.extend(shared);
        assert_eq!(
            said(&writers, &[]),
            [
                "/fake_cnc publishes /axes/state",
                "/shop publishes /axes/state",
                "a node without a name publishes /compensation",
            ]
        );
    }

    #[test]
    fn a_controller_that_hears_offsets_is_a_rival_and_who_merely_listens_is_not() {
        let goals = (Role::Request, "/cnc/run_program/_action/send_goal");
        let goal = "abbe_msgs/action/RunProgram_SendGoal_Request";
        let hears =
            |of_participant, node| end(of_participant, 1, node, of("/compensation"), OFFSETS);
        let listener = hears(1, "/gap_diagnosis");
        assert!(said(&[], std::slice::from_ref(&listener)).is_empty());
        // By participant, and by name where participants cannot be distinguished.
        for (server, controller) in [
            (end(2, 2, "", goals, goal), hears(2, "")),
            (end(2, 2, "/fake_cnc", goals, goal), hears(3, "/fake_cnc")),
        ] {
            let name = match controller.node.as_str() {
                "" => "a node without a name",
                node => node,
            };
            let expected = format!("{name} moves its axes by /compensation");
            assert_eq!(
                said(&[], &[listener.clone(), server, controller]),
                [expected]
            );
        }
        let others = (Role::Request, "/sequencer/run_cycle/_action/send_goal");
        let server = end(1, 2, "/gap_diagnosis", others, goal);
        assert!(said(&[], &[listener, server]).is_empty());
    }
}
