//! A harness in the middle of a run, and a fresh one that goes on from there.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

use metrology::stamp::{Host, Stamp};

use super::{Bytes, Delivery, End, Harness};
use crate::node::{Node, Saved};

/// Everything that what follows depends on: of the nodes, and of what is on its way between them.
pub struct Snapshot {
    now: Stamp<Host>,
    /// By node: its name and what it holds.
    nodes: Vec<(String, Saved)>,
    /// By topic: its name, publications so far, and the last message of a latched one.
    routes: Vec<(String, u32, Option<Bytes>)>,
    timers: BinaryHeap<Reverse<(Stamp<Host>, usize, usize)>>,
    inbox: VecDeque<Delivery>,
    asked: BTreeMap<(bool, End, u64), (End, u64)>,
    next_id: u64,
    stopped: Vec<bool>,
}

/// Why a run cannot be saved, or not be gone on with.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum SnapshotError {
    #[error("node \"{node}\" cannot be saved in the middle of a run")]
    NotSaved { node: String },
    #[error("node \"{node}\" cannot go on from what was saved: it is another node")]
    NotItsOwn { node: String },
    #[error("saved were nodes {saved:?}; nodes {found:?} or their topics are others")]
    OtherNodes {
        saved: Vec<String>,
        found: Vec<String>,
    },
}

impl Harness {
    /// Copies everything that what follows depends on; the run goes on as if nothing had happened.
    ///
    /// # Errors
    /// When a node cannot be saved.
    pub fn save(&self) -> Result<Snapshot, SnapshotError> {
        let saved = |node: &dyn Node| match node.save() {
            Some(saved) => Ok((node.name().to_owned(), saved)),
            None => Err(SnapshotError::NotSaved {
                node: node.name().to_owned(),
            }),
        };
        // The rest of the fields follow from the nodes' tables, or are empty between two events.
        Ok(Snapshot {
            now: self.now,
            nodes: self.nodes().map(saved).collect::<Result<_, _>>()?,
            routes: self
                .routes
                .iter()
                .map(|route| {
                    let topic = route.port.topic.clone();
                    (topic, route.sequence, route.latched.clone())
                })
                .collect(),
            timers: self.timers.clone(),
            inbox: self.inbox.clone(),
            asked: self.asked.clone(),
            next_id: self.next_id,
            stopped: self.stopped.clone(),
        })
    }

    /// Goes on from a snapshot of a harness of the same nodes in the same order. Observers are this harness' own.
    ///
    /// # Errors
    /// When nodes or topics are others; this harness is then of no more use.
    pub fn resume(&mut self, snapshot: &Snapshot) -> Result<(), SnapshotError> {
        let mut own = self.routes.iter().map(|route| &route.port.topic);
        let mut saved = snapshot.routes.iter().map(|(topic, ..)| topic);
        let found: Vec<_> = self.nodes().map(|node| node.name().to_owned()).collect();
        let names: Vec<_> = snapshot
            .nodes
            .iter()
            .map(|(name, _)| name.clone())
            .collect();
        if found != names || !own.by_ref().eq(saved.by_ref()) {
            return Err(SnapshotError::OtherNodes {
                saved: names,
                found,
            });
        }
        for (node, (name, saved)) in self.nodes.iter_mut().zip(&snapshot.nodes) {
            if !node.resume(saved) {
                return Err(SnapshotError::NotItsOwn { node: name.clone() });
            }
        }
        for (route, (_, sequence, latched)) in self.routes.iter_mut().zip(&snapshot.routes) {
            route.sequence = *sequence;
            route.latched.clone_from(latched);
        }
        self.now = snapshot.now;
        self.timers.clone_from(&snapshot.timers);
        self.inbox.clone_from(&snapshot.inbox);
        self.asked.clone_from(&snapshot.asked);
        self.next_id = snapshot.next_id;
        self.stopped.clone_from(&snapshot.stopped);
        Ok(())
    }
}
