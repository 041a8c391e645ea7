use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::std_msgs::msg::{Int64, String as Text};
use abbe_msgs::{Message, Qos, from_cdr, to_cdr, topics};
use metrology::stamp::Span;
use node_runtime::environment::{Environment, Middleware};
use node_runtime::node::Ports;
use node_runtime::{Emission, Event};

use super::puppet::{Puppet, environment, on_dds, start, start_with, topic, wait};

fn now_nanos() -> i64 {
    i64::try_from(
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap()
            .as_nanos(),
    )
    .unwrap()
}

/// Publishes the time on `name` at every tick once the flag is set, `count` times.
fn ticker(name: &str, qos: Qos, period_us: i64, count: u32, go: Arc<AtomicBool>) -> Puppet {
    let ports = Ports {
        publications: vec![topic::<Int64>(name, qos)],
        timers: vec![Span::from_nanos(period_us * 1_000)],
        ..Ports::default()
    };
    let mut sent = 0;
    Puppet::new("ticker", ports, move |_, event, out| {
        if matches!(event, Event::Timer { .. }) && sent < count && go.load(Ordering::Relaxed) {
            sent += 1;
            let bytes = Arc::from(to_cdr(&Int64 { data: now_nanos() }));
            out.push(Emission::Publish {
                publication: 0,
                bytes,
            });
        }
        Ok(())
    })
}

/// Hands on every message of a topic, with the time of its handling.
fn listener<M: Message>(name: &str, topic_name: &str, qos: Qos) -> (Puppet, Receiver<(M, i64)>) {
    let ports = Ports {
        subscriptions: vec![topic::<M>(topic_name, qos)],
        ..Ports::default()
    };
    let (sender, received) = channel();
    let puppet = Puppet::new(name, ports, move |_, event, _| {
        if let Event::Message { bytes, .. } = event {
            let message = from_cdr(bytes).map_err(|error| error.to_string())?;
            let _ = sender.send((message, now_nanos()));
        }
        Ok(())
    });
    (puppet, received)
}

#[test]
fn a_thousand_messages_at_1_khz_all_arrive_in_order() {
    let environment = environment(0);
    let go = Arc::new(AtomicBool::new(false));
    let (puppet, received) = listener::<Int64>("listener", "ticks", Qos::RELIABLE_DEEP);
    let listening = start(&environment, puppet);
    let ticker = ticker("ticks", Qos::RELIABLE_DEEP, 1_000, 1_000, Arc::clone(&go));
    let ticking = start(&environment, ticker);
    std::thread::sleep(Duration::from_millis(500));
    go.store(true, Ordering::Relaxed);
    let mut delays_us = Vec::new();
    let mut last = i64::MIN;
    while delays_us.len() < 1_000 {
        let (message, at) = wait(&received, "a tick", Some);
        assert!(message.data > last, "out of order");
        last = message.data;
        delays_us.push((at - message.data) / 1_000);
    }
    ticking.stop().unwrap();
    listening.stop().unwrap();
    delays_us.sort_unstable();
    let at = |share: usize| delays_us[share * delays_us.len() / 1_000];
    eprintln!(
        "one way, 1 kHz: p50 {} us, p99 {} us, max {} us",
        at(500),
        at(990),
        delays_us[999]
    );
    assert!(
        at(500) < 20_000,
        "half of the messages took more than 20 ms"
    );
}

/// Says three states at once, and what somebody hears who joins later.
fn heard_late(environment: &Environment) -> Vec<i64> {
    let ports = Ports {
        publications: vec![topic::<Int64>("state", Qos::LATCHED)],
        timers: vec![Span::from_nanos(10_000_000)],
        ..Ports::default()
    };
    let mut state = 0;
    let speaker = Puppet::new("speaker", ports, move |_, event, out| {
        if matches!(event, Event::Timer { .. }) && state < 3 {
            state += 1;
            let bytes = Arc::from(to_cdr(&Int64 { data: state }));
            out.push(Emission::Publish {
                publication: 0,
                bytes,
            });
        }
        Ok(())
    });
    let speaking = start(environment, speaker);
    std::thread::sleep(Duration::from_millis(300));
    let (puppet, received) = listener::<Int64>("late", "state", Qos::LATCHED);
    let listening = start(environment, puppet);
    let mut states = vec![wait(&received, "what is latched", Some).0.data];
    let more = || received.recv_timeout(Duration::from_millis(500)).ok();
    states.extend(std::iter::from_fn(more).map(|(message, _)| message.data));
    listening.stop().unwrap();
    speaking.stop().unwrap();
    states
}

#[test]
fn a_late_joiner_ends_with_what_is_latched() {
    let states = heard_late(&environment(1));
    // RustDDS's writer has not yet dropped what exceeds its depth: older states may come first.
    assert_eq!(states.last(), Some(&3), "{states:?}");
    assert!(states.is_sorted(), "{states:?}");
}

/// As where a participant that takes its two ports one by one is started at the same instant.
#[test]
fn what_is_latched_is_heard_where_somebody_has_the_port_of_the_first_participant() {
    let environment = on_dds(20);
    let port = 7400 + 250 * environment.domain_id + 11;
    let somebody = std::net::UdpSocket::bind(("127.0.0.1", port)).unwrap();
    let states = heard_late(&environment);
    assert_eq!(states.last(), Some(&3), "{states:?}");
    drop(somebody);
}

#[test]
fn names_are_remapped_and_put_into_the_namespace() {
    let environment = environment(2);
    let (puppet, received) = listener::<Int64>("listener", "/cell/x/ticks", Qos::RELIABLE);
    let listening = start(&environment, puppet);
    let go = Arc::new(AtomicBool::new(true));
    let ticker = ticker("ticks", Qos::RELIABLE, 20_000, 1_000, go);
    let rules = ["--ros-args", "-r", "__ns:=/cell", "-r", "ticks:=x/ticks"];
    let ticking = start_with(&environment, ticker, &rules);
    wait(&received, "a tick under the new name", Some);
    ticking.stop().unwrap();
    listening.stop().unwrap();
}

/// The message of a condition on `/diagnostics`, when it is there and not ok.
fn condition(array: &DiagnosticArray, name: &str) -> Option<String> {
    array
        .status
        .iter()
        .find(|status| status.name == name && status.level > 0)
        .map(|status| status.message.clone())
}

#[test]
fn wrong_types_and_faults_are_on_diagnostics() {
    let environment = environment(3);
    let name = topics::DIAGNOSTICS.name;
    let (puppet, diagnostics) = listener::<DiagnosticArray>("watch", name, Qos::RELIABLE);
    let watching = start(&environment, puppet);
    let (puppet, _texts) = listener::<Text>("reader", "ticks", Qos::RELIABLE);
    let reading = start(&environment, puppet);
    let go = Arc::new(AtomicBool::new(true));
    let ticking = start(
        &environment,
        ticker("ticks", Qos::RELIABLE, 20_000, 1_000, go),
    );
    let mismatch = wait(&diagnostics, "type_mismatch", |(a, _)| {
        condition(&a, "/reader: type_mismatch")
    });
    let words = "/ticks: expected std_msgs/msg/String, found std_msgs/msg/Int64";
    assert!(mismatch.starts_with(words), "{mismatch}");
    // On Zenoh other types have other keys: their samples never come.
    if environment.middleware == Middleware::Dds {
        let fault = wait(&diagnostics, "input_refused by name", |(a, _)| {
            let fault = condition(&a, "/reader: input_refused/ticks")?;
            fault.contains("of /ticker").then_some(fault)
        });
        assert!(fault.contains(words), "{fault}");
        let counted = "refused since the start: ";
        let count = fault
            .split(counted)
            .nth(1)
            .unwrap_or_else(|| panic!("{fault}"));
        let (count, of) = count.split_once(' ').unwrap();
        assert!(count.parse::<u64>().unwrap() > 1, "{fault}");
        assert!(of.starts_with("of another type, the first at "), "{fault}");
    }
    ticking.stop().unwrap();
    reading.stop().unwrap();
    watching.stop().unwrap();
}
