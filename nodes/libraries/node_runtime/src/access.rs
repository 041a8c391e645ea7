//! What a node writes and reads on the wire, by the names of DDS's topics: what its credentials must allow.

use std::collections::BTreeSet;

use abbe_msgs::topics;

use crate::names::{self, NameError, NodeNames};
use crate::node::Ports;

/// Nodes of each participant.
const GRAPH: &str = "ros_discovery_info";
/// How the names of `ros2`'s own nodes begin.
const COMMAND_LINE: &str = "_ros2cli";
/// Services of an action.
const OF_ACTION: [&str; 3] = ["send_goal", "cancel_goal", "get_result"];

/// Topics of DDS; `*` stands for any run of characters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Access {
    /// What it writes.
    pub publish: BTreeSet<String>,
    /// What it reads.
    pub subscribe: BTreeSet<String>,
}

impl Access {
    /// Of a participant that only shows itself.
    #[must_use]
    pub fn to_graph() -> Self {
        let graph = || BTreeSet::from([GRAPH.to_owned()]);
        Self {
            publish: graph(),
            subscribe: graph(),
        }
    }

    /// Of one that listens to everything and says nothing: a recorder.
    #[must_use]
    pub fn to_listen() -> Self {
        let mut access = Self::to_graph();
        access.subscribe.insert("*".to_owned());
        access
    }

    /// Of a person with `ros2` who listens: its nodes tell of themselves and answer what their type descriptions are,
    /// and without the right to do so they do not start.
    #[must_use]
    pub fn to_view() -> Self {
        let mut access = Self::to_listen();
        access.publish.insert(format!("rr/{COMMAND_LINE}*"));
        for topic in [topics::ROSOUT.name, topics::PARAMETER_EVENTS.name] {
            access.writes(topic);
        }
        access
    }

    /// Of one who besides calls every service: parameters, lifecycles, actions.
    #[must_use]
    pub fn to_operate() -> Self {
        let mut access = Self::to_view();
        access.publish.insert("rq/*".to_owned());
        access
    }

    /// Of a node with these ports, and with what the runtime gives to every node.
    ///
    /// # Errors
    /// When a port has no name of ROS.
    pub fn of(node: &NodeNames, ports: &Ports) -> Result<Self, NameError> {
        let mut access = Self::to_graph();
        for topic in [
            topics::DIAGNOSTICS.name,
            topics::ROSOUT.name,
            topics::PARAMETER_EVENTS.name,
        ] {
            access.writes(&node.resolve(topic)?);
        }
        for topic in [topics::CLOCK.name, topics::HOST_CLOCK.name] {
            access.reads(&node.resolve(topic)?);
        }
        for port in &ports.publications {
            access.writes(&node.resolve(&port.topic)?);
        }
        for port in &ports.subscriptions {
            access.reads(&node.resolve(&port.topic)?);
        }
        // Parameters, log levels, type descriptions, lifecycle.
        access.serves(&format!("{}/*", node.fully_qualified()));
        for port in &ports.services {
            access.serves(&node.resolve(&port.service)?);
        }
        for port in &ports.clients {
            access.calls(&node.resolve(&port.service)?);
        }
        for port in &ports.action_servers {
            let action = node.resolve(&port.action)?;
            for service in OF_ACTION {
                access.serves(&format!("{action}/_action/{service}"));
            }
            access.writes(&format!("{action}/_action/feedback"));
            access.writes(&format!("{action}/_action/status"));
        }
        for port in &ports.action_clients {
            let action = node.resolve(&port.action)?;
            for service in OF_ACTION {
                access.calls(&format!("{action}/_action/{service}"));
            }
            access.reads(&format!("{action}/_action/feedback"));
            access.reads(&format!("{action}/_action/status"));
        }
        Ok(access)
    }

    /// The same, and what somebody else may do.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.publish.extend(other.publish);
        self.subscribe.extend(other.subscribe);
        self
    }

    /// Adds a topic that it writes, by its absolute name.
    pub fn writes(&mut self, topic: &str) {
        self.publish.insert(names::dds_topic(topic));
    }

    fn reads(&mut self, topic: &str) {
        self.subscribe.insert(names::dds_topic(topic));
    }

    /// Adds a service that it answers, by its absolute name; it also tells of its calls.
    pub fn serves(&mut self, service: &str) {
        self.subscribe.insert(names::dds_request_topic(service));
        self.publish.insert(names::dds_reply_topic(service));
        self.writes(&format!("{service}/_service_event"));
    }

    fn calls(&mut self, service: &str) {
        self.publish.insert(names::dds_request_topic(service));
        self.subscribe.insert(names::dds_reply_topic(service));
        self.writes(&format!("{service}/_service_event"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{ActionPort, TopicPort};
    use abbe_msgs::Message;
    use abbe_msgs::msg::AxisState;

    #[test]
    fn the_command_line_may_answer_for_itself_and_for_nobody_else() {
        for access in [Access::to_view(), Access::to_operate()] {
            let answers = access.publish.iter().filter(|t| t.starts_with("rr/"));
            assert_eq!(answers.collect::<Vec<_>>(), ["rr/_ros2cli*"]);
            assert!(access.publish.contains("rt/rosout"));
            assert!(!access.publish.contains("*") && !access.publish.contains("rt/*"));
        }
        assert!(!Access::to_view().publish.contains("rq/*"));
    }

    #[test]
    fn a_node_may_write_what_its_ports_say_and_nothing_else() {
        let node = NodeNames::new("probe", &[]).unwrap();
        let state = TopicPort {
            topic: "axes/state".to_owned(),
            type_name: AxisState::TYPE_NAME,
            type_hash: AxisState::TYPE_HASH,
            definition: AxisState::DEFINITION,
            qos: abbe_msgs::Qos::RELIABLE,
        };
        let run = ActionPort {
            action: "run_program".to_owned(),
            type_name: "abbe_msgs/action/RunProgram",
        };
        let ports = Ports {
            subscriptions: vec![state],
            action_clients: vec![run],
            ..Ports::default()
        };
        let access = Access::of(&node, &ports).unwrap();
        assert!(access.subscribe.contains("rt/axes/state"));
        assert!(!access.publish.contains("rt/axes/state"));
        assert!(
            access
                .publish
                .contains("rq/run_program/_action/send_goalRequest")
        );
        assert!(access.subscribe.contains("rq/probe/*Request"));
        assert!(
            !access
                .publish
                .iter()
                .any(|topic| topic == "*" || topic.starts_with("rq/probe"))
        );
        assert!(
            !Access::to_listen()
                .publish
                .iter()
                .any(|topic| topic.contains('/'))
        );
    }
}
