//! A writer of ours tells a reader of Cyclone DDS that it has no samples yet.
//!
//! Such a reader starts at the first heartbeat that it gets. RustDDS 0.15.1 sends one when it matches the reader. The reader
//! may not know our writer by then, and RustDDS does not answer its questions before the first sample. The next heartbeat
//! comes with the first samples. It counts samples that are written but not sent, and the reader takes these for older ones:
//! they are lost although all are acknowledged. So we repeat the heartbeat of a writer without samples, with the count of
//! RustDDS's own first one. A reader that has a later heartbeat ignores it.

use std::collections::BTreeSet;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustdds::{DomainParticipant, GUID};

use super::is_cyclone;
use super::rtps::nothing_written;
use crate::network::Guid;

/// Pauses before each repetition.
const PAUSES: [Duration; 5] = [
    Duration::from_millis(10),
    Duration::from_millis(20),
    Duration::from_millis(70),
    Duration::from_millis(200),
    Duration::from_millis(700),
];

/// Our reliable writers; their new readers get the heartbeat.
pub(super) struct FirstWords {
    writers: Arc<Mutex<BTreeSet<Guid>>>,
}

impl FirstWords {
    /// And what is to be called with each writer of ours that has met a reader, inside a runtime.
    pub fn of(
        participant: &DomainParticipant,
        socket: Arc<UdpSocket>,
    ) -> (Self, impl Fn(Guid, GUID) + Send + use<>) {
        let writers = Arc::new(Mutex::new(BTreeSet::new()));
        let ours = Arc::clone(&writers);
        let participant = participant.clone();
        let met = move |writer: Guid, remote: GUID| {
            let reader = remote.to_bytes();
            let is_ours = |of: &BTreeSet<Guid>| of.contains(&writer);
            if is_cyclone(&reader) && is_ours(&ours.lock().unwrap_or_else(PoisonError::into_inner))
            {
                let addresses = addresses(&participant, remote);
                tokio::spawn(tell(Arc::clone(&socket), writer, reader, addresses));
            }
        };
        (Self { writers }, met)
    }

    /// Makes a reliable writer, and takes care of it.
    pub fn take_care<W, E>(
        &self,
        make: impl FnOnce() -> Result<W, E>,
        guid: impl FnOnce(&W) -> Guid,
    ) -> Result<W, E> {
        // Readers that are known already are met at once, and not told before the writer is known here.
        let mut writers = self.writers.lock().unwrap_or_else(PoisonError::into_inner);
        let writer = make()?;
        writers.insert(guid(&writer));
        Ok(writer)
    }
}

async fn tell(socket: Arc<UdpSocket>, writer: Guid, reader: Guid, addresses: Vec<SocketAddr>) {
    let datagram = nothing_written(&writer, &reader);
    for pause in PAUSES {
        tokio::time::sleep(pause).await;
        for address in &addresses {
            // Who is not reached now may be the next time.
            let _ = socket.send_to(&datagram, address);
        }
    }
}

/// Where a reader listens.
fn addresses(participant: &DomainParticipant, reader: GUID) -> Vec<SocketAddr> {
    let all = participant.discovered_readers().into_iter();
    let proxies = all.map(|found| found.reader_proxy);
    let of_reader = proxies.filter(|proxy| proxy.remote_reader_guid == reader);
    let locators = of_reader.flat_map(|proxy| proxy.unicast_locator_list);
    let udp = locators.filter(|locator| locator.is_udp());
    udp.map(SocketAddr::from)
        .filter(SocketAddr::is_ipv4)
        .collect()
}
