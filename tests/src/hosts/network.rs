//! Hosts on one computer: a network namespace each, and a switch between them.
//!
//! Nothing of the computer's own network is touched: each tap is made inside its namespace, and with the namespaces everything is
//! gone, also when a test fails.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::computer_clock::{ClockError, Faketime};
use crate::program::{Process, abbe, root};
use crate::zenoh::Router;
use nix::sched::{CloneFlags, setns};
use node_runtime::environment::{DiscoveryRange, Environment};
use tun_rs::{DeviceBuilder, Layer, SyncDevice};

use super::switch::{Counts, Link, Switch};

/// Cells of several hosts wait for each other: they are judged by their delays.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A host's interface to the switch.
const INTERFACE: &str = "link0";

/// Lets what libfaketime shares between a process and its children, by the process' number, stay with the process: the
/// variables come before the program.
const UNDER_CLOCK: &str = r#"mount -t tmpfs -o size=64m tmpfs /dev/shm && exec env "$@""#;

/// How a network lacks multicast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multicast {
    /// Interfaces send it, and the network drops it.
    Dropped,
    /// No interface has it.
    NotOffered,
}

/// A network namespace that is removed with it.
struct Namespace(String);

impl Namespace {
    fn make(name: String) -> Result<Self, String> {
        ip(&["netns", "add", &name])?;
        Ok(Self(name))
    }

    fn ip(&self, arguments: &[&str]) -> Result<(), String> {
        let inside: Vec<&str> = ["-n", &self.0].iter().chain(arguments).copied().collect();
        ip(&inside)
    }

    /// Does something in a thread that is inside; what it starts stays there.
    fn inside<T: Send>(&self, work: impl FnOnce() -> T + Send) -> Result<T, String> {
        let path = format!("/run/netns/{}", self.0);
        let door = std::fs::File::open(&path).map_err(|error| format!("{path}: {error}"))?;
        std::thread::scope(|scope| {
            let enter = || {
                setns(door, CloneFlags::CLONE_NEWNET).map_err(|e| format!("setns: {e}"))?;
                Ok(work())
            };
            scope
                .spawn(enter)
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        if let Err(reason) = ip(&["netns", "del", &self.0]) {
            eprintln!("network namespace {}: {reason}", self.0);
        }
    }
}

fn ip(arguments: &[&str]) -> Result<(), String> {
    let words = || format!("ip {}", arguments.join(" "));
    let output = Command::new("ip")
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("{} (package iproute2): {error}", words()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(format!("{}: {}", words(), said.trim()))
}

/// Hosts that see each other through a switch.
pub struct Network {
    /// Before the namespaces, so that its taps are closed first.
    switch: Switch,
    hosts: Vec<(String, Namespace)>,
    /// Computer clocks that are wrong, each with its host's place.
    clocks: Vec<(usize, ClockError, Faketime)>,
    domain: u16,
    /// What nodes are told as `ROS_STATIC_PEERS`.
    peers: Vec<String>,
    /// A router on each host, where nodes speak Zenoh.
    routers: Vec<Router>,
    _turn: MutexGuard<'static, ()>,
}

impl Network {
    /// `hosts` on a network of their own, where DDS uses `domain`; `None` where this computer cannot, which is said and a failure
    /// where `CI=true`.
    pub fn of(hosts: &[&str], domain: u16, seed: u64) -> Option<Self> {
        match Self::make(hosts, domain, seed) {
            Ok(network) => Some(network),
            Err(reason) => {
                assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
                eprintln!("NOT TESTED: no network namespaces with taps here: {reason}");
                None
            }
        }
    }

    fn make(names: &[&str], domain: u16, seed: u64) -> Result<Self, String> {
        let turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut hosts, mut taps) = (Vec::new(), Vec::new());
        for (place, name) in names.iter().enumerate() {
            let namespace =
                Namespace::make(format!("abbe-{}-{domain}-{name}", std::process::id()))?;
            taps.push(namespace.inside(tap)??);
            let address = format!("{}/24", address(place));
            namespace.ip(&["address", "add", &address, "dev", INTERFACE])?;
            namespace.ip(&["link", "set", "lo", "up"])?;
            namespace.ip(&["link", "set", INTERFACE, "up"])?;
            hosts.push(((*name).to_owned(), namespace));
        }
        Ok(Self {
            switch: Switch::start(taps, seed),
            hosts,
            clocks: Vec::new(),
            domain,
            peers: Vec::new(),
            routers: Vec::new(),
            _turn: turn,
        })
    }

    /// Takes multicast away, and names all hosts to programs and threads that begin from now on.
    ///
    /// # Panics
    /// When an interface cannot be set.
    pub fn name_hosts_without(&mut self, multicast: Multicast) {
        match multicast {
            Multicast::Dropped => self.switch.drop_multicast(),
            Multicast::NotOffered => {
                for (_, namespace) in &self.hosts {
                    let off = ["link", "set", INTERFACE, "multicast", "off"];
                    namespace.ip(&off).unwrap();
                }
            }
        }
        self.peers = (0..self.hosts.len()).map(address).collect();
    }

    /// Lets nodes speak Zenoh, as `rmw_zenoh_cpp` does without more settings: each with the router of its
    /// host alone, and the routers with each other.
    pub fn over_zenoh(&mut self, python: &PathBuf) {
        let port = |place: usize| format!("tcp/10.77.0.{}:7447", place + 1);
        for place in 0..self.hosts.len() {
            let inside = self.inside(place);
            let inside: Vec<&str> = inside.iter().map(String::as_str).collect();
            let earlier: Vec<String> = (0..place).map(port).collect();
            let router = Router::start(python, &inside, "tcp/[::]:7447", &earlier);
            self.routers.push(router);
        }
    }

    /// The same by the secured configuration, for the hosts whose certificate is in `folder`.
    pub fn over_secured_zenoh(&mut self, python: &PathBuf, folder: &Path) {
        for place in 0..self.hosts.len() {
            let host = &self.hosts[place].0;
            if !folder.join(host).with_extension("pem").is_file() {
                continue;
            }
            let inside = self.inside(place);
            let inside: Vec<&str> = inside.iter().map(String::as_str).collect();
            let earlier: Vec<String> = (0..place)
                .map(|place| format!("tls/{}:7448", address(place)))
                .collect();
            let router = Router::secured(python, &inside, (folder, host), &earlier);
            self.routers.push(router);
        }
    }

    /// Ends the routers, when the nodes have ended; each host with the lines that its router complained in.
    pub fn end_routers(&mut self) -> Vec<(String, Vec<String>)> {
        let hosts = self.hosts.iter().map(|(name, _)| name.clone());
        let said = self.routers.drain(..).map(Router::stop);
        hosts.zip(said).collect()
    }

    /// Makes the clock of a host's computer wrong, for its router and programs that are started from now on.
    pub fn computer_clock(&mut self, host: &str, error: ClockError, faketime: &Faketime) {
        let place = self.place(host);
        self.clocks.push((place, error, faketime.clone()));
    }

    /// Whether a host's computer clock is wrong.
    #[must_use]
    pub fn has_wrong_clock(&self, host: &str) -> bool {
        let place = self.place(host);
        self.clocks.iter().any(|(of, ..)| *of == place)
    }

    /// What stands before a program that is started now on a host.
    fn inside(&self, place: usize) -> Vec<String> {
        let namespace = &self.hosts[place].1.0;
        let mut words = ["ip", "netns", "exec", namespace]
            .map(str::to_owned)
            .to_vec();
        if let Some((_, error, faketime)) = self.clocks.iter().find(|(of, ..)| *of == place) {
            words.extend(["sh", "-c", UNDER_CLOCK, "sh"].map(str::to_owned));
            let variables = error.variables(faketime).into_iter();
            words.extend(variables.map(|(name, value)| format!("{name}={value}")));
        }
        words
    }

    fn place(&self, host: &str) -> usize {
        let found = self.hosts.iter().position(|(name, _)| name == host);
        found.unwrap_or_else(|| panic!("no host {host}"))
    }

    /// What becomes of frames of every host.
    pub fn links(&self, link: Link) {
        for place in 0..self.hosts.len() {
            self.switch.set(place, link);
        }
    }

    /// What becomes of a host's frames.
    pub fn link(&self, host: &str, link: Link) {
        self.switch.set(self.place(host), link);
    }

    /// Cuts a host's link, or mends it.
    pub fn cut(&self, host: &str, is_cut: bool) {
        self.switch.cut(self.place(host), is_cut);
    }

    /// What the switch did so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.switch.counts()
    }

    /// Does something in a thread of a host.
    pub fn on<T: Send>(&self, host: &str, work: impl FnOnce(&Environment) -> T + Send) -> T {
        let environment = Environment {
            domain_id: self.domain,
            range: DiscoveryRange::Subnet,
            static_peers: self.peers.clone(),
            ..Environment::default()
        };
        let namespace = &self.hosts[self.place(host)].1;
        namespace.inside(|| work(&environment)).unwrap()
    }

    /// Starts `abbe node NAME --ros-args …` on a host.
    pub fn node(&self, host: &str, name: &str, ros_args: &[String]) -> Process {
        let mut words = vec!["node".to_owned(), name.to_owned(), "--ros-args".to_owned()];
        words.extend_from_slice(ros_args);
        self.program(host, &abbe().display().to_string(), &words)
    }

    /// Starts a program that is on the graph on a host.
    pub fn program(&self, host: &str, program: &str, arguments: &[String]) -> Process {
        let inside = self.inside(self.place(host));
        let mut command = Command::new(&inside[0]);
        command
            .args(&inside[1..])
            .arg(program)
            .args(arguments)
            .current_dir(root())
            .env("ROS_DOMAIN_ID", self.domain.to_string())
            .env_remove("ROS_AUTOMATIC_DISCOVERY_RANGE")
            .env_remove("ROS_LOCALHOST_ONLY")
            .env_remove("RUST_LOG")
            .env("ROS_STATIC_PEERS", self.peers.join(";"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        for setting in [
            "RMW_IMPLEMENTATION",
            "ZENOH_CONFIG_OVERRIDE",
            "ZENOH_SESSION_CONFIG_URI",
        ] {
            command.env_remove(setting);
        }
        if !self.routers.is_empty() {
            command.env("RMW_IMPLEMENTATION", "rmw_zenoh_cpp");
            command.env("ZENOH_ROUTER_CHECK_ATTEMPTS", "10");
        }
        Process::start(command)
    }
}

/// The address of the host at a place.
#[must_use]
pub fn address(place: usize) -> String {
    format!("10.77.0.{}", place + 1)
}

fn tap() -> Result<SyncDevice, String> {
    let made = DeviceBuilder::new()
        .name(INTERFACE)
        .layer(Layer::L2)
        .enable(false)
        .build_sync();
    let tap = made.map_err(|error| format!("/dev/net/tun: {error}"))?;
    tap.set_nonblocking(true)
        .map_err(|error| error.to_string())?;
    Ok(tap)
}
