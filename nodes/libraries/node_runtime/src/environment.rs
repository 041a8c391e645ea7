//! The environment: ROS's own variables and the network interfaces. It is read here and nowhere else.
#![expect(
    clippy::disallowed_methods,
    reason = "the one place that reads ROS's variables"
)]

use std::net::Ipv4Addr;

use abbe_msgs::Release;

mod distribution;
mod security;

pub(crate) use distribution::release;
pub(crate) use security::ENCLAVE;
pub use security::{FILES as ENCLAVE_FILES, NoCredentials, Security, is_enclave};

/// How far discovery goes (`ROS_AUTOMATIC_DISCOVERY_RANGE`, `ROS_LOCALHOST_ONLY`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DiscoveryRange {
    /// Every interface.
    #[default]
    Subnet,
    /// This computer only.
    Localhost,
}

/// What carries the ROS graph (`RMW_IMPLEMENTATION`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Middleware {
    /// DDS, on which `rmw_cyclonedds_cpp` and `rmw_fastrtps_cpp` are met; also where nothing is said.
    #[default]
    Dds,
    /// Zenoh, as `rmw_zenoh_cpp` speaks it.
    Zenoh,
}

/// How a session of Zenoh is made; the variables of `rmw_zenoh_cpp`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ZenohSettings {
    /// `ZENOH_SESSION_CONFIG_URI`: a file that replaces the whole configuration.
    pub config_uri: Option<String>,
    /// `ZENOH_CONFIG_OVERRIDE`: `key/path=value;…` on top of it.
    pub config_override: Option<String>,
    /// `ZENOH_ROUTER_CHECK_ATTEMPTS`: looks for a router, one a second, before a node goes on without;
    /// 0: until there is one, below 0: none.
    pub router_checks: i64,
}

impl Default for ZenohSettings {
    fn default() -> Self {
        Self {
            config_uri: None,
            config_override: None,
            router_checks: 1,
        }
    }
}

/// What the environment says about the ROS graph.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Environment {
    /// `RMW_IMPLEMENTATION`.
    pub middleware: Middleware,
    /// Where that is Zenoh.
    pub zenoh: ZenohSettings,
    /// `ROS_DOMAIN_ID`.
    pub domain_id: u16,
    /// DDS Security, where it is asked for.
    pub security: Option<Security>,
    /// How far discovery goes.
    pub range: DiscoveryRange,
    /// `ROS_STATIC_PEERS`: IPv4 addresses or names of hosts.
    pub static_peers: Vec<String>,
    /// `ROS_DISTRO`: whose definitions of ROS's own messages the graph uses.
    pub release: Release,
    /// The value of `ROS_DISTRO` where it is no name that is known.
    pub unknown_distribution: Option<String>,
    /// `RUST_LOG`.
    pub log_filter: Option<String>,
}

/// Why no node can start here.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EnvironmentError {
    /// A variable with a value that it cannot have.
    #[error("{variable}={value}: must be {allowed}")]
    BadVariable {
        /// Which.
        variable: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        allowed: &'static str,
    },
    /// Zenoh is asked for, and is not in this program.
    #[error(
        "RMW_IMPLEMENTATION=rmw_zenoh_cpp: this program was built without Zenoh (cargo build --features zenoh)"
    )]
    NoZenoh,
    /// DDS Security is asked for, and is not in this program.
    #[error(
        "ROS_SECURITY_ENABLE=true: this program was built without DDS Security (cargo build --features security)"
    )]
    NoSecurity,
    /// DDS Security is asked for, and not DDS.
    #[error(
        "ROS_SECURITY_ENABLE=true with RMW_IMPLEMENTATION=rmw_zenoh_cpp: only DDS is secured by enclaves; \
         access control and TLS of Zenoh stand in the file that ZENOH_SESSION_CONFIG_URI names"
    )]
    SecurityOfZenoh,
    /// Nothing to talk through.
    #[error("no network interface: none of {found} is up with an IPv4 address")]
    NoInterface {
        /// What there is.
        found: String,
    },
    /// Loopback was asked for and is down.
    #[error(
        "no network interface: discovery is limited to this computer, and `lo` is not up with 127.0.0.1 (found {found})"
    )]
    NoLoopback {
        /// What there is.
        found: String,
    },
}

/// A network interface, as far as it matters here.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interface {
    /// E.g. `eth0`.
    pub name: String,
    /// Up, with an IPv4 address.
    pub usable: bool,
    /// `lo`.
    pub loopback: bool,
    /// Has the MULTICAST flag.
    pub multicast: bool,
    /// Its addresses.
    pub addresses: Vec<Ipv4Addr>,
}

/// RustDDS announces itself to this many participants of a computer where there is no multicast.
pub const PARTICIPANTS_WITHOUT_MULTICAST: u16 = 12;

/// DDS's ports leave room for this many domains.
const LARGEST_DOMAIN_ID: u16 = 232;

impl Environment {
    /// Reads the process's environment.
    ///
    /// # Errors
    /// When a variable has a value that it cannot have, or that this program was not built for.
    pub fn read() -> Result<Self, EnvironmentError> {
        let read = Self::from_variables(|name| std::env::var(name).ok())?;
        if read.middleware == Middleware::Zenoh && cfg!(not(feature = "zenoh")) {
            return Err(EnvironmentError::NoZenoh);
        }
        if read.security.is_some() && cfg!(not(feature = "security")) {
            return Err(EnvironmentError::NoSecurity);
        }
        Ok(read)
    }

    /// The same from any source of variables.
    ///
    /// # Errors
    /// When a variable has a value that it cannot have.
    pub fn from_variables(
        variable: impl Fn(&'static str) -> Option<String>,
    ) -> Result<Self, EnvironmentError> {
        let set = |name| variable(name).filter(|value| !value.is_empty());
        let domain_id = match set("ROS_DOMAIN_ID") {
            None => 0,
            Some(value) => value
                .parse()
                .ok()
                .filter(|id| *id <= LARGEST_DOMAIN_ID)
                .ok_or(EnvironmentError::BadVariable {
                    variable: "ROS_DOMAIN_ID",
                    value,
                    allowed: "0 to 232",
                })?,
        };
        let automatic = match set("ROS_AUTOMATIC_DISCOVERY_RANGE") {
            None => DiscoveryRange::Subnet,
            Some(value) => match value.as_str() {
                "SUBNET" | "SYSTEM_DEFAULT" => DiscoveryRange::Subnet,
                "LOCALHOST" => DiscoveryRange::Localhost,
                _ => {
                    return Err(EnvironmentError::BadVariable {
                        variable: "ROS_AUTOMATIC_DISCOVERY_RANGE",
                        value,
                        allowed: "SUBNET, LOCALHOST or SYSTEM_DEFAULT",
                    });
                }
            },
        };
        let range = match set("ROS_LOCALHOST_ONLY").as_deref() {
            None | Some("0") => automatic,
            Some("1") => DiscoveryRange::Localhost,
            Some(value) => {
                return Err(EnvironmentError::BadVariable {
                    variable: "ROS_LOCALHOST_ONLY",
                    value: value.to_owned(),
                    allowed: "0 or 1",
                });
            }
        };
        let (middleware, zenoh) = middleware(set)?;
        let security = Security::from_variables(set)?;
        if security.is_some() && middleware == Middleware::Zenoh {
            return Err(EnvironmentError::SecurityOfZenoh);
        }
        let distribution = set("ROS_DISTRO");
        let known = release(distribution.as_deref());
        Ok(Self {
            middleware,
            zenoh,
            release: known.unwrap_or(Release::Lyrical),
            unknown_distribution: distribution.filter(|_| known.is_none()),
            domain_id,
            security,
            range,
            static_peers: static_peers(set)?,
            log_filter: set("RUST_LOG"),
        })
    }

    /// Whether there is an interface to talk through.
    ///
    /// # Errors
    /// When there is none.
    pub fn check_interfaces(&self, interfaces: &[Interface]) -> Result<(), EnvironmentError> {
        let found = || match interfaces {
            [] => "none".to_owned(),
            some => some
                .iter()
                .map(|i| i.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        };
        let mut usable = interfaces.iter().filter(|interface| interface.usable);
        match self.range {
            DiscoveryRange::Subnet if usable.next().is_none() => {
                Err(EnvironmentError::NoInterface { found: found() })
            }
            DiscoveryRange::Localhost if !usable.any(|interface| interface.loopback) => {
                Err(EnvironmentError::NoLoopback { found: found() })
            }
            _ => Ok(()),
        }
    }

    /// The hosts that are to be found without multicast; none where discovery stays on this computer.
    #[must_use]
    pub fn reachable_peers(&self) -> &[String] {
        match self.range {
            DiscoveryRange::Subnet => &self.static_peers,
            DiscoveryRange::Localhost => &[],
        }
    }

    /// What to warn of where hosts are named that are not looked for.
    #[must_use]
    pub fn peers_warning(&self) -> Option<String> {
        let is_followed = self.reachable_peers().len() == self.static_peers.len();
        (!is_followed).then(|| {
            "ROS_STATIC_PEERS is not followed: discovery is limited to this computer; \
             set ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET"
                .to_owned()
        })
    }

    /// What to warn of when this is the `participant`-th participant of the computer, from 0.
    #[must_use]
    pub fn multicast_warning(&self, interfaces: &[Interface], participant: u16) -> Option<String> {
        let relevant = |interface: &&Interface| {
            interface.usable && (self.range == DiscoveryRange::Subnet || interface.loopback)
        };
        if participant < PARTICIPANTS_WITHOUT_MULTICAST
            || interfaces
                .iter()
                .filter(relevant)
                .any(|interface| interface.multicast)
        {
            return None;
        }
        Some(format!(
            "participant {participant} of this computer, and no interface has the MULTICAST flag: only \
             the first {PARTICIPANTS_WITHOUT_MULTICAST} find each other; `ip link set lo multicast on` cures it"
        ))
    }
}

/// Most hosts that are named.
const MOST_PEERS: usize = 32;

/// The named hosts.
fn static_peers(
    set: impl Fn(&'static str) -> Option<String>,
) -> Result<Vec<String>, EnvironmentError> {
    let value = set("ROS_STATIC_PEERS").unwrap_or_default();
    let names = value.split(';').map(str::trim);
    let names: Vec<String> = names
        .filter(|name| !name.is_empty())
        .map(str::to_owned)
        .collect();
    let is_name = |name: &String| {
        let mut all = name.chars();
        all.all(|one| one.is_ascii_alphanumeric() || matches!(one, '.' | '-' | '_'))
    };
    if names.len() <= MOST_PEERS && names.iter().all(is_name) {
        return Ok(names);
    }
    Err(EnvironmentError::BadVariable {
        variable: "ROS_STATIC_PEERS",
        value,
        allowed: "at most 32 IPv4 addresses or host names, with `;` between them and without ports",
    })
}

/// What carries the graph, and how Zenoh is set up where it does.
fn middleware(
    set: impl Fn(&'static str) -> Option<String>,
) -> Result<(Middleware, ZenohSettings), EnvironmentError> {
    let middleware = match set("RMW_IMPLEMENTATION").as_deref() {
        None | Some("rmw_cyclonedds_cpp" | "rmw_fastrtps_cpp") => Middleware::Dds,
        Some("rmw_zenoh_cpp") => Middleware::Zenoh,
        Some(value) => {
            return Err(EnvironmentError::BadVariable {
                variable: "RMW_IMPLEMENTATION",
                value: value.to_owned(),
                allowed: "rmw_zenoh_cpp, or, all of them DDS, rmw_cyclonedds_cpp, rmw_fastrtps_cpp or nothing",
            });
        }
    };
    let router_checks = match set("ZENOH_ROUTER_CHECK_ATTEMPTS") {
        None => ZenohSettings::default().router_checks,
        Some(value) => value.parse().map_err(|_| EnvironmentError::BadVariable {
            variable: "ZENOH_ROUTER_CHECK_ATTEMPTS",
            value,
            allowed: "a whole number",
        })?,
    };
    let zenoh = ZenohSettings {
        config_uri: set("ZENOH_SESSION_CONFIG_URI"),
        config_override: set("ZENOH_CONFIG_OVERRIDE"),
        router_checks,
    };
    Ok((middleware, zenoh))
}

/// The interfaces of this computer.
#[must_use]
pub fn interfaces() -> Vec<Interface> {
    netdev::get_interfaces()
        .into_iter()
        .map(|interface| Interface {
            usable: interface.is_up() && interface.has_ipv4(),
            loopback: interface.is_loopback()
                && interface.ipv4_addrs().contains(&Ipv4Addr::LOCALHOST),
            multicast: interface.is_multicast(),
            addresses: interface.ipv4_addrs(),
            name: interface.name,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(pairs: &[(&str, &str)]) -> Result<Environment, EnvironmentError> {
        Environment::from_variables(|name| {
            pairs
                .iter()
                .find(|(n, _)| *n == name)
                .map(|(_, v)| (*v).to_owned())
        })
    }

    fn interface(name: &str, usable: bool, multicast: bool) -> Interface {
        Interface {
            name: name.to_owned(),
            usable,
            loopback: name == "lo",
            multicast,
            addresses: vec![],
        }
    }

    #[test]
    fn variables_have_the_meaning_of_ros() {
        assert_eq!(read(&[]).unwrap(), Environment::default());
        let both = [
            ("ROS_DOMAIN_ID", "42"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
        ];
        let environment = read(&both).unwrap();
        assert_eq!(
            (environment.domain_id, environment.range),
            (42, DiscoveryRange::Localhost)
        );
        let only = read(&[("ROS_LOCALHOST_ONLY", "1")]).unwrap();
        assert_eq!(only.range, DiscoveryRange::Localhost);
    }

    #[test]
    fn peers_are_named_with_semicolons_and_not_followed_on_this_computer_alone() {
        let peers = ("ROS_STATIC_PEERS", "10.0.0.7; cell-pc.local;");
        let environment = read(&[peers]).unwrap();
        assert_eq!(environment.reachable_peers(), ["10.0.0.7", "cell-pc.local"]);
        assert_eq!(environment.peers_warning(), None);
        for range in [
            "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST",
            "ROS_LOCALHOST_ONLY=1",
        ] {
            let environment = read(&[peers, range.split_once('=').unwrap()]).unwrap();
            assert!(environment.reachable_peers().is_empty());
            let warning = environment.peers_warning().unwrap();
            assert!(warning.contains("RANGE=SUBNET"), "{warning}");
        }
        let unset = read(&[("ROS_STATIC_PEERS", "")]).unwrap();
        assert_eq!(unset, Environment::default());
        let many = ["10.0.0.7"; 33].join(";");
        for bad in ["10.0.0.7:7410", "fe80::1", "10.0.0.7,10.0.0.8", &many] {
            let error = read(&[("ROS_STATIC_PEERS", bad)]).unwrap_err().to_string();
            assert!(error.contains("at most 32 IPv4"), "{error}");
        }
    }

    #[test]
    fn the_middleware_is_chosen_by_the_name_of_its_rmw() {
        for name in ["", "rmw_cyclonedds_cpp", "rmw_fastrtps_cpp"] {
            let environment = read(&[("RMW_IMPLEMENTATION", name)]).unwrap();
            assert_eq!(environment.middleware, Middleware::Dds, "{name}");
        }
        let zenoh = [
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"),
            ("ZENOH_CONFIG_OVERRIDE", "mode=\"client\""),
            ("ZENOH_ROUTER_CHECK_ATTEMPTS", "-1"),
        ];
        let environment = read(&zenoh).unwrap();
        assert_eq!(environment.middleware, Middleware::Zenoh);
        let expected = ZenohSettings {
            config_uri: None,
            config_override: Some("mode=\"client\"".to_owned()),
            router_checks: -1,
        };
        assert_eq!(environment.zenoh, expected);
    }

    #[test]
    fn bad_variables_are_refused_by_name() {
        for (name, value) in [
            ("ROS_DOMAIN_ID", "233"),
            ("ROS_DOMAIN_ID", "cell"),
            ("ROS_LOCALHOST_ONLY", "yes"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"),
            ("RMW_IMPLEMENTATION", "rmw_connextdds"),
            ("ZENOH_ROUTER_CHECK_ATTEMPTS", "often"),
        ] {
            let error = read(&[(name, value)]).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains(value), "{error}");
        }
    }

    #[test]
    fn without_an_interface_no_node_starts() {
        let anywhere = read(&[]).unwrap();
        let here = read(&[("ROS_LOCALHOST_ONLY", "1")]).unwrap();
        let down = [
            interface("lo", false, false),
            interface("eth0", false, true),
        ];
        let error = anywhere.check_interfaces(&down).unwrap_err().to_string();
        assert!(
            error.contains("no network interface") && error.contains("eth0"),
            "{error}"
        );
        let no_lo = [interface("lo", false, false), interface("eth0", true, true)];
        assert!(anywhere.check_interfaces(&no_lo).is_ok());
        assert!(
            here.check_interfaces(&no_lo)
                .unwrap_err()
                .to_string()
                .contains("`lo`")
        );
        assert!(
            here.check_interfaces(&[interface("lo", true, false)])
                .is_ok()
        );
    }

    #[test]
    fn the_thirteenth_participant_without_multicast_is_warned() {
        let here = read(&[("ROS_LOCALHOST_ONLY", "1")]).unwrap();
        let plain = [interface("lo", true, false), interface("eth0", true, true)];
        assert_eq!(here.multicast_warning(&plain, 11), None);
        assert!(
            here.multicast_warning(&plain, 12)
                .unwrap()
                .contains("multicast on")
        );
        assert_eq!(read(&[]).unwrap().multicast_warning(&plain, 12), None);
    }
}
