//! Whatever a stranger knocks at: every topic that nodes listen to, their services, parameters and the action that moves
//! the machine.

use std::time::Duration;

use abbe_msgs::topics;
use abbe_tests::cyclone::{Cyclone, end};
use abbe_tests::program::{Process, command, domain};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use abbe_tests::security::{enforce, keystore};
use serde_json::{Value, json};

const NODES: [&str; 3] = ["fake_cnc", "probe", "axis_compensation"];
const SEND: &str = "/cnc/run_program/_action/send_goal";
const CHANGE_STATE: &str = "/fake_cnc/change_state";
const SET: &str = "/probe/set_parameters";
const LIST: &str = "/axis_compensation/list_parameters";
const CLIENTS: [(&str, &str); 4] = [
    (SEND, "abbe_msgs/action/RunProgram_SendGoal"),
    (CHANGE_STATE, "lifecycle_msgs/srv/ChangeState"),
    (SET, "rcl_interfaces/srv/SetParameters"),
    (LIST, "rcl_interfaces/srv/ListParameters"),
];
/// How long the stranger tries; without credentials on either side everything has answered far earlier.
const TRIES: u32 = 20;

/// A stranger with a writer for what each of the nodes listens to and a client of what they serve.
fn stranger(python: &std::path::PathBuf, domain: u16) -> Cyclone {
    let writers = [
        end(&topics::COMPENSATION),
        end(&topics::PROBE_TRIGGER),
        end(&topics::THERMAL_MODEL),
        end(&topics::LATENCY),
    ];
    let readers = [end(&topics::AXES_STATE), end(&topics::DIAGNOSTICS)];
    let clients = CLIENTS.map(|(service, ros_type)| json!({"service": service, "type": ros_type}));
    let plan =
        json!({"domain": domain, "clients": clients, "readers": readers, "writers": writers});
    Cyclone::start_with(python, &plan)
}

/// What the machine is asked to do.
fn request(service: &str, number: u32) -> Value {
    match service {
        SEND => json!({
            "goal_id": {"uuid": vec![number; 16]},
            "goal": {"name": "stranger", "program": "G21 G90\nG1 X2 F600\nM2\n"},
        }),
        CHANGE_STATE => json!({"transition": {"id": 4}}),
        _ => json!({}),
    }
}

/// Asks everything again and again; names of what was found and of what answered, in order.
fn knock(stranger: &mut Cyclone) -> (Vec<String>, Vec<String>) {
    let (mut found, mut answered) = (Vec::new(), Vec::new());
    for number in 1..=TRIES {
        for (service, _) in CLIENTS {
            stranger.ask(service, i64::from(number), &request(service, number));
        }
        for event in stranger.events_within(Duration::from_secs(1)) {
            let topic = event["topic"].as_str().unwrap().to_owned();
            match event["event"].as_str().unwrap() {
                "matched" => found.push(topic),
                _ => answered.push(topic),
            }
        }
    }
    found.sort();
    answered.sort();
    answered.dedup();
    (found, answered)
}

/// Starts the nodes, with credentials where there is a keystore.
fn nodes(scenario: &Scenario, domain: u16, keys: Option<&std::path::Path>) -> Vec<Process> {
    let start = |node: &&str| {
        let file = scenario.argument(&format!("{node}.yaml"));
        let mut command = command(
            domain,
            &["node", node, "--ros-args", "--params-file", &file],
        );
        if let Some(keys) = keys {
            enforce(&mut command, keys);
        }
        Process::start(command)
    };
    NODES.iter().map(start).collect()
}

#[test]
fn a_stranger_finds_and_reaches_everything_without_security_and_nothing_with_it() {
    let test = "a stranger at services, actions and topics";
    let Some(python) = interpreter(test) else {
        return;
    };
    let scenario = Scenario::copy_of("short_cell");
    let keys = scenario.folder().join("keys");
    if !keystore(test, &keys, &scenario.folder()) {
        return;
    }
    let open = nodes(&scenario, domain(6), None);
    let (found, answered) = knock(&mut stranger(&python, domain(6)));
    open.into_iter().for_each(|node| drop(node.stop()));
    eprintln!("without security found {found:?}, heard from {answered:?}");
    assert_eq!(found.len(), CLIENTS.len() + 6, "{found:?}");
    for (service, _) in CLIENTS {
        assert!(answered.iter().any(|name| name == service), "{answered:?}");
    }

    let secured = nodes(&scenario, domain(7), Some(&keys));
    let (found, answered) = knock(&mut stranger(&python, domain(7)));
    secured.into_iter().for_each(|node| drop(node.stop()));
    assert_eq!((found, answered), (vec![], vec![]));
}
