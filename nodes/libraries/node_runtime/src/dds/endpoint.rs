//! Readers and writers of serialised samples: encapsulation header and CDR, in and out.

use std::borrow::Cow;
use std::convert::Infallible;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use futures::StreamExt;
use metrology::Stamp;
use metrology::stamp::{Host, NANOS_PER_S};
use rustdds::no_key::{self, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use rustdds::rpc::SampleIdentity;
use rustdds::{GUID, RepresentationIdentifier, SequenceNumber, Timestamp, WriteOptionsBuilder};

use super::reply::LongReplies;
use super::rtps::Fragmented;
use crate::clock::host_now;
use crate::network::{Guid, PublishError, RequestIdentity, Sample, check_encapsulation};
use crate::node::Bytes;

const CDR_HEADER_LEN: usize = 4;
const CDR_LE_HEADER: [u8; CDR_HEADER_LEN] = [0, 1, 0, 0];
const CDR_BE_HEADER: [u8; CDR_HEADER_LEN] = [0, 0, 0, 0];

/// Passes payloads through as they are, but for their end: RustDDS pads a sample to whole words unless it is sent in
/// fragments, and Cyclone DDS 0.10 refuses a last fragment that is not padded.
pub(super) struct Raw;

/// Submessages are whole words.
const ALIGNMENT: usize = 4;
/// Samples up to this length are never sent in fragments.
const UNFRAGMENTED_LEN: usize = 1024;

/// A sample, padded to whole words where it does not end with one.
fn whole_words(sample: &[u8]) -> Cow<'_, [u8]> {
    let mut sample = Cow::Borrowed(sample);
    let whole = sample.len().next_multiple_of(ALIGNMENT);
    if whole > sample.len() {
        sample.to_mut().resize(whole, 0);
    }
    sample
}

/// Decoder that only puts the header back in front.
#[derive(Clone)]
pub(super) struct Unparsed;

impl<'de> Decode<'de, Bytes> for Unparsed {
    type Error = Infallible;

    fn decode_bytes(
        self,
        payload: &'de [u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Bytes, Infallible> {
        let header = if encoding == RepresentationIdentifier::CDR_BE {
            CDR_BE_HEADER
        } else {
            CDR_LE_HEADER
        };
        Ok(header.iter().chain(payload).copied().collect())
    }
}

impl DeserializerAdapter<Bytes> for Raw {
    type Error = Infallible;
    type Decoded = Bytes;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[
            RepresentationIdentifier::CDR_LE,
            RepresentationIdentifier::CDR_BE,
        ]
    }

    fn transform_decoded(decoded: Bytes) -> Bytes {
        decoded
    }
}

impl DefaultDecoder<Bytes> for Raw {
    type Decoder = Unparsed;
    const DECODER: Unparsed = Unparsed;
}

impl SerializerAdapter<Bytes> for Raw {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Bytes) -> Result<rustdds::bytes::Bytes, Infallible> {
        if value.len() > UNFRAGMENTED_LEN
            && let Cow::Owned(padded) = whole_words(value)
        {
            return Ok(rustdds::bytes::Bytes::from(padded).slice(CDR_HEADER_LEN..));
        }
        let whole = rustdds::bytes::Bytes::from_owner(Arc::clone(value));
        Ok(whole.slice(CDR_HEADER_LEN.min(value.len())..))
    }
}

fn stamp(time: Timestamp) -> Stamp<Host> {
    let ticks = time.to_ticks();
    let nanos = (i128::from(ticks) * i128::from(NANOS_PER_S)) >> 32;
    Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}

/// When a sample came, if it is read `now`. RustDDS finds samples by their time and lets it never go back: where the clock was
/// set back, it stands still in the future until that has come.
///
/// A sample that waited for one before it, which was sent again, came with that one (`last`): else it would stand before it
/// in a bag by log time. Where `last` lies in the future the clock was set back.
fn received(instant: Timestamp, now: Stamp<Host>, last: Stamp<Host>) -> Stamp<Host> {
    let at = stamp(instant).min(now);
    if last <= now { at.max(last) } else { at }
}

fn timestamp(at: Stamp<Host>) -> Timestamp {
    let ticks = (i128::from(at.nanos()) << 32) / i128::from(NANOS_PER_S);
    u64::try_from(ticks).map_or(Timestamp::INVALID, Timestamp::from_ticks)
}

fn identity(identity: SampleIdentity) -> RequestIdentity {
    RequestIdentity {
        writer: identity.writer_guid.to_bytes(),
        sequence: i64::from(identity.sequence_number),
    }
}

/// Reads one topic.
pub(crate) struct Reader {
    reader: no_key::SimpleDataReader<Bytes, Raw>,
    /// When the last sample came, ns.
    last_nanos: AtomicI64,
}

impl Reader {
    pub(super) fn new(reader: no_key::SimpleDataReader<Bytes, Raw>) -> Self {
        Self {
            reader,
            last_nanos: AtomicI64::new(i64::MIN),
        }
    }

    fn received(&self, instant: Timestamp) -> Stamp<Host> {
        let last = Stamp::from_nanos(self.last_nanos.load(Ordering::Relaxed));
        let at = received(instant, host_now(), last);
        self.last_nanos.store(at.nanos(), Ordering::Relaxed);
        at
    }

    /// The next sample; an error is a sample that is no plain CDR.
    pub async fn next(&self) -> Result<Sample, String> {
        let mut stream = pin!(self.reader.as_async_stream());
        match stream.next().await {
            Some(Ok(change)) => Ok(Sample {
                writer: change.writer_guid().to_bytes(),
                sequence: i64::from(change.sequence_number),
                source: change.source_timestamp().map(stamp),
                received: self.received(change.receive_instant),
                related: change.related_sample_identity().map(identity),
                bytes: change.into_value(),
            }),
            Some(Err(error)) => Err(error.to_string()),
            // The stream of a reader has no end.
            None => std::future::pending().await,
        }
    }
}

/// Writes one topic; writing never waits.
pub(crate) struct Writer {
    writer: no_key::DataWriter<Bytes, Raw>,
    /// Of a service's server, where packets are not encrypted.
    long_replies: Option<LongReplies>,
}

impl Writer {
    pub(super) fn new(writer: no_key::DataWriter<Bytes, Raw>) -> Self {
        Self {
            writer,
            long_replies: None,
        }
    }

    /// Sends long replies by hand too.
    pub(super) fn with_long_replies(self, long_replies: LongReplies) -> Self {
        Self {
            long_replies: Some(long_replies),
            ..self
        }
    }

    pub fn guid(&self) -> Guid {
        use rustdds::RTPSEntity as _;
        self.writer.guid().to_bytes()
    }

    /// Sends a sample; `source` is its own time where it has one, else the present.
    pub fn publish(&self, bytes: &Bytes, source: Option<Stamp<Host>>) -> Result<(), PublishError> {
        let source = source.map_or_else(Timestamp::now, timestamp);
        self.send(bytes, source, None).map(drop)
    }

    /// Sends a reply.
    pub fn reply(&self, bytes: &Bytes, to: RequestIdentity) -> Result<(), PublishError> {
        let related = SampleIdentity {
            writer_guid: GUID::from_bytes(to.writer),
            sequence_number: SequenceNumber::from(to.sequence),
        };
        let source = Timestamp::now();
        let sent = self.send(bytes, source, Some(related))?;
        if let (true, Some(by_hand)) = (bytes.len() > UNFRAGMENTED_LEN, &self.long_replies) {
            by_hand.send(&Fragmented {
                writer: sent.writer,
                sequence: sent.sequence,
                source_ticks: source.to_ticks(),
                related: to,
                payload: &whole_words(bytes),
            });
        }
        Ok(())
    }

    /// Sends a request and says under which identity the reply will come.
    pub fn request(&self, bytes: &Bytes) -> Result<RequestIdentity, PublishError> {
        self.send(bytes, Timestamp::now(), None)
    }

    fn send(
        &self,
        bytes: &Bytes,
        source: Timestamp,
        related: Option<SampleIdentity>,
    ) -> Result<RequestIdentity, PublishError> {
        check_encapsulation(bytes)?;
        let options = WriteOptionsBuilder::new()
            .source_timestamp(source)
            .related_sample_identity_opt(related)
            .build();
        match self.writer.write_with_options(Arc::clone(bytes), options) {
            Ok(sent) => Ok(identity(sent)),
            Err(rustdds::dds::WriteError::WouldBlock { .. }) => Err(PublishError::Full),
            Err(error) => Err(PublishError::Broken(error.to_string())),
        }
    }

    /// Waits until every reliable reader has everything that was sent.
    pub async fn acknowledged(&self) {
        let _ = self.writer.async_wait_for_acknowledgments().await;
    }
}

#[cfg(test)]
mod tests {
    use metrology::stamp::Span;

    use super::*;

    #[test]
    fn times_survive_the_wire_to_the_nanosecond() {
        for nanos in [0, 1, 999_999_999, 1_763_000_000_123_456_789] {
            let there = Stamp::from_nanos(nanos);
            let back = stamp(timestamp(there));
            assert!(
                (back - there).nanos().abs() <= 1,
                "{nanos} came back as {}",
                back.nanos()
            );
        }
    }

    #[test]
    fn nothing_was_received_later_than_it_is_read() {
        let now = Stamp::from_nanos(1_763_000_000_000_000_000);
        let minute = Span::from_secs_f64(60.0);
        let before = now + Span::from_secs_f64(-0.25);
        let first = Stamp::from_nanos(i64::MIN);
        assert_eq!(received(timestamp(before), now, first), before);
        assert_eq!(received(timestamp(now + minute), now, first), now);
    }

    #[test]
    fn what_waited_for_a_sample_before_it_came_with_that_one_unless_the_clock_was_set_back() {
        let now = Stamp::from_nanos(1_763_000_000_000_000_000);
        let ago = |s: f64| now + Span::from_secs_f64(-s);
        assert_eq!(received(timestamp(ago(11.0)), now, ago(0.25)), ago(0.25));
        assert_eq!(received(timestamp(ago(0.25)), now, ago(11.0)), ago(0.25));
        assert_eq!(received(timestamp(ago(0.25)), now, ago(-60.0)), ago(0.25));
    }

    #[test]
    fn what_may_be_sent_in_fragments_ends_with_a_whole_word() {
        for (len, padded) in [(1023, 1023), (1025, 1028), (1494, 1496), (1496, 1496)] {
            let mut sent = vec![7; len];
            sent[..CDR_HEADER_LEN].copy_from_slice(&CDR_LE_HEADER);
            let payload = Raw::to_bytes(&Arc::from(sent.as_slice())).unwrap();
            assert_eq!(payload.len() + CDR_HEADER_LEN, padded);
            assert_eq!(payload[..len - CDR_HEADER_LEN], sent[CDR_HEADER_LEN..]);
        }
    }

    #[test]
    fn payloads_pass_unchanged() {
        let sent: Bytes = Arc::from([0, 1, 0, 0, 7, 8].as_slice());
        let payload = Raw::to_bytes(&sent).unwrap();
        assert_eq!(&payload[..], [7, 8]);
        let got = Unparsed
            .decode_bytes(&payload, RepresentationIdentifier::CDR_LE)
            .unwrap();
        assert_eq!(got, sent);
    }
}
