//! Which warnings belong to the start of a run: states that a machine passes through until it is ready.
//!
//! Before its first program a control has its emergency stop released, its drives switched on, its axes homed; each of
//! these is a warning while it lasts. A node is starting from its first report on, where that comes before the first program
//! or soon after it is proposed, until it has had nothing to warn of for [`CALM`], and at the latest until a program has
//! touched something or ended. A warning that it gave and took back while it was starting is part of the start. A warning
//! that stays or comes again later is listed at the end, and so is every error.

use std::collections::{BTreeMap, BTreeSet};

use metrology::stamp::{Host, Span, Stamp};
use node_runtime::Level;

/// A node is ready after this time without a warning; a control shows its states within a second of each other.
const CALM: Span = Span::from_nanos(10_000_000_000);
/// A node that reports first later than this after the first program was proposed has no start.
const LATE: Span = Span::from_nanos(60_000_000_000);

/// One node that starts, or has started.
#[derive(Debug, Default)]
struct Starting {
    is_ready: bool,
    /// Warnings that last.
    standing: BTreeSet<String>,
    /// When the last of them ended.
    calm_since: Option<Stamp<Host>>,
    /// Warnings that it gave and took back until it was ready.
    passed: BTreeSet<String>,
}

/// The start of every node of a run.
#[derive(Debug, Default)]
pub struct StartUp {
    proposed: Option<Stamp<Host>>,
    has_worked: bool,
    nodes: BTreeMap<String, Starting>,
}

impl StartUp {
    /// A program is proposed to the controller, which may not be ready for it.
    pub fn propose(&mut self, at: Stamp<Host>) {
        self.proposed.get_or_insert(at);
    }

    /// A program has touched something or ended: the machine was ready.
    pub const fn work(&mut self) {
        self.has_worked = true;
    }

    /// Takes a condition; whether it belongs to the start of its node, as long as it is taken back in it.
    pub fn hear(&mut self, at: Stamp<Host>, node: &str, name: &str, level: Level) -> bool {
        let is_late = self.proposed.is_some_and(|proposed| at - proposed > LATE);
        let has_worked = self.has_worked;
        let starting = self
            .nodes
            .entry(node.to_owned())
            .or_insert_with(|| Starting {
                is_ready: is_late,
                ..Starting::default()
            });
        let is_calm = starting.calm_since.is_some_and(|since| at - since > CALM);
        starting.is_ready |= has_worked || is_calm;
        if level == Level::Ok {
            let had = starting.standing.remove(name);
            if had && !starting.is_ready {
                starting.passed.insert(name.to_owned());
            }
            if starting.standing.is_empty() {
                starting.calm_since.get_or_insert(at);
            }
            return false;
        }
        let is_of_start = level == Level::Warn && !starting.is_ready;
        starting.calm_since = None;
        if is_of_start {
            starting.standing.insert(name.to_owned());
        }
        is_of_start
    }

    /// Whether a warning of a node's start was taken back in it.
    #[must_use]
    pub fn has_passed(&self, node: &str, name: &str) -> bool {
        let node = self.nodes.get(node);
        node.is_some_and(|node| node.passed.contains(name))
    }
}
