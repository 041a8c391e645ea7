//! The ROS graph as tokens tell it.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use abbe_msgs::{Durability, Reliability};

use super::token::{self, End, Kind, NodeId};
use crate::network::{Guid, Remote, Role};

struct Seen {
    node: NodeId,
    /// With its GID; `None`: a node.
    end: Option<(Guid, End)>,
}

/// Everybody's tokens, ours included.
#[derive(Default)]
pub(super) struct Graph {
    seen: Mutex<BTreeMap<String, Seen>>,
}

impl Graph {
    fn seen(&self) -> MutexGuard<'_, BTreeMap<String, Seen>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A token is there. What is no token of ROS is left aside.
    pub fn appeared(&self, key: &str) {
        if let Some((node, end)) = token::parse(key) {
            let end = end.map(|end| (token::guid(key), end));
            self.seen().insert(key.to_owned(), Seen { node, end });
        }
    }

    /// A token is gone.
    pub fn vanished(&self, key: &str) {
        self.seen().remove(key);
    }

    /// The hash that somebody tells of a topic's type.
    pub fn hash_of(&self, name: &str, dds_type: &str) -> Option<String> {
        let seen = self.seen();
        let mut ends = seen.values().filter_map(|seen| seen.end.as_ref());
        ends.find_map(|(_, end)| {
            let is_meant = end.name == name && end.dds_type == dds_type;
            end.hash.clone().filter(|_| is_meant)
        })
    }

    /// Whether another node is called as this one.
    pub fn has_namesake(&self, own: &NodeId) -> bool {
        let seen = self.seen();
        let mut nodes = seen.values().filter(|seen| seen.end.is_none());
        nodes.any(|Seen { node, .. }| {
            let is_own = node.session == own.session && node.node == own.node;
            !is_own && node.namespace == own.namespace && node.name == own.name
        })
    }

    /// The ends that have a role.
    pub fn ends(&self, role_of: impl Fn(Kind) -> Option<Role>) -> Vec<Remote> {
        let describe = |node: &NodeId, (guid, end): &(Guid, End)| {
            Some(Remote {
                guid: *guid,
                node: node.fully_qualified(),
                role: role_of(end.kind)?,
                name: end.name.clone(),
                dds_type: end.dds_type.clone(),
                type_hash: end.hash.clone(),
                reliable: end.qos.reliability == Reliability::Reliable,
                latched: end.qos.durability == Durability::TransientLocal,
            })
        };
        let seen = self.seen();
        let ends = seen
            .values()
            .filter_map(|seen| Some((&seen.node, seen.end.as_ref()?)));
        ends.filter_map(|(node, end)| describe(node, end)).collect()
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::Qos;

    use super::*;

    fn node(session: &str, node: u64, name: &str) -> NodeId {
        NodeId {
            session: session.to_owned(),
            node,
            namespace: "/".to_owned(),
            name: name.to_owned(),
        }
    }

    #[test]
    fn ends_come_and_go_with_their_tokens() {
        let (graph, talker) = (Graph::default(), node("a", 0, "talker"));
        let end = End {
            kind: Kind::Server,
            name: "/save".to_owned(),
            dds_type: "std_srvs::srv::dds_::Trigger_".to_owned(),
            hash: Some("RIHS01_1".to_owned()),
            qos: Qos::RELIABLE,
        };
        let token = token::of_end(3, &talker, 1, &end);
        graph.appeared(&token);
        graph.appeared("3/something/else");
        let servers =
            |graph: &Graph| graph.ends(|kind| (kind == Kind::Server).then_some(Role::Request));
        let found = servers(&graph);
        assert_eq!(found.len(), 1);
        assert!(found[0].is_of(Role::Request, "/save") && found[0].reliable && !found[0].latched);
        assert_eq!(found[0].guid, token::guid(&token));
        let hash = graph.hash_of("/save", &end.dds_type);
        assert_eq!(hash.as_deref(), Some("RIHS01_1"));
        assert_eq!(graph.hash_of("/other", &end.dds_type), None);
        graph.vanished(&token);
        assert!(servers(&graph).is_empty());
    }

    #[test]
    fn a_namesake_is_another_node_of_the_same_name() {
        let (graph, own) = (Graph::default(), node("a", 0, "probe"));
        graph.appeared(&token::of_node(3, &own));
        graph.appeared(&token::of_node(3, &node("b", 0, "thermal_model")));
        assert!(!graph.has_namesake(&own));
        let other = token::of_node(3, &node("b", 1, "probe"));
        graph.appeared(&other);
        assert!(graph.has_namesake(&own));
        graph.vanished(&other);
        graph.appeared(&token::of_node(3, &node("a", 1, "probe")));
        assert!(graph.has_namesake(&own), "of our own process");
    }
}
