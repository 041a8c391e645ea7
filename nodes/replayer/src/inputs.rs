//! Which topics are inputs of a replay, and which nodes are their sources.

use abbe_msgs::topics::{self, Entry, Origin};
use node_runtime::Node;
use node_runtime::node::TopicPort;

/// What is known of a topic by its relative name.
pub(crate) fn entry_of(topic: &str) -> Option<&'static Entry> {
    topics::all().iter().find(|entry| {
        if entry.is_family {
            topic.starts_with(entry.name)
        } else {
            entry.name == topic
        }
    })
}

fn has_origin(port: &TopicPort, origin: Origin) -> bool {
    entry_of(&port.topic).is_some_and(|entry| entry.origin == origin)
}

/// Whether a node brings in what a replay puts in: a controller, a sequencer.
#[must_use]
pub fn is_source(node: &dyn Node) -> bool {
    let mut ports = node.ports().publications.iter();
    ports.any(|port| has_origin(port, Origin::Raw))
}

/// Whether a node publishes what a replay computes again.
pub(crate) fn computes(node: &dyn Node) -> bool {
    let mut ports = node.ports().publications.iter();
    ports.any(|port| has_origin(port, Origin::Computed))
}

/// The nodes with sources in front, otherwise in their order.
#[must_use]
pub fn sources_first(nodes: Vec<Box<dyn Node>>) -> Vec<Box<dyn Node>> {
    let (mut sorted, others): (Vec<_>, Vec<_>) =
        nodes.into_iter().partition(|node| is_source(node.as_ref()));
    sorted.extend(others);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_known_by_name_and_families_by_their_front() {
        let origin = |topic: &str| entry_of(topic).map(|entry| entry.origin);
        assert_eq!(origin("axes/state"), Some(Origin::Raw));
        assert_eq!(origin("temperature/bed"), Some(Origin::Raw));
        assert_eq!(origin("latency"), Some(Origin::Computed));
        assert_eq!(origin("gap/report"), Some(Origin::Housekeeping));
        assert_eq!(origin("axes/state/more"), None);
    }
}
