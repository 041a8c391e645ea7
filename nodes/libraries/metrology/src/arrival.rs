//! When something came from outside the graph, by the clock of the node that took it.

use std::fmt;

use crate::stamp::{Host, Stamp};

type Shown = dyn Fn(Stamp<Host>, Stamp<Host>) -> Stamp<Host> + Send;

/// Takes instants of the computer's clock over to the node's, which may go by another host's or be simulated.
///
/// What comes over a socket is stamped where it is read, by the computer's clock; the events of a node are stamped by the
/// node's. A stage that sees both must see them on one clock: its silences and deadlines are differences of the two.
#[derive(Default)]
pub struct ArrivalClock(Option<Box<Shown>>);

impl ArrivalClock {
    /// A clock by its rule: the instant of the event in which something is taken (node's clock) and the instant at which it
    /// came (computer's clock) give the instant at which it came by the node's clock.
    #[must_use]
    pub fn new(shown: impl Fn(Stamp<Host>, Stamp<Host>) -> Stamp<Host> + Send + 'static) -> Self {
        Self(Some(Box::new(shown)))
    }

    /// When something came, by the node's clock.
    #[must_use]
    pub fn shown(&self, taken_at: Stamp<Host>, came_at: Stamp<Host>) -> Stamp<Host> {
        self.0
            .as_ref()
            .map_or(came_at, |shown| shown(taken_at, came_at))
    }
}

impl fmt::Debug for ArrivalClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.0.is_some() {
            "by a rule"
        } else {
            "the computer's"
        };
        f.debug_tuple("ArrivalClock").field(&kind).finish()
    }
}
