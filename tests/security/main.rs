//! DDS Security: a cell whose nodes have credentials, and who has none.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests wait, look at clocks and read files"
)]
#![expect(clippy::print_stderr, reason = "figures that were seen are said")]

mod intruder;
mod unasked;

use std::path::Path;
use std::time::Duration;

use abbe_msgs::lifecycle_msgs::srv::{GetState, GetStateRequest};
use abbe_msgs::{from_cdr, topics};
use abbe_tests::cyclone::{Cyclone, end};
use abbe_tests::fast_dds::FastDds;
use abbe_tests::graph::now;
use abbe_tests::program::{Ended, Process, command, domain, root};
use abbe_tests::python::interpreter;
use abbe_tests::said::compensation;
use abbe_tests::scenario::{Scenario, mcap_file};
use abbe_tests::security::{enforce, keystore, met_in_secret};
use recorder::{Bag, Event, Order};

/// What the stranger asks for on X, m: no model of this short cell gives as much.
const INJECTED_M: f64 = 40e-6;
/// Between two of its messages.
const BEAT: Duration = Duration::from_millis(100);

/// A reader of states and compensations and a writer of compensations, by Cyclone DDS without credentials.
fn stranger(python: &std::path::PathBuf, domain: u16) -> Cyclone {
    let readers = [end(&topics::AXES_STATE), end(&topics::COMPENSATION)];
    Cyclone::start(python, domain, &readers, &[end(&topics::COMPENSATION)])
}

/// What the stranger heard while it spoke for some time: how many messages, and the furthest that a motor of X was from
/// its command, m.
fn heard(stranger: &mut Cyclone, time: Duration) -> (usize, f64) {
    let beats = time.as_millis() / BEAT.as_millis();
    let (mut heard, mut furthest_m) = (0, 0.0_f64);
    for _ in 0..beats {
        let message = serde_json::to_value(compensation(&now(), INJECTED_M)).unwrap();
        stranger.write(topics::COMPENSATION.name, &message);
        for state in stranger.samples_within(topics::AXES_STATE.name, BEAT) {
            let x = |key: &str| state[key][0].as_f64().unwrap();
            furthest_m = furthest_m.max((x("motor") - x("commanded")).abs());
            heard += 1;
        }
        let offsets = stranger.samples_within(topics::COMPENSATION.name, Duration::ZERO);
        let others = offsets.iter().filter(|said| said["total"][0] != INJECTED_M);
        heard += others.count();
    }
    (heard, furthest_m)
}

/// Greatest offsets on X in a bag, m, and how many messages there are.
fn compensations(bag: &Path) -> (f64, usize) {
    let bytes = std::fs::read(mcap_file(bag)).unwrap();
    let mut greatest_m = 0.0_f64;
    let mut n = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic == "/compensation" {
            let said: abbe_msgs::msg::AxisCompensation = from_cdr(&message.data).unwrap();
            greatest_m = greatest_m.max(said.total[0].abs());
            n += 1;
        }
    }
    (greatest_m, n)
}

#[test]
fn a_secured_cell_does_its_plan_while_a_stranger_hears_nothing_and_injects_nothing() {
    let test = "a secured cell";
    let Some(python) = interpreter(test) else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(0));
    let keys = scenario.folder().join("keys");
    if !keystore(test, &keys, &scenario.folder()) {
        return;
    }
    let mut run = command(domain, &["run", "--separate"]);
    run.arg(scenario.folder()).arg("--runs").arg(scenario.out());
    enforce(&mut run, &keys);
    let run = Process::start(run);
    let mut stranger = stranger(&python, domain);
    let (heard, _) = heard(&mut stranger, Duration::from_secs(30));
    let ended = run.ended_within(Duration::from_secs(240));
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    assert!(ended.said.contains(", 0 lost)"), "{}", ended.said);
    let bag = scenario.new_run(&[]).join("bag");
    let (greatest_m, n) = compensations(&bag);
    eprintln!(
        "stranger heard {heard}; {n} compensations, at most {:.2} um",
        greatest_m * 1e6
    );
    assert_eq!(heard, 0);
    assert!(
        n > 1000 && greatest_m < 0.5 * INJECTED_M,
        "{n} {greatest_m}"
    );
    assert!(
        !ended.said.contains("more than one publisher"),
        "{}",
        ended.said
    );
}

#[test]
fn the_same_stranger_hears_and_moves_a_machine_without_credentials() {
    let test = "a machine that is not secured";
    let Some(python) = interpreter(test) else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(1));
    let file = scenario.argument("fake_cnc.yaml");
    let node = Process::node(domain, "fake_cnc", &["--params-file", &file]);
    let mut stranger = stranger(&python, domain);
    let (heard, furthest_m) = heard(&mut stranger, Duration::from_secs(10));
    eprintln!(
        "the same stranger heard {heard} where nothing is secured, and moved a motor by {:.1} um",
        furthest_m * 1e6
    );
    assert!(heard > 20, "{heard}");
    assert!(furthest_m > 0.5 * INJECTED_M, "{furthest_m}");
    node.stop();
}

#[test]
fn fast_dds_with_an_operators_credentials_hears_and_asks_and_may_not_compensate() {
    let test = "Fast DDS with credentials";
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(3));
    let keys = scenario.folder().join("keys");
    if !keystore(test, &keys, &scenario.folder()) {
        return;
    }
    let operator = keys.join("enclaves/operator");
    let cell = (&scenario, domain, keys.as_path());
    let met = met_in_secret(cell, || FastDds::start_in(test, domain, &operator));
    let Some((node, mut peer)) = met else {
        return;
    };
    let state = peer.sample(&topics::AXES_STATE, |_| true);
    assert!(!state.commanded.is_empty(), "{state:?}");
    let service = "/fake_cnc/get_state";
    peer.client::<GetState>(service);
    let state = peer.asked::<GetState>(service, 1, &GetStateRequest::default());
    assert_eq!(state.current_state.label, "active");
    peer.may_not_speak(&topics::COMPENSATION);
    node.stop();
}

/// Starts axis_compensation in a keystore's enclave, its own or another, and lets it end.
fn started(scenario: &Scenario, keys: &Path, more: &[&str], change: &[(&str, &str)]) -> Ended {
    let file = scenario.argument("axis_compensation.yaml");
    let mut arguments = vec![
        "node",
        "axis_compensation",
        "--ros-args",
        "--params-file",
        &file,
    ];
    arguments.extend(more);
    let mut node = command(domain(2), &arguments);
    enforce(&mut node, keys);
    node.envs(change.iter().copied());
    Process::start(node).ended_within(Duration::from_secs(30))
}

#[test]
fn credentials_of_another_node_and_none_keep_a_node_from_its_topics() {
    let test = "wrong credentials";
    let scenario = Scenario::copy_of("short_cell");
    let keys = scenario.folder().join("keys");
    if !keystore(test, &keys, &scenario.folder()) {
        return;
    }
    let other = started(&scenario, &keys, &["--enclave", "/probe"], &[]);
    assert_eq!(other.status.code(), Some(1), "{}", other.said);
    assert!(other.said.contains("rt/compensation"), "{}", other.said);
    let own = keys.join("enclaves/axis_compensation");
    std::fs::remove_file(own.join("permissions.p7s")).unwrap();
    let none = started(&scenario, &keys, &[], &[]);
    assert_eq!(none.status.code(), Some(1), "{}", none.said);
    for word in ["/axis_compensation", "permissions.p7s", "abbe keystore"] {
        assert!(none.said.contains(word), "{word}: {}", none.said);
    }
    let forged = keys.join("enclaves/probe/permissions.p7s");
    let text = std::fs::read_to_string(&forged).unwrap();
    assert!(text.contains("rt/probe"), "{text}");
    std::fs::write(&forged, text.replace("rt/probe", "rt/compensation")).unwrap();
    let forged = started(&scenario, &keys, &["--enclave", "/probe"], &[]);
    assert_eq!(forged.status.code(), Some(1), "{}", forged.said);
    assert!(forged.said.contains("participant"), "{}", forged.said);
    let wrong = [("ROS_SECURITY_STRATEGY", "enforce")];
    let wrong = started(&scenario, &keys, &[], &wrong);
    assert_eq!(wrong.status.code(), Some(1), "{}", wrong.said);
    assert!(
        wrong.said.contains("ROS_SECURITY_STRATEGY=enforce"),
        "{}",
        wrong.said
    );
}

/// Messages of one topic in a bag.
fn messages(bag: &Path, topic: &str) -> usize {
    let bag = Bag::open(bag).unwrap();
    let mut all = bag.messages(Order::LogTime);
    let mut n = 0;
    while let Some(event) = all.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}")
        };
        n += usize::from(bag.topic(message.topic).topic == topic);
    }
    n
}

#[test]
fn a_bag_is_played_with_credentials_for_it_and_not_without() {
    let test = "playing with credentials";
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(4));
    let keys = scenario.folder().join("keys");
    if !keystore(test, &keys, &scenario.folder()) {
        return;
    }
    let bag = root().join("bags/cold_reference");
    let play = || {
        let mut play = command(domain, &["play"]);
        // Topics that ask for acknowledgement; at this rate others are lost on any network.
        play.arg(&bag).args(["--rate", "0", "--delay", "8"]);
        play.args([
            "--no-clock",
            "--topics",
            "/axes/state",
            "--topics",
            "/compensation",
        ]);
        enforce(&mut play, &keys);
        Process::start(play).ended_within(Duration::from_secs(120))
    };
    let refused = play();
    assert_eq!(refused.status.code(), Some(1), "{}", refused.said);
    assert!(refused.said.contains("/replayer"), "{}", refused.said);

    let mut make = command(domain, &["keystore"]);
    make.arg(&keys).arg("--play").arg(&bag);
    let made = Process::start(make).ended_within(Duration::from_secs(60));
    assert_eq!(made.status.code(), Some(0), "{}", made.said);
    let copy = scenario.folder().join("copy");
    let mut record = command(domain, &["record", "-o"]);
    record.arg(&copy);
    enforce(&mut record, &keys);
    let record = Process::start(record);
    let played = play();
    assert_eq!(played.status.code(), Some(0), "{}", played.said);
    assert!(played.said.contains(" 0 lost"), "{}", played.said);
    record.stop();
    let topic = "/axes/state";
    let (sent, heard) = (messages(&bag, topic), messages(&copy, topic));
    eprintln!("{heard} of {sent} messages of {topic} arrived encrypted");
    assert!(sent > 0);
    assert_eq!(heard, sent);
}
