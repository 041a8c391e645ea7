//! Topics, services and an action as a node on Fast DDS meets them: the identity of a request is in RTPS.

use abbe_msgs::action::{RunProgram, RunProgramGoal};
use abbe_msgs::action_msgs::msg::{GoalStatus, GoalStatusArray};
use abbe_msgs::action_msgs::srv::{CancelGoal, CancelGoalRequest};
use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::lifecycle_msgs::srv::{GetState, GetStateRequest};
use abbe_msgs::msg::ProbeLatency;
use abbe_msgs::rcl_interfaces::msg::ParameterEvent;
use abbe_msgs::rcl_interfaces::srv::{
    DescribeParameters, DescribeParametersRequest, GetParameters, GetParametersRequest,
};
use abbe_msgs::unique_identifier_msgs::msg::UUID;
use abbe_msgs::{
    Durability, FeedbackMessage, GetResult, GetResultRequest, SendGoal, SendGoalRequest, topics,
};
use abbe_tests::fast_dds::FastDds;
use abbe_tests::graph::now;
use abbe_tests::program::{Process, domain};
use abbe_tests::said::compensation;
use abbe_tests::scenario::Scenario;

const GET: &str = "/fake_cnc/get_parameters";
const DESCRIBE: &str = "/fake_cnc/describe_parameters";
const STATE: &str = "/fake_cnc/get_state";
const SEND: &str = "/cnc/run_program/_action/send_goal";
const RESULT: &str = "/cnc/run_program/_action/get_result";
const CANCEL: &str = "/cnc/run_program/_action/cancel_goal";
const FEEDBACK: &str = "/cnc/run_program/_action/feedback";
const STATUS: &str = "/cnc/run_program/_action/status";
/// Writers that say one message each.
const GREETINGS: u32 = 10;
/// What is asked for on X, m, and what of it must be seen at the motor.
const ASKED_M: f64 = 20e-6;
const SEEN_M: f64 = 5e-6;

/// A machine with the peer in its domain; `None`: Fast DDS is not here.
fn machine(test: &str, place: u16) -> Option<(Scenario, Process, FastDds)> {
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(place));
    let peer = FastDds::start(test, domain)?;
    let file = scenario.argument("fake_cnc.yaml");
    let node = Process::node(domain, "fake_cnc", &["--params-file", &file]);
    Some((scenario, node, peer))
}

#[test]
fn fast_dds_hears_states_and_its_compensations_move_the_machine() {
    let test = "fast_dds hears states";
    let Some((_scenario, node, mut peer)) = machine(test, 10) else {
        return;
    };
    peer.read(&topics::AXES_STATE);
    peer.speak(&topics::COMPENSATION);
    let at_rest = peer.sample(&topics::AXES_STATE, |_| true);
    assert!(
        (at_rest.motor[0] - at_rest.commanded[0]).abs() < SEEN_M,
        "{at_rest:?}"
    );
    let mut moved = false;
    for _ in 0..100 {
        let asked = compensation(&now(), ASKED_M);
        peer.write(&topics::COMPENSATION, &asked);
        let state = peer.sample(&topics::AXES_STATE, |_| true);
        moved |= state.motor[0] - state.commanded[0] > SEEN_M;
        if moved {
            break;
        }
    }
    assert!(moved, "the motor has not followed");
    node.stop();
}

#[test]
fn fast_dds_calls_services_and_an_action_in_its_own_mapping() {
    let test = "fast_dds calls services and an action";
    let Some((_scenario, node, mut peer)) = machine(test, 11) else {
        return;
    };
    peer.client::<GetParameters>(GET);
    peer.client::<GetState>(STATE);
    peer.client::<SendGoal<RunProgram>>(SEND);
    peer.client::<GetResult<RunProgram>>(RESULT);
    let names = |name: &str| GetParametersRequest {
        names: vec![name.to_owned()],
    };
    // Two questions at once: each answer finds its own.
    peer.ask::<GetParameters>(GET, 1, &names("background_rate_hz"));
    peer.ask::<GetParameters>(GET, 2, &names("nobody"));
    let nobody = peer.reply::<GetParameters>(GET, 2);
    let rate = peer.reply::<GetParameters>(GET, 1);
    assert_eq!(nobody.values[0].r#type, 0, "{nobody:?}");
    assert!(
        (rate.values[0].double_value - 10.0).abs() < 1e-12,
        "{rate:?}"
    );
    let state = peer.asked::<GetState>(STATE, 3, &GetStateRequest::default());
    assert_eq!(state.current_state.label, "active");
    let goal = goal(7, "G21 G90\nG1 X2 F600\nM2\n");
    let goal_id = goal.goal_id.clone();
    let accepted = peer.asked::<SendGoal<RunProgram>>(SEND, 4, &goal);
    assert!(accepted.accepted, "{accepted:?}");
    let asked = GetResultRequest {
        goal_id,
        ..Default::default()
    };
    let result = peer.asked::<GetResult<RunProgram>>(RESULT, 5, &asked);
    assert_eq!(result.status, GoalStatus::STATUS_SUCCEEDED, "{result:?}");
    assert_eq!(result.result.outcome, 0, "{result:?}");
    node.stop();
}

fn goal(id: u8, program: &str) -> SendGoalRequest<RunProgram> {
    SendGoalRequest {
        goal_id: UUID { uuid: [id; 16] },
        goal: RunProgramGoal {
            program: program.to_owned(),
            name: "peer".to_owned(),
        },
    }
}

#[test]
fn fast_dds_hears_how_far_a_goal_is_and_calls_it_off() {
    let test = "fast_dds calls a goal off";
    let Some((_scenario, node, mut peer)) = machine(test, 5) else {
        return;
    };
    peer.read(&topics::PARAMETER_EVENTS);
    let own = |event: &ParameterEvent| event.node == "/fake_cnc";
    let event = peer.sample(&topics::PARAMETER_EVENTS, own);
    let names: Vec<&str> = event
        .new_parameters
        .iter()
        .map(|p| p.name.as_str())
        .collect();
    assert!(names.contains(&"background_rate_hz"), "{names:?}");

    peer.client::<DescribeParameters>(DESCRIBE);
    let asked = DescribeParametersRequest {
        names: vec!["background_rate_hz".to_owned()],
    };
    let described = peer.asked::<DescribeParameters>(DESCRIBE, 1, &asked);
    let range = &described.descriptors[0].floating_point_range[0];
    assert!(range.from_value < range.to_value, "{described:?}");

    peer.client::<SendGoal<RunProgram>>(SEND);
    peer.client::<GetResult<RunProgram>>(RESULT);
    peer.client::<CancelGoal>(CANCEL);
    peer.read_named::<FeedbackMessage<RunProgram>>(FEEDBACK, Durability::Volatile);
    peer.read_named::<GoalStatusArray>(STATUS, Durability::TransientLocal);
    // Ten minutes of motion.
    let goal = goal(8, "G21 G90\nG1 X102 F10\nM2\n");
    let goal_id = goal.goal_id.clone();
    let accepted = peer.asked::<SendGoal<RunProgram>>(SEND, 2, &goal);
    assert!(accepted.accepted, "{accepted:?}");
    let is_at = |status: i8| {
        let goal_id = goal_id.clone();
        move |array: &GoalStatusArray| {
            let mut all = array.status_list.iter();
            all.any(|one| one.goal_info.goal_id == goal_id && one.status == status)
        }
    };
    peer.sample_named(STATUS, is_at(GoalStatus::STATUS_EXECUTING));
    let own = |said: &FeedbackMessage<RunProgram>| said.goal_id == goal_id;
    let first = peer.sample_named(FEEDBACK, own);
    let later = peer.sample_named(FEEDBACK, own);
    assert_eq!(first.feedback.line, later.feedback.line);

    let mut cancel = CancelGoalRequest::default();
    cancel.goal_info.goal_id = goal_id.clone();
    let canceling = peer.asked::<CancelGoal>(CANCEL, 3, &cancel);
    assert_eq!(canceling.return_code, 0, "{canceling:?}");
    peer.sample_named(STATUS, is_at(GoalStatus::STATUS_CANCELED));
    let asked = GetResultRequest {
        goal_id: goal_id.clone(),
        ..Default::default()
    };
    let result = peer.asked::<GetResult<RunProgram>>(RESULT, 4, &asked);
    assert_eq!(result.status, GoalStatus::STATUS_CANCELED, "{result:?}");
    node.stop();
}

#[test]
fn fast_dds_reads_replies_that_are_longer_than_a_datagram() {
    let test = "fast_dds reads long replies";
    let Some((_scenario, node, mut peer)) = machine(test, 9) else {
        return;
    };
    peer.client::<DescribeParameters>(DESCRIBE);
    let name = "background_rate_hz";
    let names = |count: usize| DescribeParametersRequest {
        names: vec![name.to_owned(); count],
    };
    // A short one behind a long one waits for it: samples of a writer come in order.
    for (number, count) in [(1, 1), (2, 1_500), (3, 2), (4, 3_000), (5, 1)] {
        peer.ask::<DescribeParameters>(DESCRIBE, number, &names(count));
        let described = peer.reply::<DescribeParameters>(DESCRIBE, number);
        assert_eq!(described.descriptors.len(), count);
        assert!(described.descriptors.iter().all(|one| one.name == name));
    }
    node.stop();
}

/// What a node has counted on a topic until now, as it says on `/diagnostics` every second. What it said before this was
/// asked waits in the queue, and is passed over.
fn received(peer: &mut FastDds, node: &str, topic: &str) -> u32 {
    let key = format!("{topic} received");
    let count = |told: &DiagnosticArray| {
        let of_node = told.status.iter().filter(|status| status.name == node);
        let mut values = of_node.flat_map(|status| &status.values);
        let value = values.find(|value| value.key == key)?;
        value.value.parse::<u32>().ok()
    };
    let asked = now();
    let told = peer.sample(&topics::DIAGNOSTICS, |told| {
        let stamp = &told.header.stamp;
        (stamp.sec, stamp.nanosec) > (asked.sec, asked.nanosec) && count(told).is_some()
    });
    count(&told).unwrap()
}

#[test]
fn the_first_sample_of_a_fast_dds_writer_that_was_just_met_is_heard() {
    let test = "the first sample of fast_dds";
    let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(8));
    let Some(mut peer) = FastDds::start(test, domain) else {
        return;
    };
    let file = scenario.argument("probe.yaml");
    let node = Process::node(domain, "probe", &["--params-file", &file]);
    peer.read(&topics::DIAGNOSTICS);
    let before = received(&mut peer, "/probe", "/latency");
    let latency = ProbeLatency {
        method: 2,
        latency_s: 0.0011,
        standard_uncertainty_s: 1e-5,
        ..ProbeLatency::default()
    };
    for _ in 0..GREETINGS {
        peer.greet(&topics::LATENCY, &latency);
    }
    let after = received(&mut peer, "/probe", "/latency");
    assert_eq!(after - before, GREETINGS);
    node.stop();
}
