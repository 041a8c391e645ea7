//! Samples of the network for the page.

use std::collections::BTreeMap;

use anyhow::Result;
use node_runtime::environment::Environment;
use node_runtime::names::NodeNames;
use node_runtime::tap::{Selection, TapEvent, Tapped};
use node_runtime::{HostTime, RawTap, Setup};

use crate::decoders::{DECODERS, Family};
use crate::feed::{Feed, Slot};

/// The namespace with a slash at its end.
fn front(namespace: &str) -> String {
    format!("{}/", namespace.trim_end_matches('/'))
}

/// Names of the topics that the page shows, as patterns.
fn patterns(front: &str) -> Vec<String> {
    let absolute = |name: &str| {
        if name.starts_with('/') {
            name.to_owned()
        } else {
            format!("{front}{name}")
        }
    };
    let families = [Family::Temperature, Family::Machine].map(|one| format!("{}*", one.base()));
    let decoders = DECODERS.iter().map(|decoder| absolute(decoder.topic));
    decoders
        .chain(families.iter().map(|base| absolute(base)))
        .collect()
}

/// The slot of a topic by its absolute name.
fn slot(front: &str, topic: &str) -> Option<Slot> {
    Feed::slot(topic).or_else(|| Feed::slot(topic.strip_prefix(front)?))
}

/// Passes samples of the network to a feed.
pub struct Receiver {
    front: String,
    feed: Feed,
    time: HostTime,
    slots: BTreeMap<String, Option<Slot>>,
}

impl Receiver {
    /// Takes the topics of a namespace; times of receipt are by the clock `time`.
    #[must_use]
    pub fn new(namespace: &str, feed: Feed, time: HostTime) -> Self {
        Self {
            front: front(namespace),
            feed,
            time,
            slots: BTreeMap::new(),
        }
    }

    /// Takes a sample of any topic.
    pub fn take(&mut self, sample: &Tapped) {
        let name = &sample.topic.name;
        if !self.slots.contains_key(name) {
            self.slots.insert(name.clone(), slot(&self.front, name));
        }
        if let Some(Some(slot)) = self.slots.get(name) {
            let at = self.time.shown(sample.received);
            self.feed.take(slot, at, &sample.bytes);
        }
    }
}

/// Subscribes to the topics of the node's namespace until the tap is stopped.
///
/// # Errors
/// When there is no network.
pub(crate) fn listen(setup: &Setup, feed: Feed) -> Result<RawTap> {
    let mut receiver = Receiver::new(setup.namespace(), feed, setup.host_time());
    let names = NodeNames::new(&format!("{}_tap", setup.name()), &[])?;
    let selection = Selection::Matching(patterns(&receiver.front));
    RawTap::start(&Environment::read()?, &names, selection, move |event| {
        // Other types of a topic are reported by the nodes that use it.
        if let TapEvent::Sample(sample) = event {
            receiver.take(&sample);
        }
    })
}

#[cfg(test)]
mod tests {
    use abbe_msgs::topics;

    use super::*;

    #[test]
    fn topics_of_the_own_namespace_and_conditions_of_all_are_received() {
        let front = front("/mill_3");
        let selection = Selection::Matching(patterns(&front));
        let axes = format!("/mill_3/{}", topics::AXES_STATE.name);
        let bed = format!("/mill_3/{}", topics::TEMPERATURE.of("bed").unwrap());
        for name in [&axes, &bed, topics::DIAGNOSTICS.name] {
            assert!(
                selection.takes(name) && slot(&front, name).is_some(),
                "{name}"
            );
        }
        let other = format!("/mill_4/{}", topics::AXES_STATE.name);
        assert!(!selection.takes(&other) && slot(&front, &other).is_none());
        assert_eq!(super::front("/"), "/");
    }
}
