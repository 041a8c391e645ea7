//! Services and actions as a node on Cyclone DDS calls them: 16 bytes in front of every request and reply
//! say whose it is. Fast DDS's is in `fast.rs`.

use std::time::Duration;

use abbe_msgs::action::RunProgram;
use abbe_msgs::action_msgs::msg::GoalStatusArray;
use abbe_msgs::lifecycle_msgs::msg::TransitionEvent;
use abbe_msgs::msg::AxisState;
use abbe_msgs::{FeedbackMessage, Message as _, topics};
use abbe_tests::cyclone::{Cyclone, end, named_end};
use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use serde_json::{Value, json};

const GET: &str = "/fake_cnc/get_parameters";
const SET: &str = "/fake_cnc/set_parameters";
const DESCRIBE: &str = "/fake_cnc/describe_parameters";
const TYPES: &str = "/fake_cnc/get_parameter_types";
const SET_ALL: &str = "/fake_cnc/set_parameters_atomically";
const DESCRIPTION: &str = "/fake_cnc/get_type_description";
const LEVEL: &str = "/fake_cnc/set_logger_levels";
const SEND: &str = "/cnc/run_program/_action/send_goal";
const CANCEL: &str = "/cnc/run_program/_action/cancel_goal";
const RESULT: &str = "/cnc/run_program/_action/get_result";
const FEEDBACK: &str = "/cnc/run_program/_action/feedback";
const STATUS: &str = "/cnc/run_program/_action/status";

const GET_STATE: &str = "/fake_cnc/get_state";
const CHANGE_STATE: &str = "/fake_cnc/change_state";
const GRAPH: &str = "/fake_cnc/get_transition_graph";
const TRANSITIONS: &str = "fake_cnc/transition_event";

const CLIENTS: [(&str, &str); 13] = [
    (GET, "rcl_interfaces/srv/GetParameters"),
    (SET, "rcl_interfaces/srv/SetParameters"),
    (DESCRIBE, "rcl_interfaces/srv/DescribeParameters"),
    (TYPES, "rcl_interfaces/srv/GetParameterTypes"),
    (SET_ALL, "rcl_interfaces/srv/SetParametersAtomically"),
    (
        DESCRIPTION,
        "type_description_interfaces/srv/GetTypeDescription",
    ),
    (LEVEL, "rcl_interfaces/srv/SetLoggerLevels"),
    (GET_STATE, "lifecycle_msgs/srv/GetState"),
    (CHANGE_STATE, "lifecycle_msgs/srv/ChangeState"),
    (GRAPH, "lifecycle_msgs/srv/GetAvailableTransitions"),
    (SEND, "abbe_msgs/action/RunProgram_SendGoal"),
    (CANCEL, "action_msgs/srv/CancelGoal"),
    (RESULT, "abbe_msgs/action/RunProgram_GetResult"),
];

const PAUSE: &str = "/replayer/pause";
const RESUME: &str = "/replayer/resume";
const STEP: &str = "/replayer/step";

/// Behind the bag's only latency, s.
const FROM_S: &str = "10.5";

/// Statuses of `action_msgs/GoalStatus`.
const EXECUTING: i64 = 2;
const SUCCEEDED: i64 = 4;
const CANCELED: i64 = 5;
const ABORTED: i64 = 6;
/// State of `RunProgram`'s feedback.
const RUNNING: i64 = 1;

#[test]
fn cyclone_calls_services_and_an_action_in_its_own_mapping() {
    let Some(python) = interpreter("cyclone calls services and an action") else {
        return;
    };
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(3));
    let file = scenario.argument("fake_cnc.yaml");
    let node = Process::node(domain, "fake_cnc", &["--params-file", &file]);
    let transitions = named_end::<TransitionEvent>(TRANSITIONS, true, false, 10);
    let heard = [
        end(&topics::ROSOUT),
        end(&topics::PARAMETER_EVENTS),
        transitions,
        named_end::<FeedbackMessage<RunProgram>>(FEEDBACK, true, false, 10),
        named_end::<GoalStatusArray>(STATUS, true, true, 1),
    ];
    let mut cyclone = Cyclone::asking(&python, domain, &CLIENTS, &heard);
    for (service, _) in CLIENTS {
        cyclone.matched_after_s(service);
    }
    let events = topics::PARAMETER_EVENTS.name;
    let event = cyclone.sample(events, |event| event["node"] == "/fake_cnc");
    let new = event["new_parameters"].as_array().unwrap();
    assert!(
        new.iter().any(|one| one["name"] == "background_rate_hz"),
        "{event}"
    );
    parameters(&mut cyclone);
    type_description(&mut cyclone);
    log_level(&mut cyclone);
    action(&mut cyclone);
    lifecycle(&mut cyclone);
    cyclone.stop();
    node.stop();
}

fn asked(cyclone: &mut Cyclone, service: &str, number: i64, request: &Value) -> Value {
    cyclone.ask(service, number, request);
    cyclone.reply(service, number)
}

fn parameters(cyclone: &mut Cyclone) {
    let names = json!({"names": ["background_rate_hz", "nobody"]});
    // A number that needs more than four bytes, and the first one: each has its own answer.
    for number in [5_000_000_000, 1] {
        let got = asked(cyclone, GET, number, &names);
        assert_eq!(got["values"][0]["type"], 3, "{got}");
        assert_eq!(got["values"][0]["double_value"], 10.0, "{got}");
        assert_eq!(got["values"][1]["type"], 0, "{got}");
    }
    let described = asked(cyclone, DESCRIBE, 2, &names);
    let range = &described["descriptors"][0]["floating_point_range"][0];
    let (from, to) = (range["from_value"].as_f64(), range["to_value"].as_f64());
    assert!(from.unwrap() < to.unwrap(), "{described}");
    let set = |value: f64| {
        let value = json!({"type": 3, "double_value": value});
        json!({"parameters": [{"name": "background_rate_hz", "value": value}]})
    };
    for (value, reason) in [(20.0, "frozen"), (-1.0, "-1 is outside")] {
        let refused = asked(cyclone, SET, 3, &set(value))["results"][0].take();
        assert_eq!(refused["successful"], false);
        let said = refused["reason"].as_str().unwrap();
        assert!(said.contains(reason), "{said}");
    }
    let refused = asked(cyclone, SET_ALL, 1, &set(20.0))["result"].take();
    assert_eq!(refused["successful"], false, "{refused}");
    assert!(
        refused["reason"].as_str().unwrap().contains("frozen"),
        "{refused}"
    );
    let types = asked(cyclone, TYPES, 1, &names);
    assert_eq!(types["types"], json!([3, 0]), "{types}");
}

/// As a recorder asks for what it does not know.
fn type_description(cyclone: &mut Cyclone) {
    let request = json!({
        "type_name": AxisState::TYPE_NAME,
        "type_hash": AxisState::TYPE_HASH,
        "include_type_sources": true,
    });
    let told = asked(cyclone, DESCRIPTION, 1, &request);
    assert_eq!(told["successful"], true, "{told}");
    let whole = &told["type_description"]["type_description"];
    assert_eq!(whole["type_name"], AxisState::TYPE_NAME, "{told}");
    let fields = whole["fields"].as_array().unwrap().iter();
    let names: Vec<&str> = fields.filter_map(|field| field["name"].as_str()).collect();
    assert!(
        names.contains(&"commanded") && names.contains(&"motor"),
        "{names:?}"
    );
    let parts = told["type_description"]["referenced_type_descriptions"].as_array();
    let is_header = |part: &&Value| part["type_name"] == "std_msgs/msg/Header";
    assert_eq!(parts.unwrap().iter().filter(is_header).count(), 1, "{told}");
    let sources = told["type_sources"].as_array().unwrap();
    let of_file = |source: &&Value| {
        let text = source["raw_file_contents"].as_str().unwrap_or_default();
        source["type_name"] == AxisState::TYPE_NAME && text.contains("commanded")
    };
    assert_eq!(sources.iter().filter(of_file).count(), 1, "{sources:?}");
    let unknown = json!({"type_name": "strange_msgs/msg/Bar"});
    let refused = asked(cyclone, DESCRIPTION, 2, &unknown);
    assert_eq!(refused["successful"], false, "{refused}");
}

fn log_level(cyclone: &mut Cyclone) {
    let levels = json!({"levels": [{"name": "fake_cnc", "level": 10}, {"name": "x", "level": 10}]});
    let results = asked(cyclone, LEVEL, 4, &levels)["results"].take();
    assert_eq!(results[0]["successful"], true, "{results}");
    assert_eq!(results[1]["successful"], false, "{results}");
}

fn state(cyclone: &mut Cyclone, number: i64) -> String {
    let state = asked(cyclone, GET_STATE, number, &json!({}));
    state["current_state"]["label"].as_str().unwrap().to_owned()
}

fn lifecycle(cyclone: &mut Cyclone) {
    cyclone.matched_after_s(TRANSITIONS);
    assert_eq!(state(cyclone, 1), "active");
    let graph = asked(cyclone, GRAPH, 1, &json!({}));
    let steps = graph["available_transitions"].as_array().unwrap();
    assert_eq!(steps.len(), 25, "{graph}");
    let deactivate = &steps[12];
    assert_eq!(deactivate["transition"]["label"], "deactivate");
    assert_eq!(deactivate["goal_state"]["label"], "deactivating");
    // By number, as `ros2 lifecycle set` asks.
    let change = |id: u8| json!({"transition": {"id": id, "label": ""}});
    let refused = asked(cyclone, CHANGE_STATE, 1, &change(3));
    assert_eq!(refused["success"], false, "it is active already");
    let done = asked(cyclone, CHANGE_STATE, 2, &change(4));
    assert_eq!(done["success"], true, "{done}");
    for goal in ["deactivating", "inactive"] {
        cyclone.sample(TRANSITIONS, |event| event["goal_state"]["label"] == goal);
    }
    assert_eq!(state(cyclone, 2), "inactive");
    // Taken and aborted at once, so that the reason reaches its client.
    let taken = asked(cyclone, SEND, 3, &goal(9, "G21 G90\nG1 X3 F600\nM2\n"));
    assert_eq!(taken["accepted"], true, "{taken}");
    let result = asked(
        cyclone,
        RESULT,
        3,
        &json!({"goal_id": {"uuid": vec![9; 16]}}),
    );
    assert_eq!(result["status"], ABORTED, "{result}");
    let message = &result["result"]["message"];
    assert_eq!(*message, "the control is not active");
    let done = asked(cyclone, CHANGE_STATE, 3, &change(3));
    assert_eq!(done["success"], true, "{done}");
    let accepted = asked(cyclone, SEND, 4, &goal(10, "G21 G90\nG1 X3 F600\nM2\n"));
    assert_eq!(accepted["accepted"], true, "{accepted}");
    let result = asked(
        cyclone,
        RESULT,
        4,
        &json!({"goal_id": {"uuid": vec![10; 16]}}),
    );
    assert_eq!(result["status"], SUCCEEDED, "{result}");
}

fn goal(uuid: u8, program: &str) -> Value {
    let id = json!({"uuid": vec![uuid; 16]});
    json!({"goal_id": id, "goal": {"name": "peer", "program": program}})
}

fn action(cyclone: &mut Cyclone) {
    let id = |uuid: u8| json!({"goal_id": {"uuid": vec![uuid; 16]}});
    let accepted = asked(cyclone, SEND, 1, &goal(7, "G21 G90\nG1 X2 F600\nM2\n"));
    assert_eq!(accepted["accepted"], true, "{accepted}");
    let result = asked(cyclone, RESULT, 1, &id(7));
    assert_eq!(result["status"], SUCCEEDED, "{result}");
    assert_eq!(result["result"]["outcome"], 0, "{result}");
    // Ten minutes of motion, called off once it is seen to run.
    let accepted = asked(cyclone, SEND, 2, &goal(8, "G21 G90\nG1 X102 F10\nM2\n"));
    assert_eq!(accepted["accepted"], true, "{accepted}");
    let own = json!(vec![8; 16]);
    let is_at = |status: i64| {
        let own = own.clone();
        move |array: &Value| {
            let all = array["status_list"].as_array().unwrap();
            all.iter()
                .any(|one| one["goal_info"]["goal_id"]["uuid"] == own && one["status"] == status)
        }
    };
    cyclone.sample(STATUS, is_at(EXECUTING));
    for _ in 0..2 {
        let said = cyclone.sample(FEEDBACK, |said| said["goal_id"]["uuid"] == own);
        assert_eq!(said["feedback"]["state"], RUNNING, "{said}");
    }
    let cancel = json!({"goal_info": id(8)});
    let canceling = asked(cyclone, CANCEL, 1, &cancel);
    assert_eq!(canceling["return_code"], 0, "{canceling}");
    let named = &canceling["goals_canceling"][0]["goal_id"]["uuid"];
    assert_eq!(*named, json!(vec![8; 16]), "{canceling}");
    let result = asked(cyclone, RESULT, 2, &id(8));
    assert_eq!(result["status"], CANCELED, "{result}");
    cyclone.sample(STATUS, is_at(CANCELED));
}

#[test]
fn cyclone_pauses_steps_and_resumes_a_bag_that_is_played() {
    let Some(python) = interpreter("cyclone steers a bag that is played") else {
        return;
    };
    let domain = domain(4);
    let bag = root().join("bags/cold_reference");
    let mut play = command(domain, &["play"]);
    // From behind the only latency on: it is latched, and comes first.
    play.arg(&bag)
        .args([
            "--topics",
            "/latency",
            "--topics",
            "/probe/point",
            "--paused",
        ])
        .args(["--from", FROM_S, "--rate", "2", "--delay", "0"]);
    let playing = Process::start(play);
    let clients = [PAUSE, RESUME, STEP].map(|service| (service, "std_srvs/srv/Trigger"));
    let (latency, point) = (&topics::LATENCY, &topics::PROBE_POINT);
    let mut cyclone = Cyclone::asking(&python, domain, &clients, &[end(latency), end(point)]);
    for name in [PAUSE, RESUME, STEP, latency.name, point.name] {
        cyclone.matched_after_s(name);
    }
    let nothing = json!({});
    let told = |reply: Value| {
        assert_eq!(reply["success"], true, "{reply}");
        reply["message"].as_str().unwrap().to_owned()
    };
    let still = Duration::from_millis(500);
    assert!(cyclone.samples_within(point.name, still).is_empty());
    let said = told(asked(&mut cyclone, STEP, 1, &nothing));
    assert!(said.starts_with("paused at "), "{said}");
    let first = cyclone.sample(point.name, |_| true);
    cyclone.sample(latency.name, |_| true);
    assert!(cyclone.samples_within(point.name, still).is_empty());
    let said = told(asked(&mut cyclone, RESUME, 2, &nothing));
    assert!(said.starts_with("playing at "), "{said}");
    let second = cyclone.sample(point.name, |_| true);
    assert_ne!(first["header"], second["header"]);
    let said = told(asked(&mut cyclone, PAUSE, 3, &nothing));
    assert!(said.starts_with("paused at "), "{said}");
    let again = asked(&mut cyclone, PAUSE, 4, &nothing);
    assert_eq!(again["success"], false, "{again}");
    assert_eq!(again["message"], "it is paused already");
    // What was on its way has come by then; two more touches would have, were it not paused.
    cyclone.samples_within(point.name, still);
    let stood = cyclone.samples_within(point.name, 3 * still);
    assert!(stood.is_empty(), "{stood:?}");
    told(asked(&mut cyclone, RESUME, 5, &nothing));
    cyclone.sample(point.name, |_| true);
    cyclone.stop();
    let ended = playing.ended_within(Duration::from_secs(30));
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
}
