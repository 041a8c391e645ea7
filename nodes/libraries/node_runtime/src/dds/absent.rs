//! Participants of other hosts stay known while their host cannot be heard.
//!
//! RustDDS forgets a participant that has not announced itself for the time that it said, 50 s where it is RustDDS too, and
//! matches no reader and no writer again when it comes back: a link that is cut for a minute would part the nodes on both
//! sides until they are started anew. So announcements are listened to here as well, and while a host is silent its
//! participants are said to be alive to our own one, by a datagram that has no content: an announcement without data, told in
//! the other's name behind our own head (RTPS 2.5, 8.3.8.9.5), so that no route to the other is learnt from it.
//!
//! Who is dead is forgotten as ever: who says so itself, who is silent while others of its host are heard, who is of this
//! host, and all of a host that is silent for an hour. Those of another make are forgotten when they have forgotten us, after the
//! 50 s that RustDDS says of itself: what they ask for when they meet us anew it sends only to those that it meets anew too.

#![expect(
    clippy::disallowed_methods,
    reason = "a monotonic clock tells how long others are silent"
)]

use std::collections::BTreeMap;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, RTPSEntity as _};
use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::UdpSocket;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;

use super::ports;
use super::rtps::{Announcement, PREFIX_LEN, Prefix, alive, announcement};
use crate::environment::Interface;

/// Where participants announce themselves (RTPS 2.5, 9.6.2.4).
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// More than any datagram.
pub(super) const MAX_DATAGRAM_BYTES: usize = 1 << 16;

/// Between two looks: Cyclone DDS is forgotten after 10 s.
const ABSENCE_PERIOD: Duration = Duration::from_secs(3);
/// Silence after which somebody is said to be alive.
const SILENT: Duration = Duration::from_secs(4);
/// Silence after which somebody is dead of whose host others are heard.
const DEAD: Duration = Duration::from_secs(60);
/// A host is heard when one of it was within this: RustDDS announces itself every 10 s.
const HOST_HEARD: Duration = Duration::from_secs(25);
/// Silence after which a host is taken to be gone.
const GONE: Duration = Duration::from_secs(3600);
/// Silence after which those of another make have forgotten us.
const FORGOTTEN: Duration = Duration::from_secs(50);
/// The first bytes of a participant's prefix, where it is RustDDS.
const RUSTDDS_VENDOR: [u8; 2] = [1, 18];

/// When somebody was heard last, and from where.
#[derive(Clone, Copy)]
struct Heard {
    host: IpAddr,
    at: Instant,
}

/// Who was heard on other hosts.
#[derive(Default)]
struct Roll(BTreeMap<Prefix, Heard>);

impl Roll {
    fn note(&mut self, who: &Announcement, host: IpAddr, at: Instant) {
        match who {
            Announcement::Here(prefix) => self.0.insert(*prefix, Heard { host, at }),
            Announcement::Gone(prefix) => self.0.remove(prefix),
        };
    }

    /// Those that are to be kept, after the dead are struck off.
    fn absent(&mut self, now: Instant) -> Vec<Prefix> {
        let silence = |heard: &Heard| now.saturating_duration_since(heard.at);
        let mut hosts = BTreeMap::<IpAddr, Duration>::new();
        for heard in self.0.values() {
            let least = hosts.entry(heard.host).or_insert(Duration::MAX);
            *least = silence(heard).min(*least);
        }
        self.0.retain(|prefix, heard| {
            let is_heard = hosts[&heard.host] <= HOST_HEARD;
            let patience = match (is_heard, prefix.starts_with(&RUSTDDS_VENDOR)) {
                (_, false) => FORGOTTEN,
                (true, true) => DEAD,
                (false, true) => GONE,
            };
            silence(heard) <= patience
        });
        let silent = self.0.iter().filter(|(_, heard)| silence(heard) >= SILENT);
        silent.map(|(prefix, _)| *prefix).collect()
    }
}

/// Keeps those that a participant knows, while it is there.
pub(super) struct Absent(JoinHandle<()>);

impl Absent {
    /// Must be made inside a runtime, and where the participant was made.
    ///
    /// # Errors
    /// Where announcements cannot be listened to.
    pub fn of(participant: &DomainParticipant, interfaces: &[Interface]) -> io::Result<Self> {
        let domain = participant.domain_id();
        let others = interfaces.iter().filter(|of| !of.loopback);
        let socket = listen(ports::announcement_port(domain), others)?;
        let port = ports::discovery_port(domain, participant.participant_id());
        let own = prefix_of(participant);
        let keeper = Keeper {
            socket,
            own,
            own_address: (Ipv4Addr::LOCALHOST, port).into(),
            addresses: addresses(interfaces).map(IpAddr::from).collect(),
        };
        Ok(Self(tokio::spawn(keeper.keep())))
    }
}

/// The participant's own prefix.
pub(super) fn prefix_of(participant: &DomainParticipant) -> Prefix {
    let mut own = [0; PREFIX_LEN];
    own.copy_from_slice(&participant.guid().to_bytes()[..PREFIX_LEN]);
    own
}

impl Drop for Absent {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Of this host.
pub(super) fn addresses(interfaces: &[Interface]) -> impl Iterator<Item = Ipv4Addr> + '_ {
    interfaces
        .iter()
        .flat_map(|of| of.addresses.iter().copied())
}

/// A socket beside those of all participants of this host, which hears multicast of these interfaces.
pub(super) fn listen<'i>(
    port: u16,
    interfaces: impl Iterator<Item = &'i Interface>,
) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_reuse_address(true)?;
    socket.set_nonblocking(true)?;
    socket.bind(&SocketAddr::from((Ipv4Addr::UNSPECIFIED, port)).into())?;
    for interface in interfaces.filter(|of| of.usable && of.multicast) {
        for address in &interface.addresses {
            // An interface that has gone since is none to listen on.
            if let Err(error) = socket.join_multicast_v4(&GROUP, address) {
                tracing::debug!(%address, %error, "multicast is not listened to here");
            }
        }
    }
    UdpSocket::from_std(socket.into())
}

struct Keeper {
    socket: UdpSocket,
    own: Prefix,
    /// Where our participant listens for announcements.
    own_address: SocketAddr,
    /// Of this host.
    addresses: Vec<IpAddr>,
}

impl Keeper {
    async fn keep(self) {
        let mut roll = Roll::default();
        let mut datagram = vec![0; MAX_DATAGRAM_BYTES];
        let mut looks = tokio::time::interval(ABSENCE_PERIOD);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                received = self.socket.recv_from(&mut datagram) => {
                    let Ok((len, from)) = received else { continue };
                    if let Some(who) = self.of_another_host(from.ip(), &datagram[..len]) {
                        roll.note(&who, from.ip(), Instant::now());
                    }
                }
                _ = looks.tick() => {
                    for prefix in roll.absent(Instant::now()) {
                        let said = alive(&self.own, &prefix);
                        let _ = self.socket.send_to(&said, self.own_address).await;
                    }
                }
            }
        }
    }

    fn of_another_host(&self, from: IpAddr, datagram: &[u8]) -> Option<Announcement> {
        let is_own = from.is_loopback() || self.addresses.contains(&from);
        if is_own { None } else { announcement(datagram) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOSTS: [IpAddr; 2] = [
        IpAddr::V4(Ipv4Addr::new(10, 0, 0, 1)),
        IpAddr::V4(Ipv4Addr::new(10, 0, 0, 2)),
    ];

    fn prefix(vendor: [u8; 2], who: u8) -> Prefix {
        let mut prefix = [who; PREFIX_LEN];
        prefix[..2].copy_from_slice(&vendor);
        prefix
    }

    fn here(who: u8) -> Announcement {
        Announcement::Here(prefix(RUSTDDS_VENDOR, who))
    }

    /// Two of one host, one of another, all heard at once.
    fn three(at: Instant) -> Roll {
        let mut roll = Roll::default();
        for (who, host) in [(1, 0), (2, 0), (3, 1)] {
            roll.note(&here(who), HOSTS[host], at);
        }
        roll
    }

    fn absent(roll: &mut Roll, at: Instant) -> Vec<u8> {
        let kept = roll.absent(at);
        kept.iter().map(|prefix| prefix[2]).collect()
    }

    #[test]
    fn all_of_a_silent_host_are_kept_for_an_hour() {
        let began = Instant::now();
        let mut roll = three(began);
        assert!(absent(&mut roll, began + ABSENCE_PERIOD).is_empty());
        assert_eq!(absent(&mut roll, began + GONE), [1, 2, 3]);
        assert!(absent(&mut roll, began + GONE + ABSENCE_PERIOD).is_empty());
        assert_eq!(roll.0.len(), 0);
    }

    #[test]
    fn who_is_silent_beside_others_of_its_host_is_dead() {
        let began = Instant::now();
        let mut roll = three(began);
        let at = began + DEAD;
        roll.note(&here(1), HOSTS[0], at);
        assert_eq!(absent(&mut roll, at), [2, 3]);
        assert_eq!(absent(&mut roll, at + ABSENCE_PERIOD), [3]);
        assert_eq!(absent(&mut roll, at + ABSENCE_PERIOD + SILENT), [1, 3]);
    }

    #[test]
    fn who_says_so_is_gone() {
        let began = Instant::now();
        let mut roll = three(began);
        let gone = Announcement::Gone(prefix(RUSTDDS_VENDOR, 3));
        roll.note(&gone, HOSTS[1], began);
        assert_eq!(absent(&mut roll, began + SILENT), [1, 2]);
    }

    #[test]
    fn another_make_is_kept_for_as_long_as_it_remembers_us() {
        let began = Instant::now();
        let mut roll = three(began);
        let cyclone = Announcement::Here(prefix([1, 16], 4));
        roll.note(&cyclone, HOSTS[1], began);
        assert_eq!(absent(&mut roll, began + FORGOTTEN), [4, 1, 2, 3]);
        assert_eq!(
            absent(&mut roll, began + FORGOTTEN + ABSENCE_PERIOD),
            [1, 2, 3]
        );
    }
}
