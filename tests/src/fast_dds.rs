//! Fast DDS as the other side: `tests/peers/fast_dds.cpp` on Debian's libfastrtps, driven line by line.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use abbe_msgs::topics::Topic;
use abbe_msgs::{Durability, Message, Reliability, Service, from_cdr, to_cdr};
use node_runtime::names;
use tempfile::TempDir;

use crate::program::root;

/// How long anything that is waited for may take.
const PATIENCE: Duration = Duration::from_secs(20);

/// A running peer.
pub struct FastDds {
    child: Child,
    commands: ChildStdin,
    lines: Receiver<String>,
    kept: Vec<String>,
    /// How often each thing was told of each topic.
    heard: BTreeMap<String, usize>,
    _built: TempDir,
}

/// Compiles the peer. Where that cannot be done the test's name and the reason are printed.
///
/// # Panics
/// When it cannot and `CI=true`.
fn built(test: &str) -> Option<(TempDir, PathBuf)> {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("fast_dds");
    let libraries = ["-lfastrtps", "-lfastcdr"];
    compiled(test, "fast_dds.cpp", &program, &libraries).then_some((folder, program))
}

/// Compiles a file of `tests/peers`, as [`built`].
fn compiled(test: &str, source: &str, into: &Path, switches: &[&str]) -> bool {
    let compiled = Command::new("g++")
        .args(["-std=c++17", "-O1", "-o"])
        .arg(into)
        .arg(root().join("tests/peers").join(source))
        .args(switches)
        .output();
    let lack = match compiled {
        Ok(output) if output.status.success() => return true,
        Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
        Err(error) => error.to_string(),
    };
    let first = lack.lines().next().unwrap_or_default().to_owned();
    let reason = format!("g++ with libfastrtps-dev: {first} (tests/run installs them)");
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
    eprintln!("NOT TESTED: {test}: {reason}");
    false
}

fn quality<M: Message>(topic: &Topic<M>) -> String {
    let reliable = match topic.qos.reliability {
        Reliability::Reliable => "reliable",
        Reliability::BestEffort => "best_effort",
    };
    format!("{reliable} {}", word(topic.qos.durability))
}

fn word(durability: Durability) -> &'static str {
    match durability {
        Durability::TransientLocal => "latched",
        Durability::Volatile => "volatile",
    }
}

fn dds_topic<M: Message>(topic: &Topic<M>) -> String {
    names::dds_topic(&format!("/{}", topic.name.trim_start_matches('/')))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes_of(text: &str) -> Vec<u8> {
    let digits = text.as_bytes().chunks(2);
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    digits.map(byte).collect()
}

impl FastDds {
    /// Starts it in a domain of this computer's loopback; `None`: it cannot be compiled here.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(test: &str, domain: u16) -> Option<Self> {
        Self::start_with(test, domain, None, false)
    }

    /// The same with the credentials of an enclave's folder.
    ///
    /// # Panics
    /// As [`Self::start`].
    #[must_use]
    pub fn start_in(test: &str, domain: u16, enclave: &Path) -> Option<Self> {
        Self::start_with(test, domain, Some(enclave), false)
    }

    /// The same, changed so that it does not ask its permissions before it writes.
    ///
    /// # Panics
    /// As [`Self::start`].
    #[must_use]
    pub fn start_unasked(test: &str, domain: u16, enclave: &Path) -> Option<Self> {
        Self::start_with(test, domain, Some(enclave), true)
    }

    fn start_with(
        test: &str,
        domain: u16,
        enclave: Option<&Path>,
        is_unasked: bool,
    ) -> Option<Self> {
        let (built, program) = built(test)?;
        let mut command = Command::new(program);
        if is_unasked {
            let changed = built.path().join("unasked.so");
            let switches = ["-shared", "-fPIC"];
            if !compiled(test, "fast_dds_unasked.cpp", &changed, &switches) {
                return None;
            }
            command.env("LD_PRELOAD", changed);
        }
        let mut child = command
            .arg(domain.to_string())
            .args(enclave)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, lines) = channel();
        let output = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            for line in output.lines() {
                if line.is_err() || sender.send(line.unwrap()).is_err() {
                    return;
                }
            }
        });
        Some(Self {
            commands: child.stdin.take().unwrap(),
            child,
            lines,
            kept: vec![],
            heard: BTreeMap::new(),
            _built: built,
        })
    }

    fn say(&mut self, line: &str) {
        writeln!(self.commands, "{line}").unwrap();
        self.commands.flush().unwrap();
    }

    /// Listens to a topic of ours.
    pub fn read<M: Message>(&mut self, topic: &Topic<M>) {
        let (name, dds_type) = (dds_topic(topic), names::dds_type(M::TYPE_NAME));
        self.say(&format!("reader {name} {dds_type} {}", quality(topic)));
        self.wait(&format!("matched {name}"), |_| true);
    }

    /// Listens to a reliable topic by its absolute name.
    pub fn read_named<M: Message>(&mut self, name: &str, durability: Durability) {
        let (name, dds_type) = (names::dds_topic(name), names::dds_type(M::TYPE_NAME));
        let durability = word(durability);
        self.say(&format!("reader {name} {dds_type} reliable {durability}"));
        self.wait(&format!("matched {name}"), |_| true);
    }

    /// The next sample of a topic by its absolute name that `pick` takes.
    ///
    /// # Panics
    /// As [`Self::sample`].
    pub fn sample_named<M: Message>(&mut self, name: &str, pick: impl Fn(&M) -> bool) -> M {
        self.sample_of(&names::dds_topic(name), pick)
    }

    /// Makes a writer of a topic of ours.
    pub fn speak<M: Message>(&mut self, topic: &Topic<M>) {
        let (name, dds_type) = (dds_topic(topic), names::dds_type(M::TYPE_NAME));
        self.say(&format!("writer {name} {dds_type} {}", quality(topic)));
        self.wait(&format!("matched {name}"), |_| true);
    }

    /// Makes a writer of a topic of ours, whether anybody listens to it or not.
    pub fn speak_to_nobody<M: Message>(&mut self, topic: &Topic<M>) {
        let (name, dds_type) = (dds_topic(topic), names::dds_type(M::TYPE_NAME));
        self.say(&format!("writer {name} {dds_type} {}", quality(topic)));
    }

    /// Whether a writer or reader of a topic of ours was refused so far.
    #[must_use]
    pub fn was_refused<M: Message>(&self, topic: &Topic<M>) -> bool {
        let line = format!("refused {}", dds_topic(topic));
        self.heard.contains_key(&line)
    }

    /// Tries to make a writer of a topic of ours that its permissions do not allow.
    ///
    /// # Panics
    /// When it is not refused.
    pub fn may_not_speak<M: Message>(&mut self, topic: &Topic<M>) {
        let (name, dds_type) = (dds_topic(topic), names::dds_type(M::TYPE_NAME));
        self.say(&format!("writer {name} {dds_type} {}", quality(topic)));
        self.wait(&format!("refused {name}"), |_| true);
    }

    /// Writes a message.
    pub fn write<M: Message>(&mut self, topic: &Topic<M>, message: &M) {
        let bytes = hexadecimal(&to_cdr(message));
        self.say(&format!("write {} {bytes}", dds_topic(topic)));
    }

    /// Writes a message as soon as a writer of its own is met, and takes the writer away 1 s later.
    pub fn greet<M: Message>(&mut self, topic: &Topic<M>, message: &M) {
        let (name, dds_type) = (dds_topic(topic), names::dds_type(M::TYPE_NAME));
        let bytes = hexadecimal(&to_cdr(message));
        self.say(&format!(
            "greet {name} {dds_type} {} {bytes}",
            quality(topic)
        ));
        self.wait(&format!("greeted {name}"), |_| true);
    }

    /// The next sample of a topic that `pick` takes.
    ///
    /// # Panics
    /// When there was none in time, or one cannot be decoded.
    pub fn sample<M: Message>(&mut self, topic: &Topic<M>, pick: impl Fn(&M) -> bool) -> M {
        self.sample_of(&dds_topic(topic), pick)
    }

    fn sample_of<M: Message>(&mut self, dds_topic: &str, pick: impl Fn(&M) -> bool) -> M {
        let start = format!("sample {dds_topic} ");
        let read = |line: &str| -> M { from_cdr(&bytes_of(&line[start.len()..])).unwrap() };
        let line = self.wait(&start, |line| pick(&read(line)));
        read(&line)
    }

    /// Makes a client of a service, by its absolute name.
    pub fn client<V: Service>(&mut self, service: &str) {
        let (requests, replies) = (
            names::dds_request_topic(service),
            names::dds_reply_topic(service),
        );
        let request = names::dds_type(&format!("{}_Request", V::TYPE_NAME));
        let reply = names::dds_type(&format!("{}_Response", V::TYPE_NAME));
        self.say(&format!("client {requests} {request} {replies} {reply}"));
        self.wait(&format!("matched {requests}"), |_| true);
        self.wait(&format!("matched {replies}"), |_| true);
    }

    /// Sends a request.
    pub fn ask<V: Service>(&mut self, service: &str, number: i64, request: &V::Request) {
        let requests = names::dds_request_topic(service);
        let bytes = hexadecimal(&to_cdr(request));
        self.say(&format!("ask {requests} {number} {bytes}"));
    }

    /// The answer to a request.
    ///
    /// # Panics
    /// When there was none in time, or it cannot be decoded.
    pub fn reply<V: Service>(&mut self, service: &str, number: i64) -> V::Response {
        let requests = names::dds_request_topic(service);
        let start = format!("reply {requests} {number} ");
        let line = self.wait(&start, |_| true);
        from_cdr(&bytes_of(&line[start.len()..])).unwrap()
    }

    /// Makes a server of a service, by its absolute name.
    pub fn server<V: Service>(&mut self, service: &str) {
        let (requests, replies) = (
            names::dds_request_topic(service),
            names::dds_reply_topic(service),
        );
        let request = names::dds_type(&format!("{}_Request", V::TYPE_NAME));
        let reply = names::dds_type(&format!("{}_Response", V::TYPE_NAME));
        self.say(&format!("server {requests} {request} {replies} {reply}"));
    }

    /// The next request to a service of the peer, and its number.
    ///
    /// # Panics
    /// When there was none in time, or it cannot be decoded.
    pub fn request<V: Service>(&mut self, service: &str) -> (u64, V::Request) {
        let start = format!("request {} ", names::dds_request_topic(service));
        let line = self.wait(&start, |_| true);
        let (number, bytes) = line[start.len()..].split_once(' ').unwrap();
        (number.parse().unwrap(), from_cdr(&bytes_of(bytes)).unwrap())
    }

    /// Answers it.
    pub fn answer<V: Service>(&mut self, service: &str, number: u64, response: &V::Response) {
        let requests = names::dds_request_topic(service);
        let bytes = hexadecimal(&to_cdr(response));
        self.say(&format!("answer {requests} {number} {bytes}"));
    }

    /// Makes a writer of a reliable topic by its absolute name.
    pub fn speak_named<M: Message>(&mut self, name: &str, durability: Durability) {
        let (name, dds_type) = (names::dds_topic(name), names::dds_type(M::TYPE_NAME));
        let durability = word(durability);
        self.say(&format!("writer {name} {dds_type} reliable {durability}"));
    }

    /// Waits until somebody is met on a topic by its absolute name.
    ///
    /// # Panics
    /// When nobody is in time.
    pub fn matched(&mut self, name: &str) {
        let name = names::dds_topic(name);
        self.wait(&format!("matched {name}"), |_| true);
    }

    /// Writes bytes on such a topic.
    pub fn write_named(&mut self, name: &str, bytes: &[u8]) {
        let bytes = hexadecimal(bytes);
        self.say(&format!("write {} {bytes}", names::dds_topic(name)));
    }

    /// Asks and waits for the answer.
    ///
    /// # Panics
    /// As [`Self::reply`].
    pub fn asked<V: Service>(
        &mut self,
        service: &str,
        number: i64,
        request: &V::Request,
    ) -> V::Response {
        self.ask::<V>(service, number, request);
        self.reply::<V>(service, number)
    }

    /// Listens to a topic of ours; `false`: nobody who speaks there was met in time.
    ///
    /// # Panics
    /// When Fast DDS has ended.
    pub fn meets<M: Message>(&mut self, topic: &Topic<M>) -> bool {
        let (name, dds_type) = (dds_topic(topic), names::dds_type(M::TYPE_NAME));
        self.say(&format!("reader {name} {dds_type} {}", quality(topic)));
        self.in_time(&format!("matched {name}"), |_| true).is_some()
    }

    fn wait(&mut self, start: &str, pick: impl Fn(&str) -> bool) -> String {
        let found = self.in_time(start, pick);
        let heard = &self.heard;
        found.unwrap_or_else(|| panic!("{start}: not within {PATIENCE:?}; heard {heard:#?}"))
    }

    /// The first line with this beginning that `pick` accepts; `None` if none came in time.
    fn in_time(&mut self, start: &str, pick: impl Fn(&str) -> bool) -> Option<String> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let found = self
                .kept
                .iter()
                .position(|line| line.starts_with(start) && pick(line));
            if let Some(place) = found {
                return Some(self.kept.remove(place));
            }
            // What is not picked now is of no use later.
            self.kept
                .retain(|line| !line.starts_with(start) || !line.starts_with("sample"));
            let left = deadline.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) => {
                    let what: Vec<&str> = line.split(' ').take(2).collect();
                    *self.heard.entry(what.join(" ")).or_default() += 1;
                    self.kept.push(line);
                }
                Err(RecvTimeoutError::Timeout) => return None,
                Err(RecvTimeoutError::Disconnected) => panic!("{start}: Fast DDS has ended"),
            }
        }
    }
}

impl Drop for FastDds {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
