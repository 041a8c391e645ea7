//! A bag that is played as fast as subscribers acknowledge: to one that stands for a while, and to nobody.

use std::time::{Duration, Instant};

use abbe_msgs::msg::AxisState;
use abbe_msgs::{from_cdr, topics};
use abbe_tests::cyclone::{Cyclone, end};
use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::python::interpreter;
use nix::sys::signal::Signal;
use recorder::{Bag, Event, Order};
use serde_json::{Value, json};

const PAUSE: &str = "/replayer/pause";
const RESUME: &str = "/replayer/resume";
/// So many messages are on the way at most.
const WINDOW: u64 = 64;
/// How long the subscriber stands; after 5 s the player counts what is not acknowledged as lost.
const STANDS: Duration = Duration::from_secs(3);

/// Controller's stamps of the bag's states, in their order.
fn sent() -> Vec<(i64, i64)> {
    let bag = Bag::open(root().join("bags/cold_reference")).unwrap();
    let topic = format!("/{}", topics::AXES_STATE.name);
    let mut messages = bag.messages(Order::LogTime);
    let mut sent = Vec::new();
    while let Some(Event::Message(message)) = messages.next_event() {
        if bag.topic(message.topic).topic == topic {
            let state: AxisState = from_cdr(message.data).unwrap();
            let stamp = state.controller_stamp;
            sent.push((stamp.sec.into(), stamp.nanosec.into()));
        }
    }
    sent
}

fn stamp_of(state: &Value) -> (i64, i64) {
    let stamp = &state["controller_stamp"];
    let number = |key: &str| stamp[key].as_i64().unwrap();
    (number("sec"), number("nanosec"))
}

/// Whoever steers the player, and how often it has asked.
struct Desk {
    operator: Cyclone,
    asked: i64,
}

impl Desk {
    fn ask(&mut self, service: &str) -> String {
        self.asked += 1;
        self.operator.ask(service, self.asked, &json!({}));
        let answer = self.operator.reply(service, self.asked);
        assert_eq!(answer["success"], true, "{answer}");
        answer["message"].as_str().unwrap().to_owned()
    }

    /// Messages sent so far, of a player that goes on.
    fn sent(&mut self) -> u64 {
        let said = self.ask(PAUSE);
        self.ask(RESUME);
        let count = said.strip_suffix(" messages sent").unwrap();
        count.rsplit(' ').next().unwrap().parse().unwrap()
    }
}

#[test]
fn a_bag_as_fast_as_subscribers_acknowledge_waits_for_one_that_stands_and_loses_nothing() {
    let Some(python) = interpreter("a player waits for a subscriber that stands") else {
        return;
    };
    let (domain, states, sent) = (domain(18), &topics::AXES_STATE, sent());
    let mut play = command(domain, &["play", "--rate", "0", "--paused", "--delay", "0"]);
    play.arg(root().join("bags/cold_reference"));
    play.args(["--topics", "/axes/state"]);
    let playing = Process::start(play);
    let mut slow = Cyclone::start(&python, domain, &[end(states)], &[]);
    let clients = [PAUSE, RESUME].map(|service| (service, "std_srvs/srv/Trigger"));
    let mut operator = Cyclone::asking(&python, domain, &clients, &[]);
    slow.matched_after_s(states.name);
    for service in [PAUSE, RESUME] {
        operator.matched_after_s(service);
    }
    // The peer says that it has met the player as soon as it has; nothing is sent before the player has met it too.
    std::thread::sleep(Duration::from_secs(2));
    let mut desk = Desk { operator, asked: 0 };
    slow.signal(Signal::SIGSTOP);
    let stood = Instant::now();
    desk.ask(RESUME);
    std::thread::sleep(STANDS / 3);
    let early = desk.sent();
    std::thread::sleep(STANDS.saturating_sub(stood.elapsed()));
    let late = desk.sent();
    slow.signal(Signal::SIGCONT);
    let stood_s = stood.elapsed().as_secs_f64();
    eprintln!("{early} and {late} messages sent to one that stood for {stood_s:.1} s");
    assert_eq!((early, late), (WINDOW, WINDOW));
    let ended = playing.ended_within(Duration::from_secs(60));
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let told = format!("{} messages, 0 lost", sent.len());
    assert!(ended.said.contains(&told), "{}", ended.said);
    let mut heard = Vec::new();
    let patience = Instant::now();
    while heard.len() < sent.len() && patience.elapsed() < Duration::from_secs(20) {
        let came = slow.samples_within(states.name, Duration::from_millis(200));
        heard.extend(came.iter().map(stamp_of));
    }
    let is_missing = |k: &usize| !heard.contains(&sent[*k]);
    let missing: Vec<usize> = (0..sent.len()).filter(is_missing).collect();
    assert!(
        missing.is_empty(),
        "{} of {} never came: {missing:?}",
        missing.len(),
        sent.len()
    );
    assert!(heard == sent, "in another order");
    desk.operator.stop();
    slow.stop();
}

#[test]
fn a_bag_as_fast_as_subscribers_acknowledge_ends_at_once_where_there_are_none() {
    let mut play = command(domain(19), &["play", "--rate", "0", "--delay", "0"]);
    play.arg(root().join("bags/cold_reference"));
    let began = Instant::now();
    let ended = Process::start(play).ended_within(Duration::from_secs(60));
    let took_s = began.elapsed().as_secs_f64();
    eprintln!("{took_s:.1} s");
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let messages = Bag::open(root().join("bags/cold_reference")).unwrap();
    let told = format!("{} messages, 0 lost", messages.message_count());
    assert!(ended.said.contains(&told), "{}", ended.said);
    // A wait for acknowledgement that nobody gives takes 5 s, and there would be one for each 64 messages.
    assert!(took_s < 5.0, "{took_s}");
}
