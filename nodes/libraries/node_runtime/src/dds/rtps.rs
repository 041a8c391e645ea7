//! What is sent past the DDS library, as RTPS 2.5 has it on the wire: a sample in fragments (8.3.8.3, 9.4.5.4), a
//! reader's request for a writer's first sample (8.3.8.1, 9.4.5.2), a writer's word that it has none yet, word that a participant is alive (8.3.8.2, 9.4.5.3), and
//! the announcement of one that only listens (8.5.3.2). And what is read past it: who announces itself.
//!
//! | part of a fragments' datagram | bytes |
//! |---|---|
//! | header: protocol, version, vendor, participant | 20 |
//! | `INFO_TS`: when the sample was written | 12 |
//! | `DATA_FRAG`: writer, number, place among the fragments | 36 |
//! | its inline quality: the request that is answered, under both names that are in use | 60 |
//! | up to five fragments | 1,280 |

use std::net::SocketAddrV4;

use crate::network::{Guid, RequestIdentity};

/// Bytes of a fragment: the library's own size, since a writer has one size for all (8.4.14.1.1).
const FRAGMENT_LEN: usize = 256;
/// What fits a datagram that no network cuts.
const FRAGMENTS_PER_DATAGRAM: usize = 5;

/// Bytes by which a participant is known.
pub(super) const PREFIX_LEN: usize = 12;
/// A participant.
pub(super) type Prefix = [u8; PREFIX_LEN];
/// Protocol, version, vendor, participant.
const RTPS_HEADER_LEN: usize = 20;
const VERSION: [u8; 2] = [2, 4];
const ACKNACK: u8 = 0x06;
const HEARTBEAT_SUBMESSAGE: u8 = 0x07;
const INFO_TS: u8 = 0x09;
const INFO_SRC: u8 = 0x0c;
const INFO_DST: u8 = 0x0e;
const DATA: u8 = 0x15;
const DATA_FRAG: u8 = 0x16;
const LITTLE_ENDIAN: u8 = 0x01;
const INLINE_QOS: u8 = 0x02;
/// There is a sample.
const CONTENT: u8 = 0x04;
/// The sample is a key alone: it ends what it is the key of.
const KEY: u8 = 0x08;
/// From behind itself to the payload, of a sample without inline quality.
const OCTETS_TO_PAYLOAD: u16 = 16;
/// By whom and for whom participants are announced (9.3.1.2).
const ANNOUNCER: [u8; 4] = [0, 1, 0, 0xc2];
const LISTENER: [u8; 4] = [0, 1, 0, 0xc7];
/// A participant itself, behind its prefix.
const PARTICIPANT: [u8; 4] = [0, 0, 1, 0xc1];
/// From behind itself to the inline quality.
const OCTETS_TO_INLINE_QOS: u16 = 28;
/// Every reader that is matched with the writer.
const ANY_READER: [u8; 4] = [0; 4];
/// The name of the standard, and Fast DDS's own from before it had one.
const RELATED_SAMPLE_IDENTITY: [u16; 2] = [0x0083, 0x800f];
const IDENTITY_LEN: u16 = 24;
const SENTINEL: u16 = 1;

/// A set that begins at its first number, has one place, and that place is taken.
const ONE_NUMBER: [u32; 2] = [1, 1 << 31];

/// A reply that is to be written.
pub(super) struct Fragmented<'a> {
    pub writer: Guid,
    pub sequence: i64,
    /// Seconds since 1970, times 2^32.
    pub source_ticks: u64,
    pub related: RequestIdentity,
    /// With its encapsulation header.
    pub payload: &'a [u8],
}

/// A submessage's head; its length is set when it is whole.
fn begin(datagram: &mut Vec<u8>, kind: u8, flags: u8) -> usize {
    datagram.extend([kind, flags, 0, 0]);
    datagram.len()
}

fn end(datagram: &mut [u8], begun: usize) {
    let len = u16::try_from(datagram.len() - begun).unwrap_or(0);
    datagram[begun - 2..begun].copy_from_slice(&len.to_le_bytes());
}

/// The head of what a participant sends.
fn from(participant: &[u8]) -> Vec<u8> {
    let mut datagram = b"RTPS".to_vec();
    datagram.extend(VERSION);
    // The first two bytes of a prefix are its vendor's.
    datagram.extend(&participant[..2]);
    datagram.extend(participant);
    datagram
}

/// The datagram by which a reader asks a writer for its first sample. A writer hears only a request whose `count` is
/// higher than that of the one before.
pub(super) fn asking_for_first(reader: &Guid, writer: &Guid, count: u32) -> Vec<u8> {
    let (participant, reader) = reader.split_at(PREFIX_LEN);
    let (whose, writer) = writer.split_at(PREFIX_LEN);
    let mut datagram = from(participant);
    let begun = begin(&mut datagram, INFO_DST, LITTLE_ENDIAN);
    datagram.extend(whose);
    end(&mut datagram, begun);
    let begun = begin(&mut datagram, ACKNACK, LITTLE_ENDIAN);
    datagram.extend(reader);
    datagram.extend(writer);
    put_halves(&mut datagram, 1);
    for number in ONE_NUMBER {
        datagram.extend(number.to_le_bytes());
    }
    datagram.extend(count.to_le_bytes());
    end(&mut datagram, begun);
    datagram
}

/// The datagram by which a writer tells a reader that it has written nothing yet (8.3.8.6, 9.4.5.7), under the count of
/// its first heartbeat.
pub(super) fn nothing_written(writer: &Guid, reader: &Guid) -> Vec<u8> {
    let (participant, writer) = writer.split_at(PREFIX_LEN);
    let (whose, reader) = reader.split_at(PREFIX_LEN);
    let mut datagram = from(participant);
    let begun = begin(&mut datagram, INFO_DST, LITTLE_ENDIAN);
    datagram.extend(whose);
    end(&mut datagram, begun);
    let begun = begin(&mut datagram, HEARTBEAT_SUBMESSAGE, LITTLE_ENDIAN);
    datagram.extend(reader);
    datagram.extend(writer);
    for number in [1, 0] {
        put_halves(&mut datagram, number);
    }
    datagram.extend(1_u32.to_le_bytes());
    end(&mut datagram, begun);
    datagram
}

/// Whom a datagram announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Announcement {
    /// It is there.
    Here(Prefix),
    /// It takes its leave.
    Gone(Prefix),
}

/// Who sends a datagram.
pub(super) fn sender(datagram: &[u8]) -> Option<Prefix> {
    let head = datagram.get(..RTPS_HEADER_LEN)?;
    let prefix = head.last_chunk().copied();
    prefix.filter(|_| head.starts_with(b"RTPS"))
}

/// Whom a datagram announces, where it does.
pub(super) fn announcement(datagram: &[u8]) -> Option<Announcement> {
    let prefix = sender(datagram)?;
    let mut rest = datagram.get(RTPS_HEADER_LEN..)?;
    while let Some((&[kind, flags, low, high], body)) = rest.split_first_chunk() {
        let len = if flags & LITTLE_ENDIAN == 0 {
            u16::from_be_bytes([low, high])
        } else {
            u16::from_le_bytes([low, high])
        };
        if kind == DATA && body.get(8..12) == Some(&ANNOUNCER) {
            let is_end = flags & KEY != 0;
            return Some(if is_end {
                Announcement::Gone(prefix)
            } else {
                Announcement::Here(prefix)
            });
        }
        // The last one may go without its length.
        rest = body.get(usize::from(len)..).filter(|_| len > 0)?;
    }
    None
}

/// The datagram by which `own` tells itself that `other` is alive: an announcement of it that has no content.
pub(super) fn alive(own: &Prefix, other: &Prefix) -> Vec<u8> {
    announcing(own, other, 1, &[])
}

/// The datagram by which `own` announces to itself a participant that listens for announcements at `addresses`, and does
/// nothing else (8.5.4.2, 9.6.2.2, 9.6.3). `number` counts its announcements.
pub(super) fn stand_in(
    own: &Prefix,
    other: &Prefix,
    number: u64,
    addresses: &[SocketAddrV4],
) -> Vec<u8> {
    /// Parameters in the order of the bytes of this computer's network: little-endian.
    const PARAMETERS: [u8; 4] = [0, 3, 0, 0];
    /// It listens for announcements of participants.
    const DETECTOR: u32 = 1 << 1;
    /// A locator is of UDP over IPv4.
    const UDP_V4: u32 = 1;
    /// How long it is believed, s.
    const LEASE_S: u32 = 60;
    let mut content = PARAMETERS.to_vec();
    let mut put = |name: u16, parts: &[&[u8]]| {
        let len = parts.iter().map(|part| part.len()).sum::<usize>();
        content.extend(name.to_le_bytes());
        content.extend(u16::try_from(len).unwrap_or(0).to_le_bytes());
        content.extend(parts.concat());
    };
    put(0x0015, &[&VERSION, &[0, 0]]);
    put(0x0016, &[&other[..2], &[0, 0]]);
    put(0x0050, &[other, &PARTICIPANT]);
    for address in addresses {
        let port = u32::from(address.port()).to_le_bytes();
        let ip = address.ip().octets();
        put(0x0032, &[&UDP_V4.to_le_bytes(), &port, &[0; 12], &ip]);
    }
    put(0x0058, &[&DETECTOR.to_le_bytes()]);
    put(0x0002, &[&LEASE_S.to_le_bytes(), &[0; 4]]);
    put(SENTINEL, &[]);
    announcing(own, other, number, &content)
}

/// An announcement of `other`, told by `own` in its name.
fn announcing(own: &Prefix, other: &Prefix, number: u64, content: &[u8]) -> Vec<u8> {
    let mut datagram = from(own);
    let begun = begin(&mut datagram, INFO_SRC, LITTLE_ENDIAN);
    datagram.extend([0; 4]);
    datagram.extend(VERSION);
    datagram.extend(&other[..2]);
    datagram.extend(other);
    end(&mut datagram, begun);
    let has_content = if content.is_empty() { 0 } else { CONTENT };
    let begun = begin(&mut datagram, DATA, LITTLE_ENDIAN | has_content);
    datagram.extend([0, 0]);
    datagram.extend(OCTETS_TO_PAYLOAD.to_le_bytes());
    datagram.extend(LISTENER);
    datagram.extend(ANNOUNCER);
    put_halves(&mut datagram, number);
    datagram.extend(content);
    end(&mut datagram, begun);
    datagram
}

/// The halves of a 64-bit number, the higher one first.
fn put_halves(datagram: &mut Vec<u8>, number: u64) {
    let [a, b, c, d, e, f, g, h] = number.to_le_bytes();
    datagram.extend([e, f, g, h, a, b, c, d]);
}

impl Fragmented<'_> {
    /// The datagrams that carry it, for whoever is matched with the writer.
    pub fn datagrams(&self) -> Vec<Vec<u8>> {
        let runs = self.payload.chunks(FRAGMENT_LEN * FRAGMENTS_PER_DATAGRAM);
        let first = (1..).step_by(FRAGMENTS_PER_DATAGRAM);
        first
            .zip(runs)
            .map(|(first, run)| self.datagram(first, run))
            .collect()
    }

    fn datagram(&self, first: u32, run: &[u8]) -> Vec<u8> {
        let (prefix, entity) = self.writer.split_at(PREFIX_LEN);
        let mut datagram = from(prefix);
        let begun = begin(&mut datagram, INFO_TS, LITTLE_ENDIAN);
        put_halves(&mut datagram, self.source_ticks);
        end(&mut datagram, begun);

        let begun = begin(&mut datagram, DATA_FRAG, LITTLE_ENDIAN | INLINE_QOS);
        datagram.extend([0, 0]);
        datagram.extend(OCTETS_TO_INLINE_QOS.to_le_bytes());
        datagram.extend(ANY_READER);
        datagram.extend(entity);
        put_halves(&mut datagram, self.sequence.cast_unsigned());
        datagram.extend(first.to_le_bytes());
        for count in [run.len().div_ceil(FRAGMENT_LEN), FRAGMENT_LEN] {
            datagram.extend(u16::try_from(count).unwrap_or(0).to_le_bytes());
        }
        let whole = u32::try_from(self.payload.len()).unwrap_or(u32::MAX);
        datagram.extend(whole.to_le_bytes());
        for name in RELATED_SAMPLE_IDENTITY {
            datagram.extend(name.to_le_bytes());
            datagram.extend(IDENTITY_LEN.to_le_bytes());
            datagram.extend(self.related.writer);
            put_halves(&mut datagram, self.related.sequence.cast_unsigned());
        }
        datagram.extend(SENTINEL.to_le_bytes());
        datagram.extend([0, 0]);
        datagram.extend(run);
        end(&mut datagram, begun);
        datagram
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD_LEN: usize = 128;
    /// What RustDDS allows itself where it does not know the way.
    const MOST_BYTES: usize = 1_452;

    fn reply(payload: &[u8]) -> Vec<Vec<u8>> {
        let mut writer = [7; 16];
        writer[..2].copy_from_slice(&[1, 18]);
        let related = RequestIdentity {
            writer: [9; 16],
            sequence: 3,
        };
        let reply = Fragmented {
            writer,
            sequence: 0x1_0000_0002,
            source_ticks: (5 << 32) | 6,
            related,
            payload,
        };
        reply.datagrams()
    }

    fn number(bytes: &[u8]) -> usize {
        let digits = bytes.iter().rev();
        digits.fold(0, |sum, byte| (sum << 8) | usize::from(*byte))
    }

    #[test]
    fn fragments_put_together_are_the_sample() {
        let payload: Vec<u8> = (0..=u8::MAX).cycle().take(4_004).collect();
        let datagrams = reply(&payload);
        assert_eq!(datagrams.len(), 4);
        let mut together: Vec<u8> = Vec::new();
        for datagram in &datagrams {
            assert!(datagram.len() <= MOST_BYTES);
            assert_eq!(number(&datagram[34..36]), datagram.len() - 36);
            assert_eq!(number(&datagram[56..60]), together.len() / 256 + 1);
            let run = &datagram[HEAD_LEN..];
            assert_eq!(number(&datagram[60..62]), run.len().div_ceil(256));
            assert_eq!(number(&datagram[62..64]), 256);
            assert_eq!(number(&datagram[64..68]), payload.len());
            together.extend(run);
        }
        assert_eq!(together, payload);
    }

    #[test]
    fn a_datagram_says_who_wrote_what_when_and_in_answer_to_what() {
        let datagram = &reply(&[1, 2, 3, 4])[0];
        assert_eq!(datagram[..10], *b"RTPS\x02\x04\x01\x12\x01\x12");
        assert_eq!(datagram[20..32], [9, 1, 8, 0, 5, 0, 0, 0, 6, 0, 0, 0]);
        assert_eq!(datagram[32..34], [0x16, 3]);
        assert_eq!(datagram[36..44], [0, 0, 28, 0, 0, 0, 0, 0]);
        assert_eq!(datagram[44..56], [7, 7, 7, 7, 1, 0, 0, 0, 2, 0, 0, 0]);
        for (place, name) in [(68, [0x83, 0]), (96, [0x0f, 0x80])] {
            assert_eq!(datagram[place..place + 2], name);
            assert_eq!(datagram[place + 2..place + 4], [24, 0]);
            assert_eq!(datagram[place + 4..place + 20], [9; 16]);
            assert_eq!(datagram[place + 20..place + 28], [0, 0, 0, 0, 3, 0, 0, 0]);
        }
        assert_eq!(datagram[124..], [1, 0, 0, 0, 1, 2, 3, 4]);
    }

    #[test]
    fn a_reader_asks_for_number_one_alone() {
        let datagram = asking_for_first(&[7; 16], &[9; 16], 1);
        assert_eq!(datagram[..10], *b"RTPS\x02\x04\x07\x07\x07\x07");
        assert_eq!(datagram[20..24], [0x0e, 1, 12, 0]);
        assert_eq!(datagram[24..36], [9; 12]);
        assert_eq!(datagram[36..40], [6, 1, 28, 0]);
        assert_eq!(datagram[40..48], [7, 7, 7, 7, 9, 9, 9, 9]);
        assert_eq!(datagram[48..56], [0, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(datagram[56..], [1, 0, 0, 0, 0, 0, 0, 128, 1, 0, 0, 0]);
    }

    /// Bytes as RTPS 2.5 has them: 9.4.5.7 (HEARTBEAT).
    #[test]
    fn a_writer_without_samples_says_from_one_to_none() {
        let datagram = nothing_written(&[9; 16], &[7; 16]);
        assert_eq!(sender(&datagram), Some([9; PREFIX_LEN]));
        assert_eq!(datagram[24..36], [7; 12]);
        assert_eq!(datagram[36..40], [7, 1, 28, 0]);
        assert_eq!(datagram[40..48], [7, 7, 7, 7, 9, 9, 9, 9]);
        assert_eq!(
            datagram[48..64],
            [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
        );
        assert_eq!(datagram[64..], [1, 0, 0, 0]);
    }

    #[test]
    fn who_announces_itself_is_read_behind_any_other_submessage() {
        let mut datagram = from(&[7; PREFIX_LEN]);
        let begun = begin(&mut datagram, INFO_TS, LITTLE_ENDIAN);
        datagram.extend([0; 8]);
        end(&mut datagram, begun);
        for (flags, said) in [
            (0x05, Announcement::Here([7; PREFIX_LEN])),
            (0x09, Announcement::Gone([7; PREFIX_LEN])),
        ] {
            let mut datagram = datagram.clone();
            let begun = begin(&mut datagram, DATA, flags);
            datagram.extend([0, 0, 16, 0]);
            datagram.extend(LISTENER);
            datagram.extend(ANNOUNCER);
            datagram.extend([0; 8]);
            end(&mut datagram, begun);
            assert_eq!(announcement(&datagram), Some(said));
            for len in 0..44 {
                assert_eq!(announcement(&datagram[..len]), None);
            }
        }
        assert_eq!(announcement(&asking_for_first(&[7; 16], &[9; 16], 1)), None);
        assert_eq!(announcement(b"no RTPS, however long it may be"), None);
    }

    #[test]
    fn who_is_said_to_be_alive_is_the_source_of_an_empty_announcement() {
        let datagram = alive(&[7; PREFIX_LEN], &[9; PREFIX_LEN]);
        assert_eq!(datagram[8..20], [7; 12]);
        assert_eq!(datagram[20..32], [0x0c, 1, 20, 0, 0, 0, 0, 0, 2, 4, 9, 9]);
        assert_eq!(datagram[32..44], [9; 12]);
        assert_eq!(datagram[44..52], [0x15, 1, 20, 0, 0, 0, 16, 0]);
        assert_eq!(datagram[52..60], [0, 1, 0, 0xc7, 0, 1, 0, 0xc2]);
        assert_eq!(datagram[60..], [0, 0, 0, 0, 1, 0, 0, 0]);
    }

    /// Bytes as RTPS 2.5 has them: 9.4.5.4 (DATA), 9.4.2.11 (parameter list), table 9.13 (names of parameters).
    #[test]
    fn a_stand_in_is_an_announcement_with_its_addresses() {
        let addresses = [SocketAddrV4::new([10, 0, 0, 7].into(), 7_410)];
        let datagram = stand_in(&[7; PREFIX_LEN], &[9; PREFIX_LEN], 3, &addresses);
        assert_eq!(sender(&datagram), Some([7; PREFIX_LEN]));
        assert_eq!(datagram[44..46], [0x15, 5]);
        assert_eq!(number(&datagram[46..48]), datagram.len() - 48);
        assert_eq!(datagram[60..72], [0, 0, 0, 0, 3, 0, 0, 0, 0, 3, 0, 0]);
        let mut parameters = vec![];
        let mut rest = &datagram[72..];
        while let Some((head, behind)) = rest.split_first_chunk::<4>() {
            let (name, len) = (number(&head[..2]), number(&head[2..]));
            parameters.push((name, behind[..len].to_vec()));
            rest = &behind[len..];
        }
        let guid = [[9; 12].as_slice(), &[0, 0, 1, 0xc1]].concat();
        let port_and_ip = [[0xf2, 0x1c, 0, 0].as_slice(), &[0; 12], &[10, 0, 0, 7]].concat();
        let locator = [[1, 0, 0, 0].as_slice(), &port_and_ip].concat();
        let wanted = [
            (0x15, vec![2, 4, 0, 0]),
            (0x16, vec![9, 9, 0, 0]),
            (0x50, guid),
            (0x32, locator),
            (0x58, vec![2, 0, 0, 0]),
            (0x02, vec![60, 0, 0, 0, 0, 0, 0, 0]),
            (0x01, vec![]),
        ];
        assert_eq!(parameters, wanted);
    }
}
