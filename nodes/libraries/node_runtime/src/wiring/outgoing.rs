//! What leaves a node is what a reader of it would take.
//!
//! A NaN that a stage makes of good input would be refused by every node that hears it, each with an error of its own, and
//! would spoil the bag for good. It is refused here instead, once, by the node that made it.

use std::sync::atomic::{AtomicBool, Ordering};

use abbe_msgs::Wire;

use super::encode;
use crate::diagnostic::Diagnostic;
use crate::diagnostic::Level::{Error, Ok as Well};
use crate::node::Emission;

/// The guard of one publication.
pub(super) struct Outgoing {
    publication: usize,
    topic: String,
    /// Whether the last message was refused.
    refused: AtomicBool,
}

impl Outgoing {
    /// The guard of the publication with this number, of `topic`.
    pub(super) fn new(publication: usize, topic: String) -> Self {
        Self {
            publication,
            topic,
            refused: AtomicBool::new(false),
        }
    }

    /// Publishes a message that its readers can take. Any other is kept back, and `/diagnostics` has the reason until the
    /// next good one.
    pub(super) fn push<M: Wire>(&self, message: &M, out: &mut Vec<Emission>) {
        let refusal = message.to_inner().err();
        let was_refused = self.refused.swap(refusal.is_some(), Ordering::Relaxed);
        let topic = &self.topic;
        let (level, text) = match &refusal {
            Some(refusal) => (
                Error,
                format!("{topic}: {refusal}: not published, look at what this node was told"),
            ),
            None => (Well, format!("{topic}: published again")),
        };
        if refusal.is_some() || was_refused {
            let name = format!("output_refused/{topic}");
            out.push(Emission::Diagnostic(Diagnostic::new(level, name, text)));
        }
        if refusal.is_none() {
            out.push(Emission::Publish {
                publication: self.publication,
                bytes: encode(message),
            });
        }
    }
}
