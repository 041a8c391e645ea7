//! Long replies, sent by hand besides by the DDS library.
//!
//! RustDDS 0.15.1 puts a byte too many in front of the inline quality of a sample that it sends in
//! fragments (`data_frag.rs` writes it as an `Option`, with its tag). Replies alone have such a
//! quality: it says which request is answered. So no one can read a reply that is longer than a
//! datagram, and a reliable reader waits for it for ever. Here the same sample goes out a second time,
//! under the same number and in right fragments; whoever has it acknowledges it to the library.

use std::collections::BTreeSet;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::Duration;

use rustdds::DomainParticipant;

use super::rtps::Fragmented;

/// When it is said again, after the time before: who misses a fragment asks the library, which cannot
/// help. Nobody takes a sample twice.
const AGAIN_AFTER: [Duration; 3] = [
    Duration::from_millis(50),
    Duration::from_millis(250),
    Duration::from_millis(1_000),
];

/// Datagrams for which every reader has room, and how long it gets to take them.
const BURST: usize = 32;
const BREATH: Duration = Duration::from_millis(1);

/// The way of the long replies of one service.
pub(super) struct LongReplies {
    socket: Arc<UdpSocket>,
    participant: DomainParticipant,
    topic: String,
}

impl LongReplies {
    /// `topic` is DDS's own name of that of the replies.
    pub fn new(socket: Arc<UdpSocket>, participant: DomainParticipant, topic: String) -> Self {
        Self {
            socket,
            participant,
            topic,
        }
    }

    /// Where the topic is read.
    fn readers(&self) -> BTreeSet<SocketAddr> {
        let all = self.participant.discovered_readers();
        let of_topic = all
            .into_iter()
            .filter(|reader| *reader.subscription_topic_data.topic_name() == self.topic);
        let locators = of_topic.flat_map(|reader| reader.reader_proxy.unicast_locator_list);
        let udp = locators.filter(|locator| locator.is_udp());
        udp.map(SocketAddr::from)
            .filter(SocketAddr::is_ipv4)
            .collect()
    }

    /// Sends a reply, now and some times more.
    pub fn send(&self, reply: &Fragmented<'_>) {
        // Replies come from a node's owner, which runs on one.
        let Ok(runtime) = tokio::runtime::Handle::try_current() else {
            return;
        };
        let (readers, datagrams) = (self.readers(), reply.datagrams());
        let socket = Arc::clone(&self.socket);
        runtime.spawn(async move {
            send(&socket, &readers, &datagrams).await;
            for pause in AGAIN_AFTER {
                tokio::time::sleep(pause).await;
                send(&socket, &readers, &datagrams).await;
            }
        });
    }
}

/// Sends datagrams to everybody. Who is not reached now may be the next time.
async fn send(socket: &UdpSocket, readers: &BTreeSet<SocketAddr>, datagrams: &[Vec<u8>]) {
    for burst in datagrams.chunks(BURST) {
        for datagram in burst {
            for reader in readers {
                let _ = socket.send_to(datagram, reader);
            }
        }
        if burst.len() == BURST {
            tokio::time::sleep(BREATH).await;
        }
    }
}
