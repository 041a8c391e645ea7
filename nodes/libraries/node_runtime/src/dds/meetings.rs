//! Which readers of others each writer of ours sends to, by the events of the DDS library.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use futures::StreamExt;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, StatusEvented};
use tokio::task::JoinHandle;

use crate::network::Guid;

/// The part of a GUID that names the participant.
const PREFIX_LEN: usize = 12;

/// Writers of ours, each with a reader of others that it sends to.
type Met = Arc<Mutex<BTreeSet<(Guid, Guid)>>>;

/// Listens to the library while it is there.
pub(super) struct Meetings {
    met: Met,
    listening: JoinHandle<()>,
}

impl Meetings {
    /// `on_writer` is called with each reader of ours that has matched a writer of others, `on_reader` with each writer
    /// that has matched a reader. Must be made inside a runtime.
    pub fn of(
        participant: &DomainParticipant,
        on_writer: impl Fn(Guid, GUID) + Send + 'static,
        on_reader: impl Fn(Guid, GUID) + Send + 'static,
    ) -> Self {
        let met = Met::default();
        let ours = Arc::clone(&met);
        let participant = participant.clone();
        let listening = tokio::spawn(async move {
            let listener = participant.status_listener();
            let mut events = listener.as_async_status_stream();
            while let Some(event) = events.next().await {
                let met = || ours.lock().unwrap_or_else(PoisonError::into_inner);
                match event {
                    DomainParticipantStatusEvent::RemoteReaderMatched {
                        local_writer,
                        remote_reader,
                    } => {
                        met().insert((local_writer.to_bytes(), remote_reader.to_bytes()));
                        on_reader(local_writer.to_bytes(), remote_reader);
                    }
                    DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                        let gone = guid.to_bytes();
                        met().retain(|(_, reader)| *reader != gone);
                    }
                    // Of a client that was killed or is cut off nothing else is said.
                    DomainParticipantStatusEvent::ParticipantLost { id, .. } => {
                        met().retain(|(_, reader)| reader[..PREFIX_LEN] != *id.as_ref());
                    }
                    DomainParticipantStatusEvent::RemoteWriterMatched {
                        local_reader,
                        remote_writer,
                    } => on_writer(local_reader.to_bytes(), remote_writer),
                    _ => {}
                }
            }
        });
        Self { met, listening }
    }

    /// Whether a writer of ours sends to a reader of the participant that `other` is of.
    pub fn reaches(&self, writer: Guid, other: &Guid) -> bool {
        let met = self.met.lock().unwrap_or_else(PoisonError::into_inner);
        is_met(&met, writer, other)
    }
}

fn is_met(met: &BTreeSet<(Guid, Guid)>, writer: Guid, other: &Guid) -> bool {
    let (mut first, mut last) = ([0; 16], [0xff; 16]);
    first[..PREFIX_LEN].copy_from_slice(&other[..PREFIX_LEN]);
    last[..PREFIX_LEN].copy_from_slice(&other[..PREFIX_LEN]);
    met.range((writer, first)..=(writer, last)).next().is_some()
}

impl Drop for Meetings {
    fn drop(&mut self) {
        self.listening.abort();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_writer_reaches_the_participants_whose_readers_it_has_met_and_no_others() {
        let guid = |prefix: u8, entity: u8| {
            let mut guid = [prefix; 16];
            guid[PREFIX_LEN..].fill(entity);
            guid
        };
        let (ours, beside) = (guid(1, 7), guid(1, 8));
        let met = BTreeSet::from([(ours, guid(5, 3)), (beside, guid(6, 3))]);
        assert!(is_met(&met, ours, &guid(5, 0)) && is_met(&met, ours, &guid(5, 255)));
        assert!(!is_met(&met, ours, &guid(6, 3)), "met by another writer");
        assert!(!is_met(&met, ours, &guid(4, 3)) && !is_met(&met, guid(2, 7), &guid(5, 3)));
    }
}
