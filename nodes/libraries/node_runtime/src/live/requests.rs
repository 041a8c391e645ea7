//! Requests of one client that wait for a server, and those that wait for an answer.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use tokio::time::Instant;

use crate::network::{Guid, RequestIdentity};
use crate::node::Bytes;

/// A server that sees us later than we see it would answer into the void.
const SERVER_SETTLING: Duration = Duration::from_millis(100);
/// After which a request counts as unanswered.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// When the answer to a request is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Due {
    /// Soon after it was sent.
    AtOnce,
    /// When a goal has ended: as long as one of the servers that got the request is there.
    AtTheEnd,
}

/// A request that nobody answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Unanswered {
    pub token: u64,
    /// Whether it went out: then a server may have got it.
    pub was_sent: bool,
}

struct Waiting {
    token: u64,
    bytes: Bytes,
    due: Due,
    /// A server that was killed is waited for no longer than that.
    sent_by: Instant,
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
    pub fn ask(&mut self, token: u64, bytes: Bytes, due: Due, now: Instant) {
        self.queue.push_back(Waiting {
            token,
            bytes,
            due,
            sent_by: now + ANSWER_TIMEOUT,
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
        if now.duration_since(*since) < SERVER_SETTLING {
            return None;
        }
        let waiting = self.queue.front()?;
        Some((*server, Bytes::clone(&waiting.bytes)))
    }

    /// The request that was due has gone out as `identity`.
    pub fn sent(&mut self, identity: RequestIdentity, now: Instant) {
        if let Some(Waiting { token, due, .. }) = self.queue.pop_front() {
            let asked = Asked {
                token,
                answered_by: (due == Due::AtOnce).then(|| now + ANSWER_TIMEOUT),
                of: self.servers.keys().copied().collect(),
            };
            self.asked.insert(identity, asked);
        }
    }

    /// The request that was due cannot be sent; its token.
    pub fn failed(&mut self) -> Option<u64> {
        self.queue.pop_front().map(|waiting| waiting.token)
    }

    /// The token of the request that a reply answers, once.
    pub fn answered(&mut self, identity: RequestIdentity) -> Option<u64> {
        self.asked.remove(&identity).map(|asked| asked.token)
    }

    /// The requests whose time is over.
    pub fn expired(&mut self, now: Instant) -> Vec<Unanswered> {
        let mut all = Vec::new();
        let mut give_up = |token, was_sent| all.push(Unanswered { token, was_sent });
        self.queue.retain(|waiting| {
            let is_over = waiting.sent_by <= now;
            if is_over {
                give_up(waiting.token, false);
            }
            !is_over
        });
        self.asked.retain(|_, asked| {
            let is_over = asked.answered_by.is_some_and(|limit| limit <= now);
            if is_over {
                give_up(asked.token, true);
            }
            !is_over
        });
        all
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
        requests.sent(NUMBER, now);
        Some(server)
    }

    #[test]
    fn a_request_waits_for_a_server_that_has_seen_us_and_is_answered_once() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.ask(7, shared(&[1]), Due::AtOnce, now);
        assert_eq!(send(&mut requests, now), None);
        requests.servers_are([SERVER].into_iter(), now);
        assert_eq!(send(&mut requests, now), None, "it may not see us yet");
        let later = now + SERVER_SETTLING;
        requests.servers_are([SERVER].into_iter(), later);
        assert_eq!(send(&mut requests, later), Some(SERVER));
        assert_eq!(requests.answered(NUMBER), Some(7));
        assert_eq!(requests.answered(NUMBER), None);
    }

    #[test]
    fn a_request_whose_server_died_before_it_was_sent_is_given_up() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.servers_are([SERVER].into_iter(), now);
        requests.ask(7, shared(&[1]), Due::AtTheEnd, now);
        requests.servers_are(std::iter::empty(), now);
        assert!(requests.expired(now + ANSWER_TIMEOUT / 2).is_empty());
        let given_up = Unanswered {
            token: 7,
            was_sent: false,
        };
        assert_eq!(requests.expired(now + ANSWER_TIMEOUT), [given_up]);
        assert!(!requests.is_waiting());
    }

    #[test]
    fn a_request_that_was_sent_late_has_all_its_time_for_the_answer() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.ask(7, shared(&[1]), Due::AtOnce, now);
        let late = now + ANSWER_TIMEOUT - SERVER_SETTLING;
        requests.servers_are([SERVER].into_iter(), late - SERVER_SETTLING);
        assert_eq!(send(&mut requests, late), Some(SERVER));
        assert!(requests.expired(now + ANSWER_TIMEOUT).is_empty());
        let given_up = Unanswered {
            token: 7,
            was_sent: true,
        };
        assert_eq!(requests.expired(late + ANSWER_TIMEOUT), [given_up]);
    }

    #[test]
    fn a_request_that_cannot_be_sent_makes_way_for_the_next() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.servers_are([SERVER].into_iter(), now);
        for token in [7, 8] {
            requests.ask(token, shared(&[1]), Due::AtOnce, now);
        }
        assert_eq!(requests.failed(), Some(7));
        assert_eq!(send(&mut requests, now + SERVER_SETTLING), Some(SERVER));
        assert_eq!(requests.answered(NUMBER), Some(8));
    }

    #[test]
    fn an_answer_without_a_limit_is_waited_for_while_a_server_is_there_that_got_the_request() {
        let (mut requests, now) = (Requests::default(), Instant::now());
        requests.servers_are([SERVER].into_iter(), now);
        requests.ask(7, shared(&[1]), Due::AtTheEnd, now);
        assert_eq!(send(&mut requests, now + SERVER_SETTLING), Some(SERVER));
        assert!(requests.expired(now + Duration::from_secs(3600)).is_empty());
        assert!(requests.abandoned().is_empty());
        requests.servers_are([OTHER].into_iter(), now);
        assert_eq!(requests.abandoned(), [7], "the other one never got it");
    }
}
