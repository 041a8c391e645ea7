//! Requests of one client that wait for a server, and those that wait for an answer.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use tokio::time::Instant;

use crate::network::{Guid, RequestIdentity};
use crate::node::Bytes;

/// A server that sees us later than we see it would answer into the void.
const SETTLING: Duration = Duration::from_millis(100);
/// After which a request counts as unanswered.
const PATIENCE: Duration = Duration::from_secs(5);

/// Until when a request waits.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// For a server to send it to: one that was killed is waited for no longer than that.
    pub sent_by: Instant,
    /// For the answer; `None`: as long as one of the servers that got it is there.
    pub answered_by: Option<Instant>,
}

impl Limits {
    /// Of a request that is answered at once.
    pub fn at_once(now: Instant) -> Self {
        Self {
            sent_by: now + PATIENCE,
            answered_by: Some(now + PATIENCE),
        }
    }

    /// Of a request that is answered when a goal has ended.
    pub fn at_the_end(now: Instant) -> Self {
        Self {
            sent_by: now + PATIENCE,
            answered_by: None,
        }
    }
}

struct Waiting {
    token: u64,
    bytes: Bytes,
    limits: Limits,
}

/// A request that is open.
struct Asked {
    token: u64,
    answered_by: Option<Instant>,
    /// The servers that were there: one that was started since never got it.
    of: BTreeSet<Guid>,
}

/// What one client has asked.
#[derive(Default)]
pub(super) struct Requests {
    queue: VecDeque<Waiting>,
    asked: BTreeMap<RequestIdentity, Asked>,
    /// The readers of servers, and since when each has been seen. Besides the one that answers there may be one that was
    /// killed and whose lease is not over.
    servers: BTreeMap<Guid, Instant>,
}

impl Requests {
    /// Asks under `token`.
    pub fn ask(&mut self, token: u64, bytes: Bytes, limits: Limits) {
        self.queue.push_back(Waiting {
            token,
            bytes,
            limits,
        });
    }

    /// Whether requests wait for their server.
    pub fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Whether requests wait for their answer.
    pub fn has_asked(&self) -> bool {
        !self.asked.is_empty()
    }

    /// The servers that are there now.
    pub fn servers_are(&mut self, found: impl Iterator<Item = Guid>, now: Instant) {
        let since = |guid: Guid| self.servers.get(&guid).copied().unwrap_or(now);
        self.servers = found.map(|guid| (guid, since(guid))).collect();
    }

    /// The request that is due, and a server that gets it. It stays due until it was [`Self::sent`].
    pub fn next_to_send(&self, now: Instant) -> Option<(Guid, Bytes)> {
        let (server, since) = self.servers.iter().max_by_key(|(_, since)| **since)?;
        if now.duration_since(*since) < SETTLING {
            return None;
        }
        let waiting = self.queue.front()?;
        Some((*server, Bytes::clone(&waiting.bytes)))
    }

    /// The request that was due has gone out as `identity`.
    pub fn sent(&mut self, identity: RequestIdentity) {
        if let Some(Waiting { token, limits, .. }) = self.queue.pop_front() {
            let asked = Asked {
                token,
                answered_by: limits.answered_by,
                of: self.servers.keys().copied().collect(),
            };
            self.asked.insert(identity, asked);
        }
    }

    /// The token of the request that a reply answers, once.
    pub fn answered(&mut self, identity: RequestIdentity) -> Option<u64> {
        self.asked.remove(&identity).map(|asked| asked.token)
    }

    /// Tokens of the requests whose time is over.
    pub fn expired(&mut self, now: Instant) -> Vec<u64> {
        let over = |limit: Option<Instant>| limit.is_some_and(|limit| limit <= now);
        let mut tokens = Vec::new();
        self.queue.retain(|waiting| {
            let Limits {
                sent_by,
                answered_by,
            } = waiting.limits;
            let expired = sent_by <= now || over(answered_by);
            if expired {
                tokens.push(waiting.token);
            }
            !expired
        });
        self.asked.retain(|_, asked| {
            let expired = over(asked.answered_by);
            if expired {
                tokens.push(asked.token);
            }
            !expired
        });
        tokens
    }

    /// Forgets open requests whose servers have all gone, also where another one is there by now; gives their tokens.
    pub fn abandoned(&mut self) -> Vec<u64> {
        let servers = &self.servers;
        let mut tokens = Vec::new();
        self.asked.retain(|_, asked| {
            let is_there = asked.of.iter().any(|server| servers.contains_key(server));
            if !is_there {
                tokens.push(asked.token);
            }
            is_there
        });
        tokens
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::service::shared;

    const SERVER: Guid = [1; 16];
    const OTHER: Guid = [2; 16];
    const NUMBER: RequestIdentity = RequestIdentity {
        writer: [3; 16],
        sequence: 1,
    };

    fn send(requests: &mut Requests, now: Instant) -> Option<Guid> {
        let (server, _) = requests.next_to_send(now)?;
        requests.sent(NUMBER);
        Some(server)
    }

    #[test]
    fn a_request_waits_for_a_server_that_has_seen_us_and_is_answered_once() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.ask(7, shared(&[1]), Limits::at_once(now));
        assert_eq!(send(&mut requests, now), None);
        requests.servers_are([SERVER].into_iter(), now);
        assert_eq!(send(&mut requests, now), None, "it may not see us yet");
        let later = now + SETTLING;
        requests.servers_are([SERVER].into_iter(), later);
        assert_eq!(send(&mut requests, later), Some(SERVER));
        assert_eq!(requests.answered(NUMBER), Some(7));
        assert_eq!(requests.answered(NUMBER), None);
    }

    #[test]
    fn a_request_whose_server_died_before_it_was_sent_is_given_up() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.servers_are([SERVER].into_iter(), now);
        requests.ask(7, shared(&[1]), Limits::at_the_end(now));
        requests.servers_are(std::iter::empty(), now);
        assert!(requests.expired(now + PATIENCE / 2).is_empty());
        assert_eq!(requests.expired(now + PATIENCE), [7]);
        assert!(!requests.is_waiting());
    }

    #[test]
    fn an_answer_without_a_limit_is_waited_for_while_a_server_is_there_that_got_the_request() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.servers_are([SERVER].into_iter(), now);
        requests.ask(7, shared(&[1]), Limits::at_the_end(now));
        assert_eq!(send(&mut requests, now + SETTLING), Some(SERVER));
        assert!(requests.expired(now + Duration::from_secs(3600)).is_empty());
        assert!(requests.abandoned().is_empty());
        requests.servers_are([OTHER].into_iter(), now);
        assert_eq!(requests.abandoned(), [7], "the other one never got it");
    }
}
