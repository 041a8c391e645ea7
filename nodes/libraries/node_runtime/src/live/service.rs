//! Services: on DDS both mappings of requests and replies that ROS 2 has on the wire.
//!
//! Fast DDS's (`Enhanced`): the identity of a request travels in RTPS's related-sample-identity.
//! Cyclone DDS's: 16 bytes in front of the payload, the client's number and its request's number. We
//! speak to everybody in its own way: the vendor is in the first two bytes of every GUID. The 16
//! bytes keep the alignment of what follows, so that they are put on and taken off without a look
//! at the types. Zenoh names a request beside its payload and needs none of this.

use std::sync::Arc;

use tokio::time::Instant;

use super::requests::Requests;
use crate::dds::is_cyclone;
use crate::network::{Guid, PublishError, Remote, RequestIdentity, Role, Sample, Writer};
use crate::node::Bytes;

const CDR_HEADER_LEN: usize = 4;
const CYCLONE_LEN: usize = 16;

/// How the answer to a request finds its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReplyTo {
    Related(RequestIdentity),
    Cyclone([u8; CYCLONE_LEN]),
}

/// Takes `count` bytes out from behind the encapsulation header.
pub(super) fn take_front<const COUNT: usize>(bytes: &[u8]) -> Option<([u8; COUNT], Bytes)> {
    let (header, rest) = bytes.split_at_checked(CDR_HEADER_LEN)?;
    let (front, payload) = rest.split_first_chunk::<COUNT>()?;
    Some((*front, header.iter().chain(payload).copied().collect()))
}

/// Puts bytes in behind the encapsulation header.
pub(super) fn put_front(front: &[u8], bytes: &[u8]) -> Bytes {
    let (header, payload) = bytes.split_at(CDR_HEADER_LEN.min(bytes.len()));
    header.iter().chain(front).chain(payload).copied().collect()
}

/// Whether what a request is called stands in front of its payload. Zenoh's endpoints have names of any
/// bytes, and its samples always say what they relate to.
fn is_in_payload(sample: &Sample) -> bool {
    sample.related.is_none() && is_cyclone(&sample.writer)
}

/// A sample as a request; `None` when it is too short to be one.
pub(super) fn request(sample: Sample) -> Option<(ReplyTo, Bytes)> {
    if is_in_payload(&sample) {
        let (client, bytes) = take_front(&sample.bytes)?;
        return Some((ReplyTo::Cyclone(client), bytes));
    }
    let own = RequestIdentity {
        writer: sample.writer,
        sequence: sample.sequence,
    };
    let mut identity = sample.related.unwrap_or(own);
    // Fast DDS names its reply reader there and leaves the number unknown (-2^32).
    if identity.sequence < 0 {
        identity.sequence = sample.sequence;
    }
    Some((ReplyTo::Related(identity), sample.bytes))
}

/// A sample as a reply; `None` when it says not to what.
pub(super) fn reply(sample: Sample) -> Option<(RequestIdentity, Bytes)> {
    if is_in_payload(&sample) {
        let (front, bytes) = take_front::<CYCLONE_LEN>(&sample.bytes)?;
        return Some((cyclone_identity(front), bytes));
    }
    Some((sample.related?, sample.bytes))
}

/// The identity under which we look for a reply in Cyclone's mapping; the writer's first half is ours
/// alone and therefore zero.
fn cyclone_identity(front: [u8; CYCLONE_LEN]) -> RequestIdentity {
    let mut writer = [0; 16];
    let (client, number) = front.split_at(8);
    writer[8..].copy_from_slice(client);
    let mut sequence = [0; 8];
    sequence.copy_from_slice(number);
    RequestIdentity {
        writer,
        sequence: i64::from_le_bytes(sequence),
    }
}

/// The answering side.
pub(super) struct Server {
    pub name: String,
    pub writer: Writer,
}

impl Server {
    pub fn answer(&self, to: ReplyTo, bytes: &Bytes) -> Result<(), PublishError> {
        match to {
            ReplyTo::Related(identity) => self.writer.reply(bytes, identity),
            ReplyTo::Cyclone(client) => self.writer.publish(&put_front(&client, bytes), None),
        }
    }
}

/// The asking side. Requests wait until a server is there and has had time to find us too.
pub(super) struct Client {
    pub name: String,
    pub writer: Writer,
    pub requests: Requests,
    cyclone_requests: i64,
}

impl Client {
    pub fn new(name: String, writer: Writer) -> Self {
        Self {
            name,
            writer,
            requests: Requests::default(),
            cyclone_requests: 0,
        }
    }

    /// Looks whether a server is there, among everybody's writers and readers.
    pub fn look(&mut self, writers: &[Remote], readers: &[Remote], now: Instant) {
        let replies = writers
            .iter()
            .any(|writer| writer.is_of(Role::Reply, &self.name));
        let found = readers
            .iter()
            .filter(|reader| replies && reader.is_of(Role::Request, &self.name));
        self.requests
            .servers_are(found.map(|reader| reader.guid), now);
    }

    /// Sends what waits, if a server is there; with an error comes the token of the request that it is about.
    pub fn send(&mut self, now: Instant) -> Result<(), (Option<u64>, PublishError)> {
        while let Some((server, bytes)) = self.requests.next_to_send(now) {
            match self.publish(&server, &bytes) {
                Ok(identity) => self.requests.sent(identity, now),
                Err(error) => return Err((self.requests.failed(), error)),
            }
        }
        Ok(())
    }

    fn publish(&mut self, server: &Guid, bytes: &Bytes) -> Result<RequestIdentity, PublishError> {
        if !self.writer.meets_cyclone(server) {
            return self.writer.request(bytes);
        }
        self.cyclone_requests += 1;
        let mut front = [0; CYCLONE_LEN];
        front[..8].copy_from_slice(&self.writer.guid()[8..]);
        front[8..].copy_from_slice(&self.cyclone_requests.to_le_bytes());
        self.writer.publish(&put_front(&front, bytes), None)?;
        Ok(cyclone_identity(front))
    }
}

/// Serialised bytes as they are shared.
pub(super) fn shared(bytes: &[u8]) -> Bytes {
    Arc::from(bytes)
}

#[cfg(test)]
mod tests {
    use metrology::Stamp;

    use super::*;
    use crate::dds::CYCLONE_VENDOR;

    fn sample(writer: Guid, related: Option<RequestIdentity>, bytes: &[u8]) -> Sample {
        let received = Stamp::from_nanos(0);
        Sample {
            bytes: shared(bytes),
            writer,
            sequence: 7,
            source: None,
            received,
            related,
        }
    }

    #[test]
    fn cyclone_requests_lose_their_front_and_replies_get_it_back() {
        let mut writer = [9; 16];
        writer[..2].copy_from_slice(&CYCLONE_VENDOR);
        let mut bytes = vec![0, 1, 0, 0];
        bytes.extend(1..=16);
        bytes.extend([42, 43]);
        let (to, payload) = request(sample(writer, None, &bytes)).unwrap();
        assert_eq!(&payload[..], [0, 1, 0, 0, 42, 43]);
        let ReplyTo::Cyclone(client) = to else {
            panic!("not Cyclone's mapping")
        };
        assert_eq!(&put_front(&client, &payload)[..], &bytes[..]);
        assert!(request(sample(writer, None, &bytes[..12])).is_none());
    }

    #[test]
    fn other_requests_are_known_by_their_related_or_own_identity() {
        let writer = [1; 16];
        let bytes = [0, 1, 0, 0];
        let own = RequestIdentity {
            writer,
            sequence: 7,
        };
        let (to, _) = request(sample(writer, None, &bytes)).unwrap();
        assert_eq!(to, ReplyTo::Related(own));
        let fast = RequestIdentity {
            writer: [2; 16],
            sequence: -(1 << 32),
        };
        let (to, _) = request(sample(writer, Some(fast), &bytes)).unwrap();
        assert_eq!(
            to,
            ReplyTo::Related(RequestIdentity {
                sequence: 7,
                ..fast
            })
        );
    }
}
