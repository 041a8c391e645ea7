//! Carrying emissions of one node to the others.

use abbe_msgs::Durability;
use abbe_msgs::service_msgs::msg::ServiceEventInfo;

use super::replay::NOBODY;
use super::{Bytes, Delivery, Emission, End, Event, GoalId, GoalStatus, Harness, Published};
use crate::clock::ros_time;
use crate::diagnostic::{Diagnostic, Level};

const IS_SERVICE: bool = false;
const IS_ACTION: bool = true;

impl Harness {
    /// Hands out everything that waits, and what follows from it.
    pub(super) fn drain(&mut self) {
        while self.deliver_next() {}
    }

    /// Hands out what has waited longest; false when nothing waits.
    pub fn deliver_next(&mut self) -> bool {
        let next = self.inbox.pop_front();
        let waited = next.is_some();
        if let Some(delivery) = next {
            self.deliver(delivery);
        }
        waited
    }

    fn deliver(&mut self, delivery: Delivery) {
        match delivery {
            Delivery::Message {
                node,
                subscription,
                bytes,
            } => {
                self.hand(
                    node,
                    Event::Message {
                        subscription,
                        bytes: &bytes,
                    },
                );
            }
            Delivery::Request {
                server,
                client,
                id,
                bytes,
            } => {
                let own = self.number(IS_SERVICE, server, client, id);
                let event = Event::Request {
                    service: server.1,
                    id: own,
                    bytes: &bytes,
                };
                self.hand(server.0, event);
            }
            Delivery::Response { client, id, bytes } => {
                let bytes = bytes.as_deref();
                self.hand(
                    client.0,
                    Event::Response {
                        client: client.1,
                        id,
                        bytes,
                    },
                );
            }
            Delivery::Shutdown { node } => self.hand(node, Event::Shutdown),
            of_goal => self.deliver_of_goal(of_goal),
        }
    }

    fn deliver_of_goal(&mut self, delivery: Delivery) {
        let (node, event) = match &delivery {
            Delivery::Goal {
                server,
                client,
                id,
                bytes,
            } => {
                let (server, id) = (*server, self.number(IS_ACTION, *server, *client, *id));
                let goal = Event::Goal {
                    server: server.1,
                    id,
                    bytes,
                };
                (server.0, goal)
            }
            &Delivery::Cancel {
                server: (node, server),
                id,
            } => (node, Event::Cancel { server, id }),
            &Delivery::Answer {
                client: (node, client),
                id,
                accepted,
            } => {
                let answer = Event::GoalAnswer {
                    client,
                    id,
                    accepted,
                };
                (node, answer)
            }
            Delivery::Feedback { client, id, bytes } => {
                let (node, client, id) = (client.0, client.1, *id);
                (node, Event::GoalFeedback { client, id, bytes })
            }
            Delivery::Ended {
                client,
                id,
                status,
                bytes,
            } => {
                let ended = Event::GoalResult {
                    client: client.1,
                    id: *id,
                    status: *status,
                    bytes: bytes.as_deref(),
                };
                (client.0, ended)
            }
            _ => return,
        };
        self.hand(node, event);
    }

    /// Gives a request or goal the number under which its server knows it.
    fn number(&mut self, kind: bool, server: End, client: End, id: u64) -> u64 {
        let own = self.next_id;
        self.next_id += 1;
        self.asked.insert((kind, server, own), (client, id));
        own
    }

    pub(super) fn publish(&mut self, route: usize, bytes: Bytes) {
        let entry = &mut self.routes[route];
        let sequence = entry.sequence;
        entry.sequence = sequence.wrapping_add(1);
        if entry.port.qos.durability == Durability::TransientLocal {
            entry.latched = Some(bytes.clone());
        }
        for &(node, subscription) in &entry.listeners {
            self.inbox.push_back(Delivery::Message {
                node,
                subscription,
                bytes: bytes.clone(),
            });
        }
        let published = Published {
            at: self.now,
            topic: route,
            sequence,
            bytes: &bytes,
        };
        for observer in &mut self.observers {
            observer(published);
        }
    }

    /// Carries one emission of `node`.
    pub(super) fn take(&mut self, node: usize, emission: Emission) {
        match emission {
            Emission::Publish { publication, bytes } => {
                self.publish(self.publications[node][publication], bytes);
            }
            Emission::Diagnostic(diagnostic) => self.report(node, &diagnostic),
            Emission::Stopped => self.stopped[node] = true,
            Emission::Respond { service, id, bytes } => {
                if let Some((client, id)) = self.asked.remove(&(IS_SERVICE, (node, service), id))
                    && client != NOBODY
                {
                    self.inbox.push_back(Delivery::Response {
                        client,
                        id,
                        bytes: Some(bytes),
                    });
                }
            }
            Emission::Call { client, id, bytes } => self.call(node, client, id, bytes),
            Emission::SendGoal { client, id, bytes } => self.send_goal(node, client, id, bytes),
            Emission::CancelGoal { client, id } => self.cancel_goal((node, client), id),
            Emission::AcceptGoal { server, id } => self.answer_goal((node, server), id, true),
            Emission::RejectGoal { server, id } => self.answer_goal((node, server), id, false),
            Emission::Feedback { server, id, bytes } => {
                if let Some(&(client, id)) = self.asked.get(&(IS_ACTION, (node, server), id)) {
                    self.inbox
                        .push_back(Delivery::Feedback { client, id, bytes });
                }
            }
            Emission::FinishGoal {
                server,
                id,
                status,
                bytes,
            } => {
                self.finish_goal((node, server), id, status, bytes);
            }
        }
    }

    fn call(&mut self, node: usize, client: usize, id: u64, bytes: Bytes) {
        self.tell_call(node, client, id, &bytes);
        let name = &self.nodes[node].ports().clients[client].service;
        let end = (node, client);
        let delivery = match self.service_servers.get(name) {
            Some(&server) => Delivery::Request {
                server,
                client: end,
                id,
                bytes,
            },
            None => Delivery::Response {
                client: end,
                id,
                bytes: None,
            },
        };
        self.inbox.push_back(delivery);
    }

    /// Publishes that a request was sent, for a bag that is to replay without the node that called.
    fn tell_call(&mut self, node: usize, client: usize, id: u64, bytes: &Bytes) {
        let port = &self.nodes[node].ports().clients[client];
        let Some(&route) = self.service_events.get(&port.service) else {
            return;
        };
        let mut client_gid = [0; 16];
        client_gid[..8].copy_from_slice(&(node as u64).to_be_bytes());
        client_gid[8..].copy_from_slice(&(client as u64).to_be_bytes());
        let info = ServiceEventInfo {
            event_type: ServiceEventInfo::REQUEST_SENT,
            stamp: ros_time(self.now),
            client_gid,
            sequence_number: i64::try_from(id).unwrap_or(i64::MAX),
        };
        // A request that cannot be read is refused by its server, who says so.
        if let Ok(event) = (port.events.sent)(info, bytes) {
            self.publish(route, event);
        }
    }

    fn send_goal(&mut self, node: usize, client: usize, id: GoalId, bytes: Bytes) {
        let name = self.nodes[node].ports().action_clients[client]
            .action
            .clone();
        let end = (node, client);
        match self.action_servers.get(&name) {
            Some(&server) => {
                self.inbox.push_back(Delivery::Goal {
                    server,
                    client: end,
                    id,
                    bytes,
                });
            }
            None => {
                let message = format!("action \"{name}\": no node offers it");
                self.report(
                    node,
                    &Diagnostic::new(Level::Error, "no_action_server", message),
                );
                self.inbox.push_back(Delivery::Answer {
                    client: end,
                    id,
                    accepted: false,
                });
            }
        }
    }

    fn cancel_goal(&mut self, client: End, id: GoalId) {
        let wanted = (client, id);
        let goal = self
            .asked
            .iter()
            .find(|(key, value)| key.0 == IS_ACTION && **value == wanted);
        if let Some((&(_, server, own), _)) = goal {
            self.inbox.push_back(Delivery::Cancel { server, id: own });
        }
    }

    fn answer_goal(&mut self, server: End, own: GoalId, accepted: bool) {
        let key = (IS_ACTION, server, own);
        let asked = if accepted {
            self.asked.get(&key).copied()
        } else {
            self.asked.remove(&key)
        };
        if let Some((client, id)) = asked {
            self.inbox.push_back(Delivery::Answer {
                client,
                id,
                accepted,
            });
        }
    }

    fn finish_goal(&mut self, server: End, own: GoalId, status: GoalStatus, bytes: Bytes) {
        if let Some((client, id)) = self.asked.remove(&(IS_ACTION, server, own)) {
            self.inbox.push_back(Delivery::Ended {
                client,
                id,
                status,
                bytes: Some(bytes),
            });
        }
    }
}
