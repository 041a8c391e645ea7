//! Tests over Zenoh: any test of processes runs on the middleware that `RMW_IMPLEMENTATION` names.
//!
//! Zenoh's nodes meet through a router. The test's own session is that router where the test listens
//! ([`environment`]); [`Router`] is one of other people's software, PyPI `eclipse-zenoh`.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use node_runtime::environment::{DiscoveryRange, Environment, Middleware};

use crate::program::root;
use crate::python::script;

/// Where a domain's router listens on this computer; below the ports that are given out.
#[must_use]
pub fn endpoint(domain: u16) -> String {
    format!("tcp/127.0.0.1:{}", 17_000 + domain)
}

/// What a node is told that meets others through the router at `endpoint`.
#[must_use]
pub fn through(endpoint: &str) -> [(&'static str, String); 3] {
    [
        ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp".to_owned()),
        (
            "ZENOH_CONFIG_OVERRIDE",
            format!("connect/endpoints=[\"{endpoint}\"]"),
        ),
        ("ZENOH_ROUTER_CHECK_ATTEMPTS", "10".to_owned()),
    ]
}

/// The middleware under test.
///
/// # Panics
/// When `RMW_IMPLEMENTATION` has a value that nodes refuse.
#[must_use]
pub fn middleware() -> Middleware {
    Environment::read().unwrap().middleware
}

/// This computer's graph in a domain, as the test itself joins it: on Zenoh as the router that the nodes
/// of [`crate::program::command`] meet through.
#[must_use]
pub fn environment(domain: u16) -> Environment {
    let mut environment = Environment {
        middleware: middleware(),
        domain_id: domain,
        range: DiscoveryRange::Localhost,
        ..Environment::default()
    };
    let listening = format!(
        "mode=\"router\";connect/endpoints=[];listen/endpoints=[\"{}\"]",
        endpoint(domain)
    );
    environment.zenoh.config_override = Some(listening);
    environment.zenoh.router_checks = -1;
    environment
}

/// Puts `command` on the middleware under test.
pub fn put_on_it(command: &mut Command, domain: u16) {
    if middleware() == Middleware::Zenoh {
        command.envs(through(&endpoint(domain)));
        // The router may be the test itself, which has not begun to listen.
        command.env("ZENOH_ROUTER_CHECK_ATTEMPTS", "-1");
    }
}

/// How a router is configured that we give to users.
const ROUTER: &str = "launch_configs/three_hosts/zenoh_router.json5";

/// The same for a network that others use too: TLS and access control.
const SECURED_ROUTER: &str = "launch_configs/three_hosts/zenoh_router_tls.json5";

/// What BACKENDS.md tells users to start one with: closing a dead link holds a thread of the two for 10 s.
const RUNTIME: (&str, &str) = (
    "ZENOH_RUNTIME",
    "(rx: (worker_threads: 8), net: (worker_threads: 4))",
);

/// A router of Zenoh's own by the configuration that is shipped: a Python process that ends with it.
pub struct Router {
    child: Child,
    open: Option<ChildStdin>,
    /// What it complained of, once it has ended.
    said: Option<JoinHandle<Vec<String>>>,
}

impl Router {
    /// Starts one that listens at `endpoint`; `wrapped` stands before the command, e.g. to enter a network.
    ///
    /// # Panics
    /// When it does not listen.
    #[must_use]
    pub fn start(python: &PathBuf, wrapped: &[&str], endpoint: &str, connect: &[String]) -> Self {
        let file = root().join(ROUTER).display().to_string();
        let words = ["router".to_owned(), file, endpoint.to_owned()];
        Self::of(python, wrapped, &[&words, connect].concat())
    }

    /// Starts one by the secured configuration that is shipped, with the certificate of `host` in `folder`.
    ///
    /// # Panics
    /// When it does not listen.
    #[must_use]
    pub fn secured(
        python: &PathBuf,
        wrapped: &[&str],
        (folder, host): (&Path, &str),
        connect: &[String],
    ) -> Self {
        let file = root().join(SECURED_ROUTER).display().to_string();
        let folder = folder.display().to_string();
        let words = ["secured".to_owned(), file, folder, host.to_owned()];
        Self::of(python, wrapped, &[&words, connect].concat())
    }

    fn of(python: &PathBuf, wrapped: &[&str], arguments: &[String]) -> Self {
        let plain = script(python, "zenoh_peer.py");
        let mut words = wrapped.iter().map(|word| (*word).into());
        let own = std::iter::once(plain.get_program().to_owned());
        let own = own.chain(plain.get_args().map(ToOwned::to_owned));
        let mut command = match words.next() {
            Some(first) => {
                let first: std::ffi::OsString = first;
                let mut command = Command::new(first);
                command.args(words).args(own);
                command
            }
            None => plain,
        };
        let mut child = command
            .env(RUNTIME.0, RUNTIME.1)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let open = child.stdin.take();
        let mut first = String::new();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        output.read_line(&mut first).unwrap();
        assert_eq!(first.trim(), "listening", "router {}", arguments.join(" "));
        // A router whose complaints nobody reads stands still once the pipe is full.
        let said = std::thread::spawn(|| output.lines().map_while(Result::ok).collect());
        Self {
            child,
            open,
            said: Some(said),
        }
    }

    /// Ends it; each line of what it complained of.
    ///
    /// # Panics
    /// When it cannot be waited for.
    #[must_use]
    pub fn stop(mut self) -> Vec<String> {
        drop(self.open.take());
        self.child.wait().unwrap();
        let said = self.said.take();
        said.map(|thread| thread.join().unwrap())
            .unwrap_or_default()
    }
}

impl Drop for Router {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let said = self.said.take().and_then(|thread| thread.join().ok());
        if std::thread::panicking() {
            eprintln!("{}", said.unwrap_or_default().join("\n"));
        }
    }
}

/// Whether the program was built with Zenoh; where it was not, the test's name is printed with the reason.
///
/// # Panics
/// When it was not and `CI=true`.
#[must_use]
pub fn built_in(test: &str) -> bool {
    let ended = Command::new(crate::program::abbe())
        .args(["node", "probe"])
        .env("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")
        .env("ZENOH_CONFIG_OVERRIDE", "refused")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    if !said.contains("without Zenoh") {
        return true;
    }
    let reason = "abbe was built without the feature zenoh (tests/run turns it on)";
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
    eprintln!("NOT TESTED: {test}: {reason}");
    false
}
