//! Hosts that are named (`ROS_STATIC_PEERS`) are reached without multicast.
//!
//! RustDDS has no list of hosts. It announces itself to a multicast group and to this computer, and what many can hear
//! it sends to the group alone, samples too. A network that drops multicast drops both. So:
//!
//! | interfaces | what is done |
//! |---|---|
//! | one has multicast | what our participant sends to the group comes back here, by the loop of its own sockets. A copy goes to each named host: announcements to the ports of its first participants (RTPS 2.5, 9.6.2.3), the rest to those that are known there |
//! | none has | RustDDS sends to each alone already. It receives the announcement of a stand-in for each named host: a participant that only listens for announcements at those ports |
//!
//! A copy is the whole datagram: who hears it takes it as if the group had brought it. On an encrypted graph a stand-in has
//! no credentials and is not believed: there the second row does not hold.

use std::collections::BTreeSet;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, ToSocketAddrs as _};
use std::time::Duration;

use rustdds::DomainParticipant;
use tokio::net::UdpSocket;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;

use super::absent::{MAX_DATAGRAM_BYTES, addresses, listen, prefix_of};
use super::ports;
use super::rtps::{PREFIX_LEN, Prefix, announcement, sender, stand_in};
use crate::environment::Interface;

/// Participants of a host that are looked for, as `rmw_cyclonedds_cpp` and `rmw_fastrtps_cpp` do.
const SOUGHT_PARTICIPANTS: u16 = 32;
/// Between two looks who is known on the named hosts.
const LOOK: Duration = Duration::from_secs(1);
/// Between two words of a stand-in: RustDDS announces itself as often.
const STAND_IN_PERIOD: Duration = Duration::from_secs(10);

/// Addresses of named hosts, and the names without one.
pub(super) fn resolve(names: &[String]) -> (Vec<Ipv4Addr>, Vec<String>) {
    let (mut found, mut unknown) = (Vec::new(), Vec::new());
    for name in names {
        let all = (name.as_str(), 0).to_socket_addrs();
        let of_v4 = all
            .into_iter()
            .flatten()
            .find_map(|address| match address.ip() {
                IpAddr::V4(ip) => Some(ip),
                IpAddr::V6(_) => None,
            });
        match of_v4 {
            Some(ip) if !found.contains(&ip) => found.push(ip),
            Some(_) => {}
            None => unknown.push(name.clone()),
        }
    }
    (found, unknown)
}

/// The way to named hosts. It is readied before the participant is there, so that nothing of it is missed.
pub(super) struct Way {
    hosts: Vec<Ipv4Addr>,
    own: Vec<Ipv4Addr>,
    loops: Option<Loops>,
}

/// What a participant sends to the group.
struct Loops {
    discovery: UdpSocket,
    samples: UdpSocket,
}

impl Way {
    /// Must be made inside a runtime; `None`: no other host is named.
    ///
    /// # Errors
    /// Where there is multicast that cannot be listened to.
    pub fn to(
        hosts: &[Ipv4Addr],
        domain: u16,
        interfaces: &[Interface],
    ) -> io::Result<Option<Self>> {
        let own: Vec<Ipv4Addr> = addresses(interfaces).collect();
        let is_other = |host: &Ipv4Addr| !host.is_loopback() && !own.contains(host);
        let hosts: Vec<Ipv4Addr> = hosts.iter().copied().filter(is_other).collect();
        if hosts.is_empty() {
            return Ok(None);
        }
        let has_multicast = interfaces.iter().any(|of| of.usable && of.multicast);
        let loops = if has_multicast {
            Some(Loops {
                discovery: listen(ports::announcement_port(domain), interfaces.iter())?,
                samples: listen(ports::common_sample_port(domain), interfaces.iter())?,
            })
        } else {
            None
        };
        Ok(Some(Self { hosts, own, loops }))
    }

    /// Whether the participant needs announcements of stand-ins. An encrypted graph does not accept them.
    pub const fn needs_stand_ins(&self) -> bool {
        self.loops.is_none()
    }

    /// Lets a participant reach them.
    pub fn reach(self, participant: &DomainParticipant) -> Peers {
        let domain = participant.domain_id();
        let own = prefix_of(participant);
        let hosts = self.hosts.iter().map(|address| Host::new(*address, domain));
        let hosts: Vec<Host> = hosts.collect();
        Peers(match self.loops {
            Some(loops) => tokio::spawn(
                Copier {
                    participant: participant.clone(),
                    own,
                    addresses: self.own,
                    hosts,
                    loops,
                }
                .copy(),
            ),
            None => {
                let port = ports::discovery_port(domain, participant.participant_id());
                tokio::spawn(present(own, (Ipv4Addr::LOCALHOST, port).into(), hosts))
            }
        })
    }
}

/// Reaches named hosts while it is there.
pub(super) struct Peers(JoinHandle<()>);

impl Drop for Peers {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// A named host.
struct Host {
    address: Ipv4Addr,
    /// Where its first participants listen for announcements.
    sought: Vec<SocketAddrV4>,
    /// Where those that are known listen for samples.
    known: BTreeSet<u16>,
}

impl Host {
    fn new(address: Ipv4Addr, domain: u16) -> Self {
        let ports = (0..SOUGHT_PARTICIPANTS).map(|of| ports::discovery_port(domain, of));
        Self {
            address,
            sought: ports.map(|port| SocketAddrV4::new(address, port)).collect(),
            known: BTreeSet::new(),
        }
    }

    /// Where a datagram of discovery goes; the known have their two ports side by side (9.6.2.3).
    fn discovery_addresses(&self, is_announcement: bool) -> Vec<SocketAddrV4> {
        if is_announcement || self.known.is_empty() {
            return self.sought.clone();
        }
        let ports = self.known.iter().map(|port| port.saturating_sub(1));
        ports
            .map(|port| SocketAddrV4::new(self.address, port))
            .collect()
    }

    fn sample_addresses(&self) -> impl Iterator<Item = SocketAddrV4> + '_ {
        let ports = self.known.iter();
        ports.map(|port| SocketAddrV4::new(self.address, *port))
    }
}

/// Copies what a participant sends to the group.
struct Copier {
    participant: DomainParticipant,
    own: Prefix,
    /// Of this host.
    addresses: Vec<Ipv4Addr>,
    hosts: Vec<Host>,
    loops: Loops,
}

impl Copier {
    async fn copy(mut self) {
        let [mut first, mut second] = [vec![0; MAX_DATAGRAM_BYTES], vec![0; MAX_DATAGRAM_BYTES]];
        let mut looks = tokio::time::interval(LOOK);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                received = self.loops.discovery.recv_from(&mut first) => {
                    let Ok((len, from)) = received else { continue };
                    let datagram = &first[..len];
                    if self.is_own(datagram, from) {
                        let is_announcement = announcement(datagram).is_some();
                        for host in &self.hosts {
                            self.send(datagram, host.discovery_addresses(is_announcement)).await;
                        }
                    }
                }
                received = self.loops.samples.recv_from(&mut second) => {
                    let Ok((len, from)) = received else { continue };
                    let datagram = &second[..len];
                    if self.is_own(datagram, from) {
                        for host in &self.hosts {
                            self.send(datagram, host.sample_addresses()).await;
                        }
                    }
                }
                _ = looks.tick() => self.look(),
            }
        }
    }

    /// Whether our participant sent it, from this host.
    fn is_own(&self, datagram: &[u8], from: SocketAddr) -> bool {
        let is_here = self
            .addresses
            .iter()
            .any(|own| from.ip() == IpAddr::V4(*own));
        is_here && sender(datagram) == Some(self.own)
    }

    async fn send(&self, datagram: &[u8], to: impl IntoIterator<Item = SocketAddrV4>) {
        for address in to {
            // Who is not reached now may be the next time, as with multicast.
            let _ = self.loops.discovery.send_to(datagram, address).await;
        }
    }

    /// Who reads anything on the named hosts.
    fn look(&mut self) {
        let readers = self.participant.discovered_readers();
        let locators = readers
            .into_iter()
            .flat_map(|reader| reader.reader_proxy.unicast_locator_list)
            .filter(|locator| locator.is_udp());
        for host in &mut self.hosts {
            host.known.clear();
        }
        for address in locators.map(SocketAddr::from) {
            let mut hosts = self.hosts.iter_mut();
            if let Some(host) = hosts.find(|host| address.ip() == IpAddr::V4(host.address)) {
                host.known.insert(address.port());
            }
        }
    }
}

/// Tells a participant of stand-ins, again and again.
async fn present(own: Prefix, own_address: SocketAddr, hosts: Vec<Host>) {
    let socket = match UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).await {
        Ok(socket) => socket,
        Err(error) => {
            tracing::error!(%error, "named hosts are not looked for");
            return;
        }
    };
    let mut periods = tokio::time::interval(STAND_IN_PERIOD);
    periods.set_missed_tick_behavior(MissedTickBehavior::Delay);
    for number in 1.. {
        periods.tick().await;
        for host in &hosts {
            let word = stand_in(
                &own,
                &stand_in_prefix(&own, host.address),
                number,
                &host.sought,
            );
            let _ = socket.send_to(&word, own_address).await;
        }
    }
}

/// The prefix of a stand-in: of our own make, and like no other one that our participant meets.
fn stand_in_prefix(own: &Prefix, host: Ipv4Addr) -> Prefix {
    let mut name = *own;
    name[PREFIX_LEN - 4..].copy_from_slice(&host.octets());
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOST: Ipv4Addr = Ipv4Addr::new(10, 0, 0, 7);

    #[test]
    fn a_host_is_sought_at_the_ports_of_its_first_participants() {
        let mut host = Host::new(HOST, 5);
        let ports: Vec<u16> = host
            .discovery_addresses(false)
            .iter()
            .map(SocketAddrV4::port)
            .collect();
        assert_eq!((ports.len(), ports[0], ports[31]), (32, 8_660, 8_722));
        host.known = BTreeSet::from([8_661, 8_665]);
        let of = |is_announcement| host.discovery_addresses(is_announcement).len();
        assert_eq!((of(true), of(false)), (32, 2));
        assert_eq!(
            host.discovery_addresses(false)[1].to_string(),
            "10.0.0.7:8664"
        );
        let samples: Vec<u16> = host
            .sample_addresses()
            .map(|address| address.port())
            .collect();
        assert_eq!(samples, [8_661, 8_665]);
    }

    #[test]
    fn names_are_resolved_and_the_unknown_are_told() {
        let names = ["10.0.0.7", "localhost", "no-such-host.invalid", "10.0.0.7"];
        let (found, unknown) = resolve(&names.map(str::to_owned));
        assert_eq!(found, [HOST, Ipv4Addr::LOCALHOST]);
        assert_eq!(unknown, ["no-such-host.invalid"]);
    }

    #[tokio::test]
    async fn this_computer_is_no_host_to_reach() {
        let own = Interface {
            name: "eth0".to_owned(),
            usable: true,
            loopback: false,
            multicast: false,
            addresses: vec![HOST],
        };
        let hosts = [HOST, Ipv4Addr::LOCALHOST];
        assert!(
            Way::to(&hosts, 5, std::slice::from_ref(&own))
                .unwrap()
                .is_none()
        );
        let other = [Ipv4Addr::new(10, 0, 0, 8)];
        let way = Way::to(&other, 5, std::slice::from_ref(&own))
            .unwrap()
            .unwrap();
        assert!(way.needs_stand_ins());
    }
}
