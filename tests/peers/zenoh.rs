//! A graph over Zenoh as PyPI `eclipse-zenoh` sees it and speaks in it, on the keys of `rmw_zenoh_cpp`.

use std::process::Stdio;
use std::time::Duration;

use abbe_msgs::msg::AxisState;
use abbe_msgs::{Message, topics};
use abbe_tests::program::{Process, command, domain};
use abbe_tests::python::{interpreter, script, succeeded};
use abbe_tests::scenario::Scenario;
use abbe_tests::zenoh::{Router, built_in, endpoint, through};
use recorder::{Bag, Event, Order};
use serde_json::{Value, json};

/// Real time of the short cell's plan, with its start and its page.
const CELL: Duration = Duration::from_secs(150);

fn on_zenoh(domain: u16, arguments: &[&str]) -> std::process::Command {
    let mut command = command(domain, arguments);
    command.envs(through(&endpoint(domain)));
    command
}

/// The token of an end, split at its slashes.
fn token<'t>(seen: &'t Value, kind: &str, name: &str) -> Vec<&'t str> {
    let mangled = name.replace('/', "%");
    let tokens = seen["tokens"].as_array().unwrap();
    let mut parts = tokens
        .iter()
        .map(|token| token.as_str().unwrap().split('/').collect());
    let is_meant = |parts: &Vec<&str>| parts[5] == kind && parts.get(9) == Some(&mangled.as_str());
    parts
        .find(is_meant)
        .unwrap_or_else(|| panic!("{kind} {name}: {tokens:?}"))
}

#[test]
fn python_hears_asks_and_is_recorded_over_zenoh() {
    let name = "python hears, asks and is recorded over Zenoh";
    let Some(python) = interpreter(name).filter(|_| built_in(name)) else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(11));
    scenario.replace(
        "fake_cnc.yaml",
        "background_rate_hz: 10.0",
        "background_rate_hz: 500.0",
    );
    let _router = Router::start(&python, &[], &endpoint(domain), &[]);
    let file = scenario.argument("fake_cnc.yaml");
    let arguments = ["node", "fake_cnc", "--ros-args", "--params-file", &file];
    let node = Process::start(on_zenoh(domain, &arguments));
    let into = scenario.path("bag");
    let arguments = ["record", "-o", into.to_str().unwrap()];
    let recording = Process::start(on_zenoh(domain, &arguments));

    let output = script(&python, "zenoh_peer.py")
        .args(["meet", &endpoint(domain), &domain.to_string()])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let seen: Value = serde_json::from_str(&succeeded(&output)).unwrap();
    recording.stop();
    node.stop();

    ends_are_told_as_rmw_zenoh_cpp_tells_them(&seen);
    what_is_said_arrives(&seen);
    what_is_asked_is_done(&seen);
    let recorded = counts(&into);
    let of = |topic: &str| recorded.iter().find(|(name, ..)| name == topic).unwrap();
    assert_eq!(of("/from_python").1, "strange_msgs/msg/Bar");
    assert_eq!(
        of("/from_python").2,
        100,
        "a type that we do not know, by the hash of its token"
    );
    assert!(of("/axes/state").2 > 500);
}

fn ends_are_told_as_rmw_zenoh_cpp_tells_them(seen: &Value) {
    let state = token(seen, "MP", "/axes/state");
    assert_eq!(state[8], "fake_cnc");
    assert_eq!(state[10], "abbe_msgs::msg::dds_::AxisState_");
    assert_eq!(
        (state[11], seen["hash"].as_str().unwrap()),
        (AxisState::TYPE_HASH, AxisState::TYPE_HASH)
    );
    assert_eq!(
        state[12],
        format!("::,{}:,:,:,,", topics::AXES_STATE.qos.depth)
    );
    assert_eq!(
        token(seen, "MP", "/cnc/run_program/_action/status")[12],
        ":1:,1:,:,:,,"
    );
    assert_eq!(
        token(seen, "SS", "/fake_cnc/change_state")[10],
        "lifecycle_msgs::srv::dds_::ChangeState_"
    );
}

fn what_is_said_arrives(seen: &Value) {
    let states = &seen["states"];
    let numbers: Vec<i64> = serde_json::from_value(states["numbers"].clone()).unwrap();
    assert!(
        numbers.len() >= 200 && numbers.windows(2).all(|pair| pair[1] == pair[0] + 1),
        "{numbers:?}"
    );
    assert_eq!(states["senders"].as_array().unwrap().len(), 1);
    assert_eq!(states["motor"].as_array().unwrap().len(), 5, "{states}");
    let z_m = states["motor"][2].as_f64().unwrap();
    assert!(
        (z_m - 0.24).abs() < 1e-6,
        "where short_cell's Z waits: {z_m}"
    );
    assert_eq!(seen["latched"], 1, "who comes late gets the last state");
    assert_eq!(
        (&seen["parameters"], &seen["accepted"]),
        (&Value::Bool(true), &Value::Bool(true))
    );
    assert_eq!(seen["status"], 4, "the goal succeeded");
    eprintln!(
        "axes/state at 500 Hz, Rust to Python: p50, p99 us: {}",
        states["delay_us"]
    );
}

fn what_is_asked_is_done(seen: &Value) {
    let values = &seen["values"];
    assert_eq!(
        (&values["kind"], &values["rate_hz"]),
        (&json!(3), &json!(500.0))
    );
    assert_eq!(values["set"], false);
    let reason = values["reason"].as_str().unwrap();
    assert!(reason.contains("frozen"), "{reason}");
    let called_off = &seen["called_off"];
    assert!(called_off["feedback"].as_u64().unwrap() > 0, "{called_off}");
    // No error; canceled.
    assert_eq!(
        (&called_off["cancel"], &called_off["status"]),
        (&json!(0), &json!(5))
    );
    assert_eq!(
        seen["managed"],
        json!([[true, "inactive"], [true, "active"]])
    );
}

/// Topics of a whole bag, their types and numbers of messages.
fn counts(bag: &std::path::Path) -> Vec<(String, String, u64)> {
    let bag = Bag::open(bag).unwrap();
    let mut counts = vec![0; bag.topics().len()];
    let mut messages = bag.messages(Order::File);
    while let Some(event) = messages.next_event() {
        match event {
            Event::Message(message) => counts[message.topic.index()] += 1,
            Event::Loss(loss) => panic!("{loss}"),
        }
    }
    let topics = bag.topics().iter().zip(counts);
    topics
        .map(|(topic, count)| (topic.topic.clone(), topic.type_name.clone(), count))
        .collect()
}

#[test]
fn a_cell_of_separate_processes_runs_its_plan_over_zenoh() {
    let name = "a cell runs its plan over Zenoh";
    let Some(python) = interpreter(name).filter(|_| built_in(name)) else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(12));
    let _router = Router::start(&python, &[], &endpoint(domain), &[]);
    let mut run = on_zenoh(domain, &["run", "--separate"]);
    run.arg(scenario.folder()).arg("--runs").arg(scenario.out());
    let ended = Process::start(run).ended_within(CELL);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    assert!(!ended.said.contains("samples_lost"), "{}", ended.said);
    assert!(!ended.said.contains("samples_not_sent"), "{}", ended.said);
    eprintln!("{}", ended.said);
}
