//! A bag on the network again: every message, byte for byte, with the bag's time on `/clock`.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use abbe_msgs::topics;
use abbe_tests::program::{Process, command, domain, root};
use recorder::{Bag, Event, Order};

use abbe_tests::graph::Graph;

const END: Duration = Duration::from_secs(60);

/// Messages of each topic of the bag that asks for acknowledgement with log times in `span`, in their order, behind the
/// one from before that a latched topic, one deep, still owes; what every node says of itself, the player too, left out.
fn reliable(bag: &Bag, span: RangeInclusive<u64>) -> BTreeMap<String, Vec<Vec<u8>>> {
    let mut found = BTreeMap::<String, Vec<Vec<u8>>>::new();
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}")
        };
        let topic = bag.topic(message.topic);
        let of_every_node = [topics::DIAGNOSTICS.name, topics::ROSOUT.name];
        if topic.qos_yaml.contains("reliability: reliable")
            && !of_every_node.contains(&topic.topic.as_str())
        {
            let of_topic = found.entry(topic.topic.clone()).or_default();
            if span.contains(&message.log_time_nanos) {
                of_topic.push(message.data.to_vec());
            } else if message.log_time_nanos < *span.start()
                && topic.qos_yaml.contains("durability: transient_local")
            {
                *of_topic = vec![message.data.to_vec()];
            }
        }
    }
    found
}

/// Waits until as many messages of each topic are there as were sent: they are those, in their order.
fn arrive(graph: &Graph, sent: &BTreeMap<String, Vec<Vec<u8>>>) {
    for (topic, sent) in sent {
        graph.wait(topic, |graph| {
            (graph.bytes_of(topic).len() >= sent.len()).then_some(())
        });
        let heard = graph.bytes_of(topic);
        let mut pairs = heard.iter().zip(sent);
        let differs = pairs.position(|(heard, sent)| !is_whole(heard, sent));
        assert_eq!((heard.len(), differs), (sent.len(), None), "{topic}");
    }
}

/// Times that `/clock` told, ns.
fn told(graph: &Graph, since: Instant) -> Vec<u64> {
    let clocks = graph.since(&topics::CLOCK, since);
    let nanos = clocks
        .iter()
        .map(|(_, m)| m.clock.sec as u64 * 1_000_000_000 + u64::from(m.clock.nanosec));
    nanos.collect()
}

/// Whether a sample came as it was sent: on its way it is filled up to four bytes.
fn is_whole(heard: &[u8], sent: &[u8]) -> bool {
    let filling = heard.strip_prefix(sent);
    filling.is_some_and(|filling| filling.len() < 4 && filling.iter().all(|byte| *byte == 0))
}

#[test]
fn a_bag_played_as_fast_as_can_be_arrives_whole_and_in_order_with_its_time() {
    let path = root().join("bags/cold_reference");
    let bag = Bag::open(&path).unwrap();
    let domain = domain(0);
    let graph = Graph::join(domain);
    let began = Instant::now();
    let mut play = command(domain, &["play"]);
    play.arg(&path).args(["--rate", "0", "--delay", "2"]);
    let ended = Process::start(play).ended_within(END);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let (first, last) = bag.log_times_nanos().unwrap();
    arrive(&graph, &reliable(&bag, first..=last));
    let nanos = told(&graph, began);
    eprintln!("{} /clock, {first} to {last} ns", nanos.len());
    assert!(nanos.len() > 10 && nanos.is_sorted());
    assert!(nanos[0] >= first && *nanos.last().unwrap() <= last);
}

#[test]
fn a_part_of_a_bag_at_a_rate_takes_its_time_and_holds_nothing_else() {
    let path = root().join("bags/cold_reference");
    let bag = Bag::open(&path).unwrap();
    let (first, last) = bag.log_times_nanos().unwrap();
    let length_s = (last - first) as f64 * 1e-9;
    let (from_s, to_s) = (0.25 * length_s, 0.75 * length_s);
    let rate = (to_s - from_s) / 2.0;
    let domain = domain(1);
    let graph = Graph::join(domain);
    let mut play = command(domain, &["play"]);
    play.arg(&path)
        .args(["--topics", "/probe/*", "--delay", "0"]);
    play.args([
        "--rate",
        &rate.to_string(),
        "--from",
        &from_s.to_string(),
        "--to",
        &to_s.to_string(),
    ]);
    let began = Instant::now();
    let ended = Process::start(play).ended_within(END);
    let took_s = began.elapsed().as_secs_f64();
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    eprintln!(
        "{:.1} s of the bag at rate {rate:.1}: {took_s:.1} s",
        to_s - from_s
    );
    assert!(took_s > 1.8, "{took_s}");
    // A fifth of the rate would take longer than this, a busy computer does not.
    assert!(took_s < 10.0, "{took_s}");
    let states = topics::AXES_STATE.name;
    assert!(graph.bytes_of(&format!("/{states}")).is_empty());
}

#[test]
fn a_window_of_a_bag_arrives_whole_from_its_first_message_to_its_last() {
    let path = root().join("bags/cold_reference");
    let bag = Bag::open(&path).unwrap();
    let topic = format!("/{}", topics::PROBE_TRIGGER.name);
    let mut touches = Vec::new();
    let mut messages = bag.messages(Order::LogTime);
    while let Some(Event::Message(message)) = messages.next_event() {
        if bag.topic(message.topic).topic == topic {
            touches.push(message.log_time_nanos);
        }
    }
    // Both edges lie on a touch: the window has them.
    let (from, to) = (touches[2], touches[touches.len() - 4]);
    let sent = reliable(&bag, from..=to);
    assert_eq!(sent[&topic].len(), touches.len() - 5);
    let status = format!("/{}", topics::PLAN_STATUS.name);
    assert_eq!(sent[&status].len(), 3, "one from before is owed");
    let (first, _) = bag.log_times_nanos().unwrap();
    let since_first = |nanos: u64| ((nanos - first) as f64 * 1e-9).to_string();
    let domain = domain(17);
    let graph = Graph::join(domain);
    let began = Instant::now();
    let mut play = command(domain, &["play", "--rate", "0", "--delay", "2"]);
    play.args(["--from", &since_first(from), "--to", &since_first(to)]);
    play.arg(&path);
    let ended = Process::start(play).ended_within(END);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    arrive(&graph, &sent);
    let nanos = told(&graph, began);
    assert_eq!(nanos.first(), Some(&from));
    assert!(nanos.is_sorted() && nanos.last() <= Some(&to));
}

#[test]
fn what_cannot_be_played_is_refused_with_the_reason() {
    let path = root().join("bags/cold_reference");
    for (arguments, code, words) in [
        (
            &["--rate", "-2"][..],
            2,
            "rate = -2: must be from 0 to 1000",
        ),
        (&["--rate", "nan"], 2, "rate = NaN: must be from 0 to 1000"),
        (
            &["--from", "5", "--to", "4"],
            2,
            "to_s = 4 s is before from_s = 5 s",
        ),
        (
            &["--to", "-1"],
            2,
            "to_s = -1 s: must be from 0 to 9000000000 s",
        ),
        (
            &["--delay", "inf"],
            2,
            "delay_s = inf s: must be from 0 to 60 s",
        ),
        (&["--", "--ros-args", "-r"], 2, "`-r` needs a value"),
        // The arguments are right, and the bag is not one for them.
        (&["--topics", "/nobody"], 1, "no message of [\"/nobody\"]"),
        (&["--from", "1e6"], 1, "between 1000000 s and its end"),
    ] {
        let mut play = command(domain(16), &["play"]);
        play.arg(&path).args(arguments);
        let ended = Process::start(play).ended_within(END);
        assert_eq!(ended.status.code(), Some(code), "{}", ended.said);
        assert!(ended.said.contains(words), "{}", ended.said);
        let is_usage = ended.said.contains("try '--help'");
        assert_eq!(is_usage, code == 2, "{}", ended.said);
    }
}

#[test]
fn a_bag_that_is_looped_begins_again_in_its_order_until_it_is_stopped() {
    let path = root().join("bags/cold_reference");
    let bag = Bag::open(&path).unwrap();
    let (first, last) = bag.log_times_nanos().unwrap();
    let topic = format!("/{}", topics::PROBE_TRIGGER.name);
    let sent = reliable(&bag, first..=last).remove(&topic).unwrap();
    let domain = domain(2);
    let graph = Graph::join(domain);
    let began = Instant::now();
    let rate = (last - first) as f64 * 1e-9 / 0.5;
    let mut play = command(domain, &["play", "--loop"]);
    play.arg(&path).args(["--rate", &rate.to_string()]);
    play.args(["--delay", "2", "--topics", &topic]);
    let mut play = Process::start(play);
    let rounds = 3 * sent.len();
    // Clocks are best effort: a busy computer loses some.
    let goes_back = |graph: &Graph| {
        let clocks = graph.since(&topics::CLOCK, began).into_iter();
        let times: Vec<_> = clocks
            .map(|(_, m)| (m.clock.sec, m.clock.nanosec))
            .collect();
        times.windows(2).filter(|pair| pair[1] < pair[0]).count()
    };
    graph.wait_longer(END, "three rounds of touches and of the clock", |graph| {
        (graph.bytes_of(&topic).len() >= rounds && goes_back(graph) >= 2).then_some(())
    });
    assert!(play.is_running(), "a loop has no end");
    play.stop();
    let heard = graph.bytes_of(&topic);
    let again = sent.iter().cycle();
    let differs = heard.iter().zip(again).position(|(h, s)| !is_whole(h, s));
    eprintln!("{} touches, {} in the bag", heard.len(), sent.len());
    assert_eq!(differs, None);
}
