//! A participant that is heard where it says that it listens.
//!
//! The wire gives the n-th participant of a computer one port for discovery and one for samples (RTPS 2.5, 9.6.2.3). RustDDS
//! takes the first n whose port for discovery is free; where somebody has the other one it listens elsewhere and tells the
//! readers of its writers the port that it has not. What they ask for again is then lost, and a latched message with it.
//! Others take the two ports one by one (Fast DDS), so that this happens where both start at once.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;

use anyhow::bail;
use procfs::process::{FDTarget, Process};
use rustdds::DomainParticipant;

/// Participants that are made before it is given up.
const MOST_TRIES: usize = 16;

/// The port of a domain where participants announce themselves to all.
pub(super) const fn announcement_port(domain: u16) -> u16 {
    7400 + 250 * domain
}

/// The port of a domain where samples for all come to.
pub(super) const fn common_sample_port(domain: u16) -> u16 {
    announcement_port(domain) + 1
}

/// The port for discovery of the `participant`-th participant of a computer, from 0.
pub(super) const fn discovery_port(domain: u16, participant: u16) -> u16 {
    announcement_port(domain) + 10 + 2 * participant
}

/// The port for samples of the `participant`-th participant of a computer, from 0.
pub(super) const fn sample_port(domain: u16, participant: u16) -> u16 {
    discovery_port(domain, participant) + 1
}

/// This thread: it may be in another network than the process' first one, of which `/proc/self/net` tells.
fn this_thread() -> Option<Process> {
    let place = std::fs::read_link("/proc/thread-self").ok()?;
    Process::new_with_root(Path::new("/proc").join(place)).ok()
}

/// Whether this process listens to a UDP port on all addresses; where the system does not say, it is taken to.
fn listens(port: u16) -> bool {
    let everywhere = SocketAddr::new(IpAddr::V4(Ipv4Addr::UNSPECIFIED), port);
    let told = this_thread().and_then(|thread| Some((thread.udp().ok()?, thread.fd().ok()?)));
    let Some((sockets, descriptors)) = told else {
        return true;
    };
    let own: Vec<u64> = descriptors
        .flatten()
        .filter_map(|descriptor| match descriptor.target {
            FDTarget::Socket(inode) => Some(inode),
            _ => None,
        })
        .collect();
    let mut at_port = sockets
        .iter()
        .filter(|socket| socket.local_address == everywhere);
    at_port.any(|socket| own.contains(&socket.inode))
}

/// Makes participants until one has its port.
///
/// # Errors
/// Where none can be made, or the ports of all that were made are somebody else's.
pub(super) fn with_its_port(
    make: impl Fn() -> anyhow::Result<DomainParticipant>,
) -> anyhow::Result<DomainParticipant> {
    // Those without keep their ports for discovery until there is one with: the next gets another number.
    let mut without = vec![];
    for _ in 0..MOST_TRIES {
        let participant = make()?;
        let port = sample_port(participant.domain_id(), participant.participant_id());
        if listens(port) {
            return Ok(participant);
        }
        without.push((participant, port));
    }
    let ports: Vec<u16> = without.iter().map(|(_, port)| *port).collect();
    bail!("UDP ports {ports:?} are all somebody else's: a DDS participant needs one of them")
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    #[test]
    fn a_port_is_listened_to_where_this_process_has_it_on_all_addresses() {
        let everywhere = UdpSocket::bind("0.0.0.0:0").expect("a port");
        let on_one = UdpSocket::bind("127.0.0.1:0").expect("a port");
        let port = |socket: &UdpSocket| socket.local_addr().expect("an address").port();
        assert!(listens(port(&everywhere)));
        assert!(!listens(port(&on_one)));
        let gone = port(&everywhere);
        drop(everywhere);
        assert!(!listens(gone));
    }

    #[test]
    fn eq1_ports_are_those_of_the_standard() {
        assert_eq!(sample_port(0, 0), 7411);
        assert_eq!(sample_port(42, 3), 7400 + 42 * 250 + 11 + 6);
        assert_eq!(announcement_port(42), 7400 + 42 * 250);
        assert_eq!(common_sample_port(42), 7400 + 42 * 250 + 1);
        assert_eq!(discovery_port(42, 3), 7400 + 42 * 250 + 10 + 6);
    }
}
