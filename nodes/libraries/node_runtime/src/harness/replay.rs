//! What a replay puts in the place of the nodes that are not there.
//!
//! A recording in total order says what came between what. A replay publishes what was recorded of absent nodes as
//! it meets it, and lets the present ones go on by single deliveries and ticks until they have said what comes next
//! in the recording. Since the inbox is first in, first out, a message that waits there a little longer is still
//! delivered in its turn.

use std::cmp::Reverse;
use std::sync::Arc;

use metrology::stamp::{Host, Span, Stamp};

use super::{Delivery, End, Event, Harness};

/// Who asked what was recorded: its answer goes nowhere.
pub(super) const NOBODY: End = (usize::MAX, usize::MAX);

impl Harness {
    /// The place of a topic in [`Harness::topics`], by its relative name.
    #[must_use]
    pub fn place_of_topic(&self, topic: &str) -> Option<usize> {
        let mut routes = self.routes.iter();
        routes.position(|route| route.port.topic == topic)
    }

    /// Sets the time, which never goes back.
    pub fn wait_until(&mut self, at: Stamp<Host>) {
        self.now = self.now.max(at);
    }

    /// Leaves out every tick before `at`; each timer goes on in its own rhythm.
    pub fn skip_ticks_before(&mut self, at: Stamp<Host>) {
        let timers = std::mem::take(&mut self.timers).into_iter();
        let timers = timers.map(|Reverse((due, node, timer))| {
            let period = self.periods[node][timer];
            Reverse((next_due(due, period, at), node, timer))
        });
        self.timers = timers.collect();
    }

    /// Publishes what an absent node said; it waits for [`Harness::deliver_next`].
    ///
    /// # Panics
    /// When there is no topic of that place.
    pub fn put(&mut self, topic: usize, bytes: &[u8]) {
        self.publish(topic, Arc::from(bytes));
    }

    /// Puts in the request of an absent node, given the message that tells of it on `topic`; false when it tells of
    /// another step of a call, or nobody offers the service.
    pub fn put_request(&mut self, topic: &str, event: &[u8]) -> bool {
        let Some(service) = topic.strip_suffix(abbe_msgs::SERVICE_EVENT_SUFFIX) else {
            return false;
        };
        let Some(&server) = self.service_servers.get(service) else {
            return false;
        };
        let events = self.nodes[server.0].ports().services[server.1].events;
        let Ok(Some(bytes)) = (events.request)(event) else {
            return false;
        };
        self.inbox.push_back(Delivery::Request {
            server,
            client: NOBODY,
            id: 0,
            bytes,
        });
        true
    }

    /// When the next timer is due.
    #[must_use]
    pub fn next_tick(&self) -> Option<Stamp<Host>> {
        self.timers.peek().map(|Reverse((due, ..))| *due)
    }

    /// Hands the next tick to its node, at its time; what follows from it waits.
    pub fn tick_next(&mut self) {
        if let Some(Reverse((due, node, timer))) = self.timers.pop() {
            self.now = due;
            let next = due + self.periods[node][timer];
            self.timers.push(Reverse((next, node, timer)));
            self.hand(node, Event::Timer { timer });
        }
    }

    /// Asks every node to stop; that waits too.
    pub fn ask_to_stop(&mut self) {
        for node in 0..self.nodes.len() {
            self.inbox.push_back(Delivery::Shutdown { node });
        }
    }
}

/// The first instant of a timer at or behind `at`; the latest instant there is where it would be later.
fn next_due(due: Stamp<Host>, period: Span, at: Stamp<Host>) -> Stamp<Host> {
    if due >= at {
        return due;
    }
    let (period, missing) = (
        i128::from(period.nanos().max(1)),
        i128::from(at.nanos()) - i128::from(due.nanos()),
    );
    let n_periods = (missing + period - 1) / period;
    let next = i128::from(due.nanos()) + n_periods * period;
    Stamp::from_nanos(i64::try_from(next).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_timer_goes_on_in_its_rhythm_behind_a_leap() {
        for (due, period, at, wanted) in [
            (100, 10, 50, 100),
            (100, 10, 100, 100),
            (100, 10, 101, 110),
            (100, 10, 110, 110),
            (100, 10, 1_000_000_007, 1_000_000_010),
            (-100, 30, -1, 20),
            (0, 7, i64::MAX, i64::MAX),
            (i64::MIN, 3, i64::MAX, i64::MAX),
            (0, 0, 5, 5),
        ] {
            let next = next_due(
                Stamp::from_nanos(due),
                Span::from_nanos(period),
                Stamp::from_nanos(at),
            );
            assert_eq!(next.nanos(), wanted, "{due} {period} {at}");
        }
    }
}
