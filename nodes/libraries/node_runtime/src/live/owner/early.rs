//! Requests that come before we know where their answer is read.
//!
//! A client asks when it sees both of our ends; we may see its reader of replies later, and an answer
//! until then reaches nobody. So the first request of a client waits until its reader is there.

use std::collections::BTreeSet;
use std::time::Duration;

use tokio::time::Instant;

use super::Owner;
use crate::live::service::ReplyTo;
use crate::network::Guid;
use crate::node::Bytes;

/// After this a request is answered all the same: its answer may be read elsewhere.
const READER_TIMEOUT: Duration = Duration::from_secs(1);
/// Between looks for readers while requests wait.
pub(super) const POLL: Duration = Duration::from_millis(5);
/// Requests that wait at most: further ones are taken at once.
const MOST_EARLY: usize = 256;
/// Clients that are remembered.
const MOST_CLIENTS: usize = 1_024;

/// A request as it came.
pub(super) struct Early {
    server: usize,
    client: Guid,
    to: ReplyTo,
    bytes: Bytes,
    until: Instant,
}

/// Requests that wait for the reader of their answer.
#[derive(Default)]
pub(in crate::live) struct Hearing {
    pub(super) early: Vec<Early>,
    /// Clients whose reader did not come in time: they wait no second time.
    unmet: BTreeSet<(usize, Guid)>,
}

impl Hearing {
    fn give_up(&mut self, server: usize, client: Guid) {
        if self.unmet.len() >= MOST_CLIENTS {
            self.unmet.clear();
        }
        self.unmet.insert((server, client));
    }

    fn is_behind(&self, server: usize, client: &Guid) -> bool {
        let mut waiting = self.early.iter();
        waiting.any(|early| (early.server, early.client) == (server, *client))
    }
}

impl Owner {
    /// Takes a request now, or keeps it until its client hears the answer.
    pub(super) fn request_of(&mut self, server: usize, client: &Guid, to: ReplyTo, bytes: Bytes) {
        let is_full = self.hearing.early.len() >= MOST_EARLY;
        let is_next = !self.hearing.is_behind(server, client) && self.is_heard(server, client);
        if is_next || is_full {
            self.request(server, to, &bytes);
            return;
        }
        self.hearing.early.push(Early {
            server,
            client: *client,
            to,
            bytes,
            until: Instant::now() + READER_TIMEOUT,
        });
    }

    /// Takes the requests whose clients hear the answer by now, or that have waited long enough.
    pub(super) fn take_early(&mut self, now: Instant) {
        for early in std::mem::take(&mut self.hearing.early) {
            let is_heard = self.is_heard(early.server, &early.client);
            if !is_heard && now < early.until {
                self.hearing.early.push(early);
                continue;
            }
            if !is_heard {
                self.hearing.give_up(early.server, early.client);
            }
            self.request(early.server, early.to, &early.bytes);
        }
    }

    fn is_heard(&self, server: usize, client: &Guid) -> bool {
        let writer = &self.servers[server].1.writer;
        self.participant.reaches(writer, client) || self.hearing.unmet.contains(&(server, *client))
    }
}
