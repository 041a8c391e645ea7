//! The first sample of a Fast DDS writer that has only just been met.
//!
//! A writer may know our reader before our reader knows it, and what it sends until then is dropped. The library's first
//! request to a new writer (count 0) is an empty one that begins at 1. Fast DDS takes it for an acknowledgement and says
//! what it has after 3 s; `ros2 topic pub --once` is gone by then, and a request to a service has waited. So Fast DDS is
//! asked for number 1 outright, under the counts that the library would use next: where it has used them already it has
//! heard of the writer, and Fast DDS does not listen to ours. A writer that has no number 1 any more, or not yet, does
//! nothing.

use std::collections::BTreeSet;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustdds::{DomainParticipant, GUID};

use super::rtps::asking_for_first;
use crate::network::Guid;

const FAST_VENDOR: [u8; 2] = [0x01, 0x0f];

/// The counts of our requests, and how long each waits: Fast DDS sends nothing again that it has only just sent.
const REQUESTS: [(u32, Duration); 2] = [
    (1, Duration::from_millis(10)),
    (2, Duration::from_millis(20)),
];

/// Our reliable readers, whose new writers are asked.
pub(super) struct FirstSamples {
    readers: Arc<Mutex<BTreeSet<Guid>>>,
}

impl FirstSamples {
    /// And what is to be called with each reader of ours that has met a writer, inside a runtime.
    pub fn of(
        participant: &DomainParticipant,
        socket: Arc<UdpSocket>,
    ) -> (Self, impl Fn(Guid, GUID) + Send + use<>) {
        let readers = Arc::new(Mutex::new(BTreeSet::new()));
        let ours = Arc::clone(&readers);
        let participant = participant.clone();
        let met = move |reader: Guid, remote: GUID| {
            let writer = remote.to_bytes();
            let is_ours = |of: &BTreeSet<Guid>| of.contains(&reader);
            if writer[..2] == FAST_VENDOR
                && is_ours(&ours.lock().unwrap_or_else(PoisonError::into_inner))
            {
                let addresses = addresses(&participant, remote);
                tokio::spawn(ask(Arc::clone(&socket), reader, writer, addresses));
            }
        };
        (Self { readers }, met)
    }

    /// Makes a reliable reader, and takes care of it.
    pub fn take_care<R, E>(
        &self,
        make: impl FnOnce() -> Result<R, E>,
        guid: impl FnOnce(&R) -> Guid,
    ) -> Result<R, E> {
        // Writers that are known already are met at once, and not asked before the reader is known here.
        let mut readers = self.readers.lock().unwrap_or_else(PoisonError::into_inner);
        let reader = make()?;
        readers.insert(guid(&reader));
        Ok(reader)
    }
}

async fn ask(socket: Arc<UdpSocket>, reader: Guid, writer: Guid, addresses: Vec<SocketAddr>) {
    for (count, pause) in REQUESTS {
        tokio::time::sleep(pause).await;
        let request = asking_for_first(&reader, &writer, count);
        for address in &addresses {
            let _ = socket.send_to(&request, address);
        }
    }
}

/// Where a writer listens.
fn addresses(participant: &DomainParticipant, writer: GUID) -> Vec<SocketAddr> {
    let all = participant.discovered_writers().into_iter();
    let proxies = all.map(|found| found.writer_proxy);
    let of_writer = proxies.filter(|proxy| proxy.remote_writer_guid == writer);
    let locators = of_writer.flat_map(|proxy| proxy.unicast_locator_list);
    let udp = locators.filter(|locator| locator.is_udp());
    udp.map(SocketAddr::from)
        .filter(SocketAddr::is_ipv4)
        .collect()
}
