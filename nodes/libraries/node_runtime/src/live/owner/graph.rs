//! Looking at the others on the network: wrong types, impossible QoS, a second node of our name, a second publisher.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use abbe_msgs::{Durability, Qos, Release, Reliability};
use tokio::time::Instant;

use super::{Owner, now};
use crate::diagnostic::{Diagnostic, Level};
use crate::names;
use crate::network::{Guid, Remote, Role, own_hash};

/// Who writes on a topic that is read.
#[derive(Debug, Default)]
pub(in crate::live) struct Writers {
    /// Of our type.
    ours: BTreeSet<Guid>,
    /// Of another type: which.
    foreign: BTreeMap<Guid, String>,
    /// Before that the graph is not looked at again because of one whom nobody has described.
    next_look: Option<Instant>,
}

/// Between looks at the graph because of samples of a writer whom nobody has described.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// Our end of a topic.
struct End<'o> {
    topic: &'o str,
    dds_type: &'o str,
    qos: Qos,
    is_reader: bool,
    release: Release,
}

impl End<'_> {
    /// What stands between us and another end of the same topic: its type, its quality of service.
    fn complaints(&self, other: &Remote) -> (Option<String>, Option<String>) {
        if !other.is_of(Role::Message, self.topic) {
            return (None, None);
        }
        let topic = self.topic;
        let shown =
            |dds_type: &str| names::ros_type(dds_type).unwrap_or_else(|| dds_type.to_owned());
        // RustDDS matches by topic name alone, so that samples of another type would be decoded; Zenoh by
        // name, type and hash, so that they would be missed in silence.
        let own_hash = own_hash(self.release, self.dds_type);
        let by = if other.node.is_empty() {
            let guid = other.guid.map(|byte| format!("{byte:02x}")).join("");
            format!(" of a program without a node's name, GUID {guid}")
        } else {
            format!(" of {}", other.node)
        };
        let of_type = match (other.type_hash.as_deref(), own_hash) {
            _ if other.dds_type != self.dds_type => Some(format!(
                "{topic}: expected {}, found {}{by}",
                shown(self.dds_type),
                shown(&other.dds_type)
            )),
            (Some(found), Some(expected)) if found != expected => Some(format!(
                "{topic}: {} has the hash {expected} here, {found} there{by}{}",
                shown(self.dds_type),
                self.remedy(found)
            )),
            _ => None,
        };
        let reliable = self.qos.reliability == Reliability::Reliable;
        let latched = self.qos.durability == Durability::TransientLocal;
        let (wants, offers) = if self.is_reader {
            ((reliable, latched), (other.reliable, other.latched))
        } else {
            ((other.reliable, other.latched), (reliable, latched))
        };
        let of_qos = match (wants, offers) {
            ((true, _), (false, _)) => Some("reliable is wanted, best effort offered"),
            ((_, true), (_, false)) => Some("transient local is wanted, volatile offered"),
            _ => None,
        };
        (
            of_type,
            of_qos.map(|complaint| format!("{topic}: {complaint}")),
        )
    }
}

impl End<'_> {
    /// What to do where another release of ROS has the definition with this hash.
    fn remedy(&self, hash: &str) -> &'static str {
        let mut releases = Release::ALL.into_iter();
        match releases.find(|release| own_hash(*release, self.dds_type) == Some(hash)) {
            Some(Release::Jazzy) => "; set ROS_DISTRO=jazzy for all nodes, or for none",
            Some(Release::Lyrical) => "; set ROS_DISTRO=lyrical",
            None => "",
        }
    }
}

impl Owner {
    /// What is wrong with a writer that sends another type than ours on a topic: nothing that it sends means what is read.
    pub(super) fn foreign(&mut self, place: usize, writer: Guid) -> Option<String> {
        let known = &self.subscriptions[place].writers;
        if known.ours.contains(&writer) {
            return None;
        }
        if let Some(what) = known.foreign.get(&writer) {
            return Some(what.clone());
        }
        if known.next_look.is_some_and(|at| at > now()) {
            return None;
        }
        self.subscriptions[place].writers.next_look = Some(now() + LOOK_AGAIN);
        let writers = self.participant.writers();
        self.meet(place, &writers);
        let known = &self.subscriptions[place].writers;
        known.foreign.get(&writer).cloned()
    }

    /// Keeps which writers of a topic that is read are of its type.
    fn meet(&mut self, place: usize, writers: &[Remote]) {
        let release = self.participant.release();
        let subscription = &mut self.subscriptions[place];
        let end = End {
            topic: &subscription.topic,
            dds_type: &subscription.dds_type,
            qos: subscription.qos,
            is_reader: true,
            release,
        };
        let (mut ours, mut foreign) = (BTreeSet::new(), BTreeMap::new());
        for writer in writers
            .iter()
            .filter(|it| it.is_of(Role::Message, end.topic))
        {
            match end.complaints(writer).0 {
                Some(what) => {
                    foreign.insert(writer.guid, what);
                }
                None => {
                    ours.insert(writer.guid);
                }
            }
        }
        subscription.writers.ours = ours;
        subscription.writers.foreign = foreign;
    }

    /// Looks once at everybody's endpoints.
    pub(super) fn check_graph(&mut self) {
        let (writers, readers) = (self.participant.writers(), self.participant.readers());
        for place in 0..self.subscriptions.len() {
            self.meet(place, &writers);
        }
        let release = self.participant.release();
        let subscriptions = self.subscriptions.iter().map(|subscription| End {
            topic: &subscription.topic,
            dds_type: &subscription.dds_type,
            qos: subscription.qos,
            is_reader: true,
            release,
        });
        let publications = self.publications.iter().map(|publication| End {
            topic: &publication.topic,
            dds_type: &publication.dds_type,
            qos: publication.qos,
            is_reader: false,
            release,
        });
        let (mut of_type, mut of_qos) = (Vec::new(), Vec::new());
        for end in subscriptions.chain(publications) {
            for other in if end.is_reader { &writers } else { &readers } {
                let (wrong_type, wrong_qos) = end.complaints(other);
                of_type.extend(wrong_type);
                of_qos.extend(wrong_qos);
            }
        }
        self.complain("type_mismatch", of_type);
        self.complain("qos_incompatible", of_qos);
        for (place, subscription) in self.subscriptions.iter().enumerate() {
            let publish = |other: &&Remote| {
                other.is_of(Role::Message, &subscription.topic)
                    && other.dds_type == subscription.dds_type
            };
            let publishers = writers.iter().filter(publish).count();
            self.node.sees_publishers(place, publishers);
        }
        self.check_publishers();
        if self.participant.namesake() {
            let message = format!("another node is called {}", self.name);
            self.notice(Diagnostic::new(Level::Error, "second_node", message));
        }
    }

    /// Says which topics more than one publisher speaks on by turns.
    fn check_publishers(&mut self) {
        let mut complaints = Vec::new();
        for subscription in &mut self.subscriptions {
            let turns = std::mem::take(&mut subscription.turns);
            if turns > 0 {
                let topic = &subscription.topic;
                complaints.push(format!(
                    "{topic}: more than one publisher, {turns} changes between them since the last look"
                ));
            }
        }
        if !complaints.is_empty() {
            let message = complaints.join("; ");
            self.notice(Diagnostic::new(Level::Warn, "second_publisher", message));
        }
    }

    fn complain(&mut self, name: &'static str, mut complaints: Vec<String>) {
        complaints.sort();
        complaints.dedup();
        if !complaints.is_empty() {
            self.notice(Diagnostic::new(Level::Error, name, complaints.join("; ")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complaints_name_topic_expectation_and_finding() {
        let end = End {
            topic: "/latency",
            dds_type: "abbe_msgs::msg::dds_::ProbeLatency_",
            qos: Qos::LATCHED,
            is_reader: true,
            release: Release::Jazzy,
        };
        let mut other = Remote {
            guid: [0; 16],
            node: String::new(),
            role: Role::Message,
            name: "/latency".to_owned(),
            dds_type: end.dds_type.to_owned(),
            type_hash: None,
            reliable: true,
            latched: true,
        };
        assert_eq!(end.complaints(&other), (None, None));
        other.type_hash = Some("RIHS01_00".to_owned());
        let of_hash = end.complaints(&other).0.unwrap();
        assert!(
            of_hash.contains("RIHS01_00 there of a program"),
            "{of_hash}"
        );
        other.latched = false;
        other.dds_type = "std_msgs::msg::dds_::String_".to_owned();
        let (of_type, of_qos) = end.complaints(&other);
        assert_eq!(
            of_type.unwrap(),
            format!(
                "/latency: expected abbe_msgs/msg/ProbeLatency, found std_msgs/msg/String of a program without a node's name, GUID {}",
                "00".repeat(16)
            )
        );
        other.node = "/shop/scale".to_owned();
        let of_type = end.complaints(&other).0.unwrap();
        assert!(of_type.ends_with("String of /shop/scale"), "{of_type}");
        assert!(of_qos.unwrap().contains("transient local is wanted"));
        let offering = End {
            is_reader: false,
            ..end
        };
        assert_eq!(
            offering.complaints(&other).1,
            None,
            "a volatile reader takes what is latched"
        );
        other.name = "/other".to_owned();
        assert_eq!(offering.complaints(&other), (None, None));
    }

    #[test]
    fn a_definition_of_another_release_is_named_with_its_remedy() {
        let dds_type = names::dds_type("lifecycle_msgs/msg/TransitionEvent");
        for (here, there, remedy) in [
            (Release::Jazzy, Release::Lyrical, "; set ROS_DISTRO=lyrical"),
            (
                Release::Lyrical,
                Release::Jazzy,
                "; set ROS_DISTRO=jazzy for all nodes, or for none",
            ),
        ] {
            let end = End {
                topic: "/probe/transition_event",
                dds_type: &dds_type,
                qos: Qos::RELIABLE,
                is_reader: false,
                release: here,
            };
            let mut other = Remote {
                guid: [0; 16],
                node: String::new(),
                role: Role::Message,
                name: end.topic.to_owned(),
                dds_type: dds_type.clone(),
                type_hash: own_hash(there, &dds_type).map(str::to_owned),
                reliable: true,
                latched: false,
            };
            let of_hash = end.complaints(&other).0.unwrap();
            assert!(of_hash.ends_with(remedy), "{of_hash}");
            other.type_hash = own_hash(here, &dds_type).map(str::to_owned);
            assert_eq!(end.complaints(&other), (None, None));
        }
    }
}
