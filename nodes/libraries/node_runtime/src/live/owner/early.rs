//! Requests that come before we know where their answer is read.
//!
//! A client asks when it sees both of our ends; we may see its reader of replies later, and an answer
//! until then reaches nobody. So the first request of a client waits until its reader is there.

use std::collections::BTreeMap;
use std::time::Duration;

use tokio::time::Instant;

use super::Owner;
use crate::live::service::ReplyTo;
use crate::network::{Guid, Role};
use crate::node::Bytes;

/// The part of a GUID that names the participant.
type Prefix = [u8; 12];

/// From discovery to a writer that knows its reader.
const WRITER_SETTLING: Duration = Duration::from_millis(20);
/// After this a request is answered all the same: its answer may be read elsewhere.
const READER_TIMEOUT: Duration = Duration::from_secs(1);
/// Between looks for readers while requests wait.
pub(super) const POLL: Duration = Duration::from_millis(5);
/// Clients that are remembered.
const MOST_CLIENTS: usize = 1_024;

/// A request as it came.
pub(super) struct Early {
    server: usize,
    client: Prefix,
    to: ReplyTo,
    bytes: Bytes,
    until: Instant,
}

/// Who hears our answers, and who does not yet.
#[derive(Default)]
pub(in crate::live) struct Hearing {
    since: BTreeMap<(usize, Prefix), Instant>,
    pub(super) early: Vec<Early>,
}

fn prefix(guid: &Guid) -> Prefix {
    let mut prefix = [0; 12];
    prefix.copy_from_slice(&guid[..12]);
    prefix
}

impl Hearing {
    /// Whether a client hears a server's answers; `looks` says whether its reader is seen now.
    fn hears(&mut self, of: (usize, Prefix), now: Instant, looks: impl FnOnce() -> bool) -> bool {
        match self.since.get(&of) {
            Some(since) => now.duration_since(*since) >= WRITER_SETTLING,
            None => {
                if looks() {
                    if self.since.len() >= MOST_CLIENTS {
                        self.since.clear();
                    }
                    self.since.insert(of, now);
                }
                false
            }
        }
    }
}

impl Owner {
    /// Takes a request now, or keeps it until its client hears the answer.
    pub(super) fn request_of(&mut self, server: usize, client: &Guid, to: ReplyTo, bytes: Bytes) {
        let (client, now) = (prefix(client), Instant::now());
        let mut waiting = self.hearing.early.iter();
        let is_behind = waiting.any(|early| (early.server, early.client) == (server, client));
        if !is_behind && self.is_heard(server, client, now) {
            self.request(server, to, &bytes);
            return;
        }
        self.hearing.early.push(Early {
            server,
            client,
            to,
            bytes,
            until: now + READER_TIMEOUT,
        });
    }

    /// Takes the requests whose clients hear the answer by now, or that have waited long enough.
    pub(super) fn take_early(&mut self, now: Instant) {
        for early in std::mem::take(&mut self.hearing.early) {
            if now >= early.until || self.is_heard(early.server, early.client, now) {
                self.request(early.server, early.to, &early.bytes);
            } else {
                self.hearing.early.push(early);
            }
        }
    }

    fn is_heard(&mut self, server: usize, client: Prefix, now: Instant) -> bool {
        let (participant, name) = (&self.participant, &self.servers[server].1.name);
        if !participant.must_see_clients() {
            return true;
        }
        self.hearing.hears((server, client), now, || {
            let mut readers = participant.readers().into_iter();
            readers.any(|reader| reader.is_of(Role::Reply, name) && reader.guid[..12] == client)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_is_heard_a_moment_after_its_reader_was_seen() {
        let mut hearing = Hearing::default();
        let (now, client) = (Instant::now(), (3, [7; 12]));
        assert!(!hearing.hears(client, now, || false), "no reader yet");
        assert!(!hearing.hears(client, now, || true), "just seen");
        let later = now + WRITER_SETTLING;
        assert!(hearing.hears(client, later, || panic!("known by now")));
        assert!(
            !hearing.hears((4, [7; 12]), later, || false),
            "another service"
        );
    }
}
