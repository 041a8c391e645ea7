//! What a writer of ours says to a reader of Cyclone DDS before its first sample: that there is none yet.
//!
//! Such a reader begins where the first heartbeat that it hears says. RustDDS 0.15.1 sends one when it meets the reader,
//! which may not know our writer by then, and does not answer the reader's questions as long as nothing is written. The
//! first heartbeat that is heard then comes with the first samples; where more are being written meanwhile it counts them in,
//! and the reader takes those between for older than itself: they are lost though all is acknowledged. So the heartbeat
//! of a writer without samples is said some times more, under the count of the library's own first one: whoever has heard
//! a later one does not listen.

use std::collections::BTreeSet;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustdds::{DomainParticipant, GUID};

use super::is_cyclone;
use super::rtps::nothing_written;
use crate::network::Guid;

/// When it is said, after the time before.
const PAUSES: [Duration; 5] = [
    Duration::from_millis(10),
    Duration::from_millis(20),
    Duration::from_millis(70),
    Duration::from_millis(200),
    Duration::from_millis(700),
];

/// Our reliable writers, whose new readers are told.
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
