//! The built command line, and nodes as processes of it.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, getuid};

/// The root of the workspace.
#[must_use]
pub fn root() -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests.parent().unwrap().to_owned()
}

/// The command line's program.
///
/// # Panics
/// When it is not built.
#[must_use]
pub fn abbe() -> PathBuf {
    built("abbe", "abbe")
}

/// The program of the blind trials.
///
/// # Panics
/// When it is not built.
#[must_use]
pub fn abbe_trials() -> PathBuf {
    built("abbe-trials", "abbe_trials")
}

fn built(name: &str, package: &str) -> PathBuf {
    let program = std::env::var("CARGO_TARGET_DIR")
        .map_or_else(|_| root().join("target"), PathBuf::from)
        .join("release")
        .join(name);
    assert!(
        program.is_file(),
        "{} is not there: cargo build --release -p {package} makes it (tests/run does)",
        program.display()
    );
    program
}

/// Domains that these tests share out. The tests of `node_runtime` have those below; from domain 102 on DDS's ports are
/// those that Linux gives out to anybody.
const DOMAINS: RangeInclusive<u16> = 40..=101;

/// Domains of this process by the number of their test, each with the file whose lock keeps other processes off it.
static TAKEN: Mutex<BTreeMap<u16, (u16, File)>> = Mutex::new(BTreeMap::new());

/// The domain of one test of this program, `0` to `19`. No other process has it while this one lives.
///
/// # Panics
/// When every domain is taken.
#[must_use]
pub fn domain(test: u16) -> u16 {
    assert!(test < 20, "a test's number is 0 to 19");
    let mut taken = TAKEN.lock().unwrap();
    if let Some((domain, _)) = taken.get(&test) {
        return *domain;
    }
    let folder = std::env::temp_dir().join(format!("abbe_test_domains_{}", getuid()));
    fs::create_dir_all(&folder).unwrap();
    let free = DOMAINS.into_iter().find_map(|domain| {
        let lock = File::create(folder.join(domain.to_string())).unwrap();
        lock.try_lock().is_ok().then_some((domain, lock))
    });
    let (domain, lock) =
        free.expect("no domain is free: other test programs hold all of 40 to 101");
    taken.insert(test, (domain, lock));
    domain
}

/// Verbs that print a short text, unless they are asked for all of it.
const SHORT: [&str; 4] = ["run", "report", "diagnose", "preflight"];

/// `abbe` with `arguments`, on loopback and in a domain; it prints all that it has to say.
#[must_use]
pub fn command(domain: u16, arguments: &[&str]) -> Command {
    match arguments {
        [verb, rest @ ..] if SHORT.contains(verb) => {
            as_given(domain, &[&[*verb, "--full"][..], rest].concat())
        }
        _ => as_given(domain, arguments),
    }
}

/// `abbe` with these arguments and no other, on loopback and in a domain.
#[must_use]
pub fn as_given(domain: u16, arguments: &[&str]) -> Command {
    on_loopback(&abbe(), domain, arguments)
}

/// `abbe-trials` with these arguments.
#[must_use]
pub fn trials(arguments: &[&str]) -> Command {
    on_loopback(&abbe_trials(), 0, arguments)
}

fn on_loopback(program: &Path, domain: u16, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command
        .args(arguments)
        .current_dir(root())
        .env("ROS_DOMAIN_ID", domain.to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env_remove("ROS_LOCALHOST_ONLY")
        .env_remove("ROS_DISTRO")
        .env_remove("RUST_LOG")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    crate::zenoh::put_on_it(&mut command, domain);
    command
}

/// A process that ends with its test; where that fails, what it said is printed.
pub struct Process {
    child: Option<Child>,
    said: Vec<JoinHandle<String>>,
}

/// How a process ended.
pub struct Ended {
    /// Exit code or signal.
    pub status: ExitStatus,
    /// Standard output, then standard error.
    pub said: String,
}

impl Process {
    /// Starts it.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let mut said = Vec::new();
        let pipes: [Option<Box<dyn Read + Send>>; 2] = [
            child.stdout.take().map(|pipe| Box::new(pipe) as _),
            child.stderr.take().map(|pipe| Box::new(pipe) as _),
        ];
        for mut pipe in pipes.into_iter().flatten() {
            said.push(std::thread::spawn(move || {
                let mut bytes = Vec::new();
                let _ = pipe.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            }));
        }
        Self {
            child: Some(child),
            said,
        }
    }

    /// Starts `abbe node NAME --ros-args …`.
    #[must_use]
    pub fn node(domain: u16, name: &str, ros_args: &[&str]) -> Self {
        let mut arguments = vec!["node", name, "--ros-args"];
        arguments.extend(ros_args);
        Self::start(command(domain, &arguments))
    }

    /// Its number.
    ///
    /// # Panics
    /// When the process is gone.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.as_ref().unwrap().id()
    }

    /// Sends a signal.
    ///
    /// # Panics
    /// When the process is gone.
    pub fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(i32::try_from(self.id()).unwrap()), signal).unwrap();
    }

    /// Whether it still runs.
    ///
    /// # Panics
    /// When it cannot be asked.
    pub fn is_running(&mut self) -> bool {
        self.child.as_mut().unwrap().try_wait().unwrap().is_none()
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// When it does not end within `patience`; what it said is in the message.
    pub fn ended_within(mut self, patience: Duration) -> Ended {
        let deadline = Instant::now() + patience;
        let mut child = self.child.take().unwrap();
        let status = loop {
            if let Some(status) = child.try_wait().unwrap() {
                break Some(status);
            }
            if Instant::now() > deadline {
                let _ = child.kill();
                let _ = child.wait();
                break None;
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let said: String = self
            .said
            .drain(..)
            .map(|thread| thread.join().unwrap())
            .collect();
        let Some(status) = status else {
            panic!("still running after {patience:?}; it said:\n{said}");
        };
        Ended { status, said }
    }

    /// Asks it to stop with SIGINT and checks that it does so with exit code 0.
    ///
    /// # Panics
    /// When it does not within 10 s, or with another code.
    pub fn stop(self) -> String {
        self.signal(Signal::SIGINT);
        let ended = self.ended_within(Duration::from_secs(10));
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        ended.said
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
            if std::thread::panicking() {
                for said in self.said.drain(..) {
                    eprint!("{}", said.join().unwrap_or_default());
                }
            }
        }
    }
}
