//! Cyclone DDS as the other side: `tests/peers/cyclone.py`, driven line by line.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use abbe_msgs::topics::Topic;
use abbe_msgs::{Durability, Message, Reliability};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::{Value, json};

use crate::python::script;

/// A reader or writer of the peer for a topic of ours, with the topic's own quality of service.
#[must_use]
pub fn end<M: Message>(topic: &Topic<M>) -> Value {
    named_end::<M>(
        topic.name,
        topic.qos.reliability == Reliability::Reliable,
        topic.qos.durability == Durability::TransientLocal,
        topic.qos.depth,
    )
}

/// The same with everything stated; `name` is relative or absolute.
#[must_use]
pub fn named_end<M: Message>(name: &str, reliable: bool, latched: bool, depth: u32) -> Value {
    let topic = absolute(name);
    json!({"topic": topic, "type": M::TYPE_NAME, "reliable": reliable, "latched": latched, "depth": depth})
}

fn absolute(name: &str) -> String {
    format!("/{}", name.trim_start_matches('/'))
}

/// A running peer.
pub struct Cyclone {
    child: Child,
    commands: Option<ChildStdin>,
    events: Receiver<Value>,
    kept: VecDeque<Value>,
}

impl Cyclone {
    /// Starts it.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(python: &PathBuf, domain: u16, readers: &[Value], writers: &[Value]) -> Self {
        Self::start_with(
            python,
            &json!({"domain": domain, "readers": readers, "writers": writers}),
        )
    }

    /// Starts it on every interface, for others than this computer's.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn on_network(python: &PathBuf, domain: u16, readers: &[Value], writers: &[Value]) -> Self {
        let plan =
            json!({"domain": domain, "on_network": true, "readers": readers, "writers": writers});
        Self::start_with(python, &plan)
    }

    /// Starts it on every interface without multicast; it looks for hosts at `peers` alone.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn among(
        python: &PathBuf,
        domain: u16,
        peers: &[&str],
        readers: &[Value],
        writers: &[Value],
    ) -> Self {
        let plan =
            json!({"domain": domain, "peers": peers, "readers": readers, "writers": writers});
        Self::start_with(python, &plan)
    }

    /// Starts it with clients of services, each by absolute name and type, `package/srv/Name`.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn asking(
        python: &PathBuf,
        domain: u16,
        clients: &[(&str, &str)],
        readers: &[Value],
    ) -> Self {
        let clients: Vec<Value> = clients
            .iter()
            .map(|(service, ros_type)| json!({"service": service, "type": ros_type}))
            .collect();
        let plan = json!({"domain": domain, "clients": clients, "readers": readers});
        Self::start_with(python, &plan)
    }

    /// Starts it with a plan as `tests/peers/cyclone.py` reads it.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start_with(python: &PathBuf, plan: &Value) -> Self {
        let mut child = script(python, "cyclone.py")
            .arg(plan.to_string())
            .env_remove("CYCLONEDDS_URI")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, events) = channel();
        let output = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            for line in output.lines() {
                let Ok(line) = line else { return };
                let event = serde_json::from_str(&line).unwrap();
                if sender.send(event).is_err() {
                    return;
                }
            }
        });
        let commands = child.stdin.take();
        Self {
            child,
            commands,
            events,
            kept: VecDeque::new(),
        }
    }

    /// Asks a service; fields that are not given are zero.
    ///
    /// # Panics
    /// When the peer is gone.
    pub fn ask(&mut self, service: &str, number: i64, request: &Value) {
        self.command(&json!({"service": service, "number": number, "request": request}));
    }

    /// The answer to request `number` of a service.
    ///
    /// # Panics
    /// When there was none within 10 s.
    pub fn reply(&mut self, service: &str, number: i64) -> Value {
        self.wait("reply", service, |event| event["number"] == number)["message"].take()
    }

    /// The next request to a service of the peer, and its number.
    ///
    /// # Panics
    /// When there was none within 10 s.
    pub fn request(&mut self, service: &str) -> (u64, Value) {
        let mut event = self.wait("request", service, |_| true);
        (event["number"].as_u64().unwrap(), event["message"].take())
    }

    /// Answers it; fields that are not given are zero.
    ///
    /// # Panics
    /// When the peer is gone.
    pub fn answer(&mut self, service: &str, number: u64, response: &Value) {
        self.command(&json!({"service": service, "number": number, "response": response}));
    }

    fn command(&mut self, line: &Value) {
        let commands = self.commands.as_mut().unwrap();
        writeln!(commands, "{line}").unwrap();
        commands.flush().unwrap();
    }

    /// Writes a message; fields that are not given are zero.
    ///
    /// # Panics
    /// When the peer is gone.
    pub fn write(&mut self, topic: &str, message: &Value) {
        self.command(&json!({"topic": absolute(topic), "message": message}));
    }

    /// Seconds from the peer's start to its match on `topic`.
    ///
    /// # Panics
    /// When there was none within 10 s.
    pub fn matched_after_s(&mut self, topic: &str) -> f64 {
        let event = self.wait("matched", topic, |_| true);
        event["after_s"].as_f64().unwrap()
    }

    /// The next sample of `topic` that `pick` takes.
    ///
    /// # Panics
    /// When there was none within 10 s.
    pub fn sample(&mut self, topic: &str, pick: impl Fn(&Value) -> bool) -> Value {
        self.wait("sample", topic, |event| pick(&event["message"]))["message"].take()
    }

    /// Every sample of `topic` that came and comes within `time`.
    pub fn samples_within(&mut self, topic: &str, time: Duration) -> Vec<Value> {
        let topic = absolute(topic);
        let (mut wanted, mut kept) = (Vec::new(), VecDeque::new());
        for mut event in self.events_within(time) {
            if event["event"] == "sample" && event["topic"] == topic.as_str() {
                wanted.push(event["message"].take());
            } else {
                kept.push_back(event);
            }
        }
        self.kept = kept;
        wanted
    }

    /// Every event that came and comes within `time`, whatever it is.
    pub fn events_within(&mut self, time: Duration) -> Vec<Value> {
        let deadline = Instant::now() + time;
        while let Ok(event) = self
            .events
            .recv_timeout(deadline.saturating_duration_since(Instant::now()))
        {
            self.kept.push_back(event);
        }
        self.kept.drain(..).collect()
    }

    fn wait(&mut self, kind: &str, topic: &str, pick: impl Fn(&Value) -> bool) -> Value {
        let topic = absolute(topic);
        let fits = |event: &Value| {
            event["event"] == kind && event["topic"] == topic.as_str() && pick(event)
        };
        if let Some(place) = self.kept.iter().position(fits) {
            return self.kept.remove(place).unwrap();
        }
        let deadline = Instant::now() + Duration::from_secs(10);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(left) {
                Ok(event) if fits(&event) => return event,
                Ok(event) => self.kept.push_back(event),
                Err(RecvTimeoutError::Timeout) => panic!("no {kind} of {topic} within 10 s"),
                Err(RecvTimeoutError::Disconnected) => panic!("the peer ended"),
            }
        }
    }

    /// Sends it a signal, e.g. to let it stand for a while.
    ///
    /// # Panics
    /// When it is gone.
    pub fn signal(&self, signal: Signal) {
        kill(
            Pid::from_raw(i32::try_from(self.child.id()).unwrap()),
            signal,
        )
        .unwrap();
    }

    /// Lets everything written arrive, and ends it.
    ///
    /// # Panics
    /// When it ends with another exit code than 0.
    pub fn stop(mut self) {
        drop(self.commands.take());
        assert!(self.child.wait().unwrap().success());
    }
}

impl Drop for Cyclone {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
