//! A million messages that a stranger on the network could send, to every topic, service and action of every node: none
//! makes a node panic, compute for long or hold ever more, and each node does its work afterwards as before.
//!
//! The messages are drawn from the interface definitions, or are good ones with one thing changed, and come between
//! those of good publishers, so that they meet a node in the middle of its work. `STRANGERS=N` sends N instead.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests look at clocks, variables and files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

use std::collections::BTreeSet;

use abbe_msgs::lifecycle_msgs::msg::Transition;
use abbe_msgs::lifecycle_msgs::srv::{ChangeState, ChangeStateRequest};
use abbe_msgs::{Service as _, to_cdr};
use abbe_tests::program::root;
use metrology::stamp::{Span, Stamp};
use node_runtime::node::{Event, GoalStatus};
use rand::seq::IndexedRandom as _;
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

mod draw;
mod driver;
mod form;
mod nodes;
mod recorded;
mod wire;

use draw::Dice;
use driver::Driver;
use form::Form;
use nodes::{TRIED, Tried, WITHOUT_EARS};
use recorded::Recording;

/// Strangers' messages in all.
const STRANGERS: u64 = 1_000_000;
const SEED: u64 = 20_261_126;
/// A node may hold so much more after them than before.
const MOST_HELD_BYTES: i64 = 512 << 20;
/// A good message comes with so many strangers'.
const STRANGERS_PER_GOOD: u64 = 2;

#[test]
fn every_node_is_tried() {
    let tried: BTreeSet<&str> = TRIED
        .iter()
        .map(|tried| tried.exec)
        .chain(WITHOUT_EARS)
        .collect();
    let folders = std::fs::read_dir(root().join("nodes")).unwrap();
    let shells: BTreeSet<String> = folders
        .map(|entry| entry.unwrap().path())
        .filter(|folder| folder.join("node").is_dir())
        .map(|folder| folder.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    let tried: BTreeSet<String> = tried.into_iter().map(str::to_owned).collect();
    assert_eq!(tried, shells);
}

#[test]
fn who_proposes_or_asks_what_cannot_be_read_is_answered() {
    let start = Stamp::from_nanos(1_700_000_000_000_000_000);
    for tried in TRIED {
        let home = tempfile::tempdir().unwrap();
        let mut driver = Driver::new(tried.node(home.path()), start);
        let ports = driver.node.ports().clone();
        // A string that ends before it begins.
        let bytes = [0, 1, 0, 0, 9];
        for server in 0..ports.action_servers.len() {
            let refused = driver.refused;
            let id = 1 + server as u64;
            let bytes = &bytes;
            driver.hand(Event::Goal { server, id, bytes });
            let action = &ports.action_servers[server].action;
            assert_eq!(driver.refused, refused + 1, "{}: {action}", tried.exec);
        }
        for service in 0..ports.services.len() {
            let answered = driver.answered;
            let id = 1_000 + service as u64;
            let bytes = &bytes;
            driver.hand(Event::Request { service, id, bytes });
            let name = &ports.services[service].service;
            assert_eq!(driver.answered, answered + 1, "{}: {name}", tried.exec);
        }
    }
}

macro_rules! tests {
    ($($name:ident: $place:literal;)*) => {
        $(#[test]
        fn $name() {
            survives(&TRIED[$place]);
        })*

        #[test]
        fn every_entry_has_its_test() {
            assert_eq!([$($place),*].len(), TRIED.len());
        }
    };
}

tests! {
    probe: 0;
    latency_calibrator: 1;
    grid_encoder: 2;
    rotary_axes: 3;
    thermal_model: 4;
    axis_compensation_of_scales: 5;
    axis_compensation_of_five_axes: 6;
    gap_diagnosis: 7;
    machine_frames: 8;
    host_clock: 9;
    host_clock_of_the_reference: 10;
    sequencer_with_a_plan: 11;
    sequencer: 12;
    fake_cnc: 13;
    linuxcnc_bridge: 14;
}

fn wanted() -> u64 {
    let told = std::env::var("STRANGERS").ok();
    told.map_or(STRANGERS, |text| text.parse().unwrap())
}

/// Where a node, its time and its good publishers are.
struct Scene {
    recording: Recording,
    driver: Driver,
    dice: Dice,
    /// Place in the recording, and how much later than recorded.
    place: usize,
    later_nanos: i64,
    next_id: u64,
}

fn survives(tried: &Tried) {
    let home = tempfile::tempdir().unwrap();
    let shares: u64 = TRIED.iter().map(|tried| tried.share).sum();
    let strangers = (wanted() * tried.share).div_ceil(shares);
    let mut alone = Scene::new(tried, home.path());
    alone.one_round();
    // Messages published once, at the start, are not awaited again.
    alone.driver.published.clear();
    alone.one_round();
    let before = alone.driver.published.clone();
    let mut scene = Scene::new(tried, home.path());
    for n in 0..strangers {
        if n.is_multiple_of(STRANGERS_PER_GOOD) {
            scene.good();
        }
        scene.stranger(tried);
    }
    let watch = scene.driver.watch;
    let (answered, refused, faults) = (
        scene.driver.answered,
        scene.driver.refused,
        scene.driver.faults,
    );
    eprintln!(
        "{} ({}): {strangers} messages, {faults} refused by their form, {refused} of {answered} goals and calls refused; longest step {:.3} s, largest {:.1} MiB, held {:.1} MiB, at most {:.1} MiB",
        tried.exec,
        tried.bag,
        watch.longest.as_secs_f64(),
        mib(watch.largest_step_bytes as i64),
        mib(watch.held_bytes),
        mib(watch.most_held_bytes),
    );
    assert!(
        watch.most_held_bytes < MOST_HELD_BYTES,
        "{}: {watch:?}",
        tried.exec
    );
    scene.works_as(&before, tried);
}

fn mib(bytes: i64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

impl Scene {
    fn new(tried: &Tried, home: &std::path::Path) -> Self {
        let node = tried.node(home);
        let recording = Recording::of(node.as_ref(), tried.bag);
        let first = recording
            .messages
            .first()
            .map_or(1_700_000_000_000_000_000, |m| m.at_nanos);
        let mut words = Vec::new();
        for recorded in recording.messages.iter().step_by(7) {
            if words.len() < 4_000 {
                recorded.value.texts(&mut words);
            }
        }
        words.extend(programs());
        words.sort();
        words.dedup();
        Self {
            recording,
            driver: Driver::new(node, Stamp::from_nanos(first)),
            dice: Dice {
                rng: Pcg64Mcg::seed_from_u64(SEED),
                words,
            },
            place: 0,
            later_nanos: 0,
            next_id: 1,
        }
    }

    /// The next message of the recording, at its time.
    fn good(&mut self) {
        if self.recording.messages.is_empty() {
            return;
        }
        if self.place == self.recording.messages.len() {
            self.place = 0;
            self.later_nanos += self.recording.round_nanos();
        }
        let at = self.recording.messages[self.place].at_nanos + self.later_nanos;
        // Strangers took time of their own: the good publishers are as much later.
        let behind = (self.driver.now.nanos() - at).max(0);
        self.later_nanos += behind;
        let (port, value) = self.recording.later(self.place, self.later_nanos);
        self.place += 1;
        let bytes = self.recording.bytes(port, &value);
        self.driver.advance(Stamp::from_nanos(at + behind));
        self.driver.hand(Event::Message {
            subscription: port,
            bytes: &bytes,
        });
    }

    /// The whole recording once, with nobody else.
    fn one_round(&mut self) {
        self.place = self.recording.messages.len();
        for _ in 0..self.recording.messages.len() {
            self.good();
            self.driver.serve();
        }
        let end = self.driver.now + Span::from_nanos(2_000_000_000);
        self.driver.advance(end);
    }

    /// What the node said to good publishers alone it says to them again.
    fn works_as(&mut self, before: &std::collections::BTreeMap<usize, u64>, tried: &Tried) {
        let taken = std::mem::take(&mut self.driver.taken);
        for (server, id) in taken {
            self.driver.hand(Event::Cancel { server, id });
        }
        self.driver.serve();
        // What a stranger left behind runs out.
        let later = self.driver.now + Span::from_nanos(60_000_000_000);
        self.driver.advance(later);
        self.driver.serve();
        self.activate();
        self.driver.published.clear();
        self.one_round();
        self.one_round();
        let publications = &self.driver.node.ports().publications;
        for (publication, times) in before {
            let now = self.driver.published.get(publication).copied().unwrap_or(0);
            let topic = &publications[*publication].topic;
            eprintln!(
                "{}: {topic}: {times} before, {now} after in two rounds",
                tried.exec
            );
            assert!(now > 0, "{}: nothing on {topic} any more", tried.exec);
        }
        self.driver.hand(Event::Shutdown);
        let patience =
            self.driver.now + self.driver.node.patience() + Span::from_nanos(1_000_000_000);
        while !self.driver.stopped && self.driver.now < patience {
            let next = self.driver.now + Span::from_nanos(10_000_000);
            self.driver.advance(next);
        }
        assert!(self.driver.stopped, "{} does not stop", tried.exec);
    }

    /// Something that a stranger sends.
    fn stranger(&mut self, tried: &Tried) {
        let to = self.driver.now + Span::from_nanos(tried.pace_nanos);
        self.driver.advance(to);
        let around_s = i32::try_from(self.driver.now.nanos() / 1_000_000_000).unwrap();
        let ports = self.driver.node.ports().clone();
        let kinds = [
            8 * ports.subscriptions.len(),
            4 * ports.services.len(),
            12 * ports.action_servers.len(),
            4 * ports.clients.len(),
            12 * ports.action_clients.len(),
        ];
        let mut pick = self
            .dice
            .rng
            .random_range(0..kinds.iter().sum::<usize>().max(1));
        let kind = kinds.iter().position(|n| {
            let is_here = pick < *n;
            pick = pick.wrapping_sub(if is_here { 0 } else { *n });
            is_here
        });
        match kind {
            Some(0) => self.message(around_s),
            Some(1) => {
                let service = self.dice.rng.random_range(0..ports.services.len());
                let type_name = ports.services[service].type_name;
                let form = Form::of(&request_of(type_name));
                let bytes = if type_name == ChangeState::TYPE_NAME {
                    self.step_of_a_lifecycle()
                } else {
                    self.drawn(&form, around_s)
                };
                let id = self.id();
                self.driver.hand(Event::Request {
                    service,
                    id,
                    bytes: &bytes,
                });
            }
            Some(2) => self.goal(&ports, around_s),
            Some(3) => self.response(&ports, around_s),
            Some(4) => self.news(&ports, around_s),
            _ => {}
        }
    }

    fn drawn(&mut self, form: &Form, around_s: i32) -> Vec<u8> {
        let value = self.dice.value(form, around_s);
        self.dice.bytes(form, &value)
    }

    /// Any step but the last: a node that is shut down is to stay so.
    fn step_of_a_lifecycle(&mut self) -> Vec<u8> {
        let mut request = ChangeStateRequest::default();
        let id = self.dice.rng.random();
        let is_last = (Transition::TRANSITION_UNCONFIGURED_SHUTDOWN
            ..=Transition::TRANSITION_ACTIVE_SHUTDOWN)
            .contains(&id);
        let step = *[1, 2, 3, 4, if is_last { 0 } else { id }]
            .choose(&mut self.dice.rng)
            .unwrap();
        request.transition.id = step;
        if self.dice.one_in(4) {
            request.transition.label = "x".repeat(self.dice.rng.random_range(0..2_000));
        }
        to_cdr(&request)
    }

    /// A managed node that a stranger left idle acts again.
    fn activate(&mut self) {
        let services = self.driver.node.ports().services.clone();
        for (service, port) in services.iter().enumerate() {
            if port.type_name != ChangeState::TYPE_NAME {
                continue;
            }
            for step in [
                Transition::TRANSITION_CONFIGURE,
                Transition::TRANSITION_ACTIVATE,
            ] {
                let mut request = ChangeStateRequest::default();
                request.transition.id = step;
                let (id, bytes) = (self.id(), to_cdr(&request));
                self.driver.hand(Event::Request {
                    service,
                    id,
                    bytes: &bytes,
                });
                let later = self.driver.now + Span::from_nanos(1_000_000_000);
                self.driver.advance(later);
            }
        }
    }

    fn id(&mut self) -> u64 {
        self.next_id += 1;
        self.next_id
    }

    /// A message that is drawn, a good one that is changed, an old one, or one of the next minutes.
    fn message(&mut self, around_s: i32) {
        let n = self.recording.forms.len();
        let drawn = self.recording.messages.is_empty() || self.dice.one_in(3);
        let (port, bytes) = if drawn {
            let port = self.dice.rng.random_range(0..n);
            let form = self.recording.forms[port].clone();
            (port, self.drawn(&form, around_s))
        } else {
            // Rare topics are changed as often as frequent ones.
            let wanted = self.dice.rng.random_range(0..n);
            let len = self.recording.messages.len();
            let from = self.dice.rng.random_range(0..len);
            let mut places = (from..len).chain(0..from).take(3_000);
            let place = places.find(|at| self.recording.messages[*at].port == wanted);
            let place = place.unwrap_or(from);
            let by_nanos = self.driver.now.nanos() - self.recording.messages[place].at_nanos;
            let (port, mut value) = self.recording.later(place, by_nanos);
            let form = self.recording.forms[port].clone();
            let changes = self.dice.rng.random_range(0..4);
            for _ in 0..changes {
                self.dice.change(&form, &mut value, around_s);
            }
            (port, self.dice.bytes(&form, &value))
        };
        self.driver.hand(Event::Message {
            subscription: port,
            bytes: &bytes,
        });
    }

    fn goal(&mut self, ports: &node_runtime::node::Ports, around_s: i32) {
        let server = self.dice.rng.random_range(0..ports.action_servers.len());
        let taken = self.driver.taken.last().copied();
        if let (Some((server, id)), true) = (taken, self.dice.one_in(3)) {
            self.driver.hand(Event::Cancel { server, id });
            return;
        }
        let form = Form::of(&format!("{}_Goal", ports.action_servers[server].type_name));
        let bytes = self.drawn(&form, around_s);
        let id = self.id();
        self.driver.hand(Event::Goal {
            server,
            id,
            bytes: &bytes,
        });
    }

    fn response(&mut self, ports: &node_runtime::node::Ports, around_s: i32) {
        let any = (
            self.dice.rng.random_range(0..ports.clients.len()),
            self.id(),
        );
        let (client, id) = self.driver.calls.pop().unwrap_or(any);
        let type_name = ports.clients[client].type_name;
        let form = Form::of(&format!("{type_name}_Response"));
        let bytes = self.drawn(&form, around_s);
        let bytes = (!self.dice.one_in(4)).then_some(bytes.as_slice());
        self.driver.hand(Event::Response { client, id, bytes });
    }

    fn news(&mut self, ports: &node_runtime::node::Ports, around_s: i32) {
        let any = (
            self.dice.rng.random_range(0..ports.action_clients.len()),
            self.id(),
        );
        let own = self
            .driver
            .sent_goals
            .last()
            .copied()
            .filter(|_| !self.dice.one_in(6));
        let (client, id) = own.unwrap_or(any);
        let type_name = ports.action_clients[client].type_name;
        match self.dice.rng.random_range(0..3) {
            0 => {
                let accepted = !self.dice.one_in(5);
                self.driver.hand(Event::GoalAnswer {
                    client,
                    id,
                    accepted,
                });
            }
            1 => {
                let form = Form::of(&format!("{type_name}_Feedback"));
                let bytes = self.drawn(&form, around_s);
                self.driver.hand(Event::GoalFeedback {
                    client,
                    id,
                    bytes: &bytes,
                });
            }
            _ => {
                let form = Form::of(&format!("{type_name}_GetResult_Response"));
                let bytes = self.drawn(&form, around_s);
                let bytes = (!self.dice.one_in(4)).then_some(bytes.as_slice());
                let status = GoalStatus::Succeeded;
                self.driver.hand(Event::GoalResult {
                    client,
                    id,
                    status,
                    bytes,
                });
                self.driver.sent_goals.retain(|goal| *goal != (client, id));
            }
        }
    }
}

fn request_of(type_name: &str) -> String {
    format!("{type_name}_Request")
}

/// Programs that a control would take.
fn programs() -> Vec<Vec<u8>> {
    [
        "first_run/production.ngc",
        "first_run/verify.ngc",
        "five_axis/verify.ngc",
    ]
    .iter()
    .map(|file| std::fs::read(root().join("launch_configs").join(file)).unwrap())
    .collect()
}
