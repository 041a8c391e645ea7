//! Whose messages come on a topic, for a stage that follows one publisher alone.

use abbe_msgs::Wire;
use abbe_msgs::topics::Topic;
use metrology::stamp::{Host, Stamp};
use metrology::{Author, Stage};

use super::Wiring;

/// Tells a stage who speaks on a topic.
pub(super) type Heard<S> = Box<dyn Fn(&mut S, Stamp<Host>, Author) + Send>;

impl<S: Stage> Wiring<S> {
    /// Tells the stage, before each message of a topic that it listens to, whose it is; on a live graph alone.
    #[must_use]
    pub fn authors_of<M: Wire>(
        mut self,
        topic: &Topic<M>,
        told: impl Fn(&mut S, Stamp<Host>, Author) + Send + 'static,
    ) -> Self {
        self.authors.push((topic.name.to_owned(), Box::new(told)));
        self
    }

    pub(super) fn hear_from(&mut self, at: Stamp<Host>, subscription: usize, author: Author) {
        let port = self.ports.subscriptions.get(subscription);
        for (topic, told) in &self.authors {
            if port.is_some_and(|port| port.topic == *topic) {
                told(&mut self.stage, at, author);
            }
        }
    }
}
