//! Servers of other people's DDS that our own clients meet: a switch of a compensation, and a controller behind
//! `cnc/run_program`. What the controller decides is here; requests and answers go through its DDS, in its own mapping.

use std::convert::Infallible;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use abbe_msgs::action::{
    RunCycle, RunCycleGoal, RunProgram, RunProgramFeedback, RunProgramGoal, RunProgramResult,
};
use abbe_msgs::action_msgs::msg::{GoalInfo, GoalStatus, GoalStatusArray};
use abbe_msgs::action_msgs::srv::{CancelGoal, CancelGoalRequest, CancelGoalResponse};
use abbe_msgs::msg::PlanStatus;
use abbe_msgs::std_srvs::srv::{SetBool, SetBoolResponse};
use abbe_msgs::unique_identifier_msgs::msg::UUID;
use abbe_msgs::{
    Durability, ENCAPSULATION, FeedbackMessage, GetResult, GetResultRequest, GetResultResponse,
    SendGoal, SendGoalRequest, SendGoalResponse, Service, to_cdr, topics,
};
use abbe_tests::cyclone::{Cyclone, end, named_end};
use abbe_tests::fast_dds::FastDds;
use abbe_tests::graph::now;
use abbe_tests::program::{Process, domain};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use abbe_tests::zenoh::environment;
use metrology::Stage;
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::arguments::Arguments;
use node_runtime::{ClientSignal, GoalNews, GoalStatus as Ended, Setup, Wiring, launch};
use serde_json::{Value, from_value, json, to_value};

const SWITCH: &str = "/axis_compensation/enable";
const SEND: &str = "/cnc/run_program/_action/send_goal";
const CANCEL: &str = "/cnc/run_program/_action/cancel_goal";
const RESULT: &str = "/cnc/run_program/_action/get_result";
const FEEDBACK: &str = "/cnc/run_program/_action/feedback";
const STATUS: &str = "/cnc/run_program/_action/status";
const SEND_CYCLE: &str = "/sequencer/run_cycle/_action/send_goal";
const CANCEL_CYCLE: &str = "/sequencer/run_cycle/_action/cancel_goal";
const CYCLE_RESULT: &str = "/sequencer/run_cycle/_action/get_result";

/// A DDS that is not ours, as server and client.
trait Foreign {
    fn request<V: Service>(&mut self, service: &str) -> (u64, V::Request);
    fn answer<V: Service>(&mut self, service: &str, number: u64, response: &V::Response);
    fn feedback(&mut self, message: &FeedbackMessage<RunProgram>);
    fn status(&mut self, message: &GoalStatusArray);
    fn plan_status(&mut self, pick: fn(&PlanStatus) -> bool) -> PlanStatus;
    fn ask<V: Service>(&mut self, service: &str, number: i64, request: &V::Request);
    fn reply<V: Service>(&mut self, service: &str, number: i64) -> V::Response;
}

impl Foreign for Cyclone {
    fn request<V: Service>(&mut self, service: &str) -> (u64, V::Request) {
        let (number, request) = Self::request(self, service);
        (number, from_value(request).unwrap())
    }

    fn answer<V: Service>(&mut self, service: &str, number: u64, response: &V::Response) {
        Self::answer(self, service, number, &to_value(response).unwrap());
    }

    fn feedback(&mut self, message: &FeedbackMessage<RunProgram>) {
        self.write(FEEDBACK, &to_value(message).unwrap());
    }

    fn status(&mut self, message: &GoalStatusArray) {
        self.write(STATUS, &to_value(message).unwrap());
    }

    fn plan_status(&mut self, pick: fn(&PlanStatus) -> bool) -> PlanStatus {
        let read = |value: &Value| -> PlanStatus { from_value(value.clone()).unwrap() };
        read(&self.sample(topics::PLAN_STATUS.name, |value| pick(&read(value))))
    }

    fn ask<V: Service>(&mut self, service: &str, number: i64, request: &V::Request) {
        Self::ask(self, service, number, &to_value(request).unwrap());
    }

    fn reply<V: Service>(&mut self, service: &str, number: i64) -> V::Response {
        from_value(Self::reply(self, service, number)).unwrap()
    }
}

impl Foreign for FastDds {
    fn request<V: Service>(&mut self, service: &str) -> (u64, V::Request) {
        Self::request::<V>(self, service)
    }

    fn answer<V: Service>(&mut self, service: &str, number: u64, response: &V::Response) {
        Self::answer::<V>(self, service, number, response);
    }

    fn feedback(&mut self, message: &FeedbackMessage<RunProgram>) {
        self.write_named(FEEDBACK, &to_cdr(message));
    }

    fn status(&mut self, message: &GoalStatusArray) {
        self.write_named(STATUS, &to_cdr(message));
    }

    fn plan_status(&mut self, pick: fn(&PlanStatus) -> bool) -> PlanStatus {
        self.sample(&topics::PLAN_STATUS, pick)
    }

    fn ask<V: Service>(&mut self, service: &str, number: i64, request: &V::Request) {
        Self::ask::<V>(self, service, number, request);
    }

    fn reply<V: Service>(&mut self, service: &str, number: i64) -> V::Response {
        Self::reply::<V>(self, service, number)
    }
}

fn cyclone(test: &str, domain: u16) -> Option<Cyclone> {
    let python = interpreter(test)?;
    let service = |name: &str, ros_type: &str| json!({"service": name, "type": ros_type});
    let plan = json!({
        "domain": domain,
        "servers": [
            service(SWITCH, "std_srvs/srv/SetBool"),
            service(SEND, "abbe_msgs/action/RunProgram_SendGoal"),
            service(CANCEL, "action_msgs/srv/CancelGoal"),
            service(RESULT, "abbe_msgs/action/RunProgram_GetResult"),
        ],
        "clients": [
            service(SEND_CYCLE, "abbe_msgs/action/RunCycle_SendGoal"),
            service(CANCEL_CYCLE, "action_msgs/srv/CancelGoal"),
            service(CYCLE_RESULT, "abbe_msgs/action/RunCycle_GetResult"),
        ],
        "readers": [end(&topics::PLAN_STATUS)],
        "writers": [
            named_end::<FeedbackMessage<RunProgram>>(FEEDBACK, true, false, 10),
            named_end::<GoalStatusArray>(STATUS, true, true, 1),
        ],
    });
    Some(Cyclone::start_with(&python, &plan))
}

fn fast_dds(test: &str, domain: u16) -> Option<FastDds> {
    let mut peer = FastDds::start(test, domain)?;
    peer.server::<SetBool>(SWITCH);
    peer.server::<SendGoal<RunProgram>>(SEND);
    peer.server::<CancelGoal>(CANCEL);
    peer.server::<GetResult<RunProgram>>(RESULT);
    peer.speak_named::<FeedbackMessage<RunProgram>>(FEEDBACK, Durability::Volatile);
    peer.speak_named::<GoalStatusArray>(STATUS, Durability::TransientLocal);
    Some(peer)
}

/// The controller that a peer is.
struct Controller<'p, P>(&'p mut P);

impl<P: Foreign> Controller<'_, P> {
    fn proposed(&mut self) -> (u64, SendGoalRequest<RunProgram>) {
        self.0.request::<SendGoal<RunProgram>>(SEND)
    }

    fn answer_goal(&mut self, number: u64, accepted: bool) {
        let answer = SendGoalResponse {
            accepted,
            stamp: now(),
            ..SendGoalResponse::default()
        };
        self.0.answer::<SendGoal<RunProgram>>(SEND, number, &answer);
    }

    /// Takes the next program; what it is.
    fn take(&mut self) -> (UUID, RunProgramGoal) {
        let (number, request) = self.proposed();
        self.answer_goal(number, true);
        self.tell(&request.goal_id, GoalStatus::STATUS_EXECUTING);
        (request.goal_id, request.goal)
    }

    fn tell(&mut self, goal_id: &UUID, status: i8) {
        let goal_info = GoalInfo {
            goal_id: goal_id.clone(),
            stamp: now(),
        };
        self.0.status(&GoalStatusArray {
            status_list: vec![GoalStatus { goal_info, status }],
        });
    }

    fn feedback(&mut self, goal_id: &UUID, line: u32, progress: f64) {
        self.0.feedback(&FeedbackMessage {
            goal_id: goal_id.clone(),
            feedback: RunProgramFeedback {
                line,
                state: RunProgramFeedback::STATE_RUNNING,
                progress,
            },
        });
    }

    /// Ends the program; its client asks for the result as soon as it is taken.
    fn end(&mut self, goal_id: &UUID, status: i8, outcome: u8, message: &str) {
        let (number, asked): (_, GetResultRequest<RunProgram>) =
            self.0.request::<GetResult<RunProgram>>(RESULT);
        assert_eq!(asked.goal_id, *goal_id);
        let result = RunProgramResult {
            outcome,
            message: message.to_owned(),
            line: 2,
        };
        let answer = GetResultResponse { status, result };
        self.0
            .answer::<GetResult<RunProgram>>(RESULT, number, &answer);
        self.tell(goal_id, status);
    }

    /// Is told to call a program off, and does.
    fn called_off(&mut self, goal_id: &UUID) {
        let (number, request) = self.0.request::<CancelGoal>(CANCEL);
        assert_eq!(request.goal_info.goal_id, *goal_id);
        let answer = CancelGoalResponse {
            return_code: CancelGoalResponse::ERROR_NONE,
            goals_canceling: vec![request.goal_info],
        };
        self.0.answer::<CancelGoal>(CANCEL, number, &answer);
        let canceled = GoalStatus::STATUS_CANCELED;
        self.end(goal_id, canceled, RunProgramResult::OUTCOME_STOPPED, "");
    }
}

/// A program of several kB, as programs are: it goes out in fragments.
fn program() -> String {
    let lines: String = (1..=400).map(|line| format!("G1 X{line} F600\n")).collect();
    format!("G21 G90\n{lines}M2\n")
}

fn sequencer(plan: Option<&str>, domain: u16) -> (Scenario, Process) {
    let scenario = Scenario::copy_of("short_cell");
    if let Some(plan) = plan {
        scenario.write("plan.yaml", plan);
        scenario.write("part.ngc", &program());
    } else {
        scenario.replace("sequencer.yaml", "plan_file: plan.yaml", "plan_file: ''");
    }
    scenario.append(
        "sequencer.yaml",
        "    retry_delay_s: 0.2\n    attempts: 3\n",
    );
    let file = scenario.argument("sequencer.yaml");
    let node = Process::node(domain, "sequencer", &["--params-file", &file]);
    (scenario, node)
}

/// The switch is asked twice, the controller is proposed three programs, and the third one ends the plan.
const PLAN: &str = "title: on a controller that is not ours
steps:
  - {do: compensation, enable: true}
  - {do: run, program: part.ngc}
  - {do: compensation, enable: false}
  - {do: run, program: part.ngc}
";

/// The switch is asked for by our sequencer, and answered.
fn switched(peer: &mut impl Foreign, enable: bool) {
    let (number, asked) = peer.request::<SetBool>(SWITCH);
    assert_eq!(asked.data, enable);
    let answer = SetBoolResponse {
        success: true,
        message: "by a stranger".to_owned(),
    };
    peer.answer::<SetBool>(SWITCH, number, &answer);
}

fn a_plan_runs(peer: &mut impl Foreign) {
    switched(peer, true);
    let mut controller = Controller(&mut *peer);
    let (number, refused) = controller.proposed();
    controller.answer_goal(number, false);
    // Proposed again, as a goal of its own.
    let (goal_id, goal) = controller.take();
    assert_ne!(goal_id, refused.goal_id);
    assert_eq!(goal.program, program());
    assert_eq!(goal.name, "part.ngc");
    controller.feedback(&goal_id, 2, 0.5);
    let done = (GoalStatus::STATUS_SUCCEEDED, RunProgramResult::OUTCOME_DONE);
    controller.end(&goal_id, done.0, done.1, "");
    switched(peer, false);
    let mut controller = Controller(&mut *peer);
    let (goal_id, _) = controller.take();
    let failed = (GoalStatus::STATUS_ABORTED, RunProgramResult::OUTCOME_FAULT);
    // An answer in fragments.
    let words = format!("line 2: the spindle stands{}", " still".repeat(500));
    controller.end(&goal_id, failed.0, failed.1, &words);
    let status = peer.plan_status(|status| status.state == PlanStatus::STATE_FAILED);
    assert_eq!(status.step, 4, "{status:?}");
    assert!(status.message.contains(&words), "{status:?}");
}

/// A cycle is ordered of our sequencer and called off while its program runs on the controller.
fn a_cycle_is_called_off(peer: &mut impl Foreign) {
    let goal_id = UUID { uuid: [7; 16] };
    let goal = RunCycleGoal {
        cycle: RunCycleGoal::CYCLE_TOUCH,
        features: vec!["block_1.z".to_owned()],
        ..RunCycleGoal::default()
    };
    let ordered = SendGoalRequest {
        goal_id: goal_id.clone(),
        goal,
    };
    peer.ask::<SendGoal<RunCycle>>(SEND_CYCLE, 1, &ordered);
    let taken = peer.reply::<SendGoal<RunCycle>>(SEND_CYCLE, 1);
    assert!(taken.accepted, "{taken:?}");
    let (program, goal) = Controller(&mut *peer).take();
    assert!(goal.program.contains("G38"), "{}", goal.program);
    let mut cancel = CancelGoalRequest::default();
    cancel.goal_info.goal_id = goal_id.clone();
    peer.ask::<CancelGoal>(CANCEL_CYCLE, 2, &cancel);
    let canceling = peer.reply::<CancelGoal>(CANCEL_CYCLE, 2);
    assert_eq!(canceling.return_code, 0, "{canceling:?}");
    Controller(&mut *peer).called_off(&program);
    let asked = GetResultRequest {
        goal_id,
        ..Default::default()
    };
    peer.ask::<GetResult<RunCycle>>(CYCLE_RESULT, 3, &asked);
    let result = peer.reply::<GetResult<RunCycle>>(CYCLE_RESULT, 3);
    assert_eq!(result.status, GoalStatus::STATUS_CANCELED, "{result:?}");
    assert!(!result.result.success, "{result:?}");
}

#[test]
fn a_plan_of_ours_runs_on_a_controller_and_a_switch_on_cyclone() {
    let domain = domain(12);
    let Some(mut peer) = cyclone("a plan on a controller on cyclone", domain) else {
        return;
    };
    let (_scenario, node) = sequencer(Some(PLAN), domain);
    a_plan_runs(&mut peer);
    peer.stop();
    node.stop();
}

#[test]
fn a_plan_of_ours_runs_on_a_controller_and_a_switch_on_fast_dds() {
    let domain = domain(13);
    let Some(mut peer) = fast_dds("a plan on a controller on fast_dds", domain) else {
        return;
    };
    let (_scenario, node) = sequencer(Some(PLAN), domain);
    peer.read(&topics::PLAN_STATUS);
    a_plan_runs(&mut peer);
    node.stop();
}

#[test]
fn a_cycle_of_ours_is_called_off_on_a_controller_on_cyclone() {
    let domain = domain(14);
    let Some(mut peer) = cyclone("a cycle called off on cyclone", domain) else {
        return;
    };
    let (_scenario, node) = sequencer(None, domain);
    for service in [SEND_CYCLE, CANCEL_CYCLE, CYCLE_RESULT] {
        peer.matched_after_s(service);
    }
    a_cycle_is_called_off(&mut peer);
    peer.stop();
    node.stop();
}

#[test]
fn a_cycle_of_ours_is_called_off_on_a_controller_on_fast_dds() {
    let domain = domain(15);
    let Some(mut peer) = fast_dds("a cycle called off on fast_dds", domain) else {
        return;
    };
    let (_scenario, node) = sequencer(None, domain);
    peer.client::<SendGoal<RunCycle>>(SEND_CYCLE);
    peer.client::<CancelGoal>(CANCEL_CYCLE);
    peer.client::<GetResult<RunCycle>>(CYCLE_RESULT);
    a_cycle_is_called_off(&mut peer);
    node.stop();
}

/// What a client of ours is told of its goal.
#[derive(Debug, PartialEq)]
enum News {
    Taken(bool),
    Feedback(RunProgramFeedback),
    Ended(Ended, Option<RunProgramResult>),
}

/// Proposes one program, and hands on its news.
struct Operator {
    has_proposed: bool,
    news: Sender<News>,
}

impl Stage for Operator {
    type Input = Option<News>;
    type Output = ();
    type Error = Infallible;

    fn step(
        &mut self,
        _at: Stamp<Host>,
        input: Option<News>,
        out: &mut Vec<()>,
    ) -> Result<(), Infallible> {
        if let Some(news) = input {
            let _ = self.news.send(news);
        } else if !std::mem::replace(&mut self.has_proposed, true) {
            out.push(());
        }
        Ok(())
    }
}

fn operator(domain: u16) -> (node_runtime::Running, Receiver<News>) {
    let (news, heard) = channel();
    let stage = Operator {
        has_proposed: false,
        news,
    };
    let setup = Setup::new("operator", &Arguments::default()).unwrap();
    let goal = || RunProgramGoal {
        program: program(),
        name: "part".to_owned(),
    };
    let node = Wiring::new(setup.name(), Vec::new(), stage)
        .every(Span::from_nanos(100_000_000), || None)
        .action_client(
            &topics::RUN_PROGRAM,
            move |&()| Some(ClientSignal::Send(1, goal())),
            |news| {
                Some(match news {
                    GoalNews::Answer(_, taken) => News::Taken(taken),
                    GoalNews::Feedback(_, feedback) => News::Feedback(feedback),
                    GoalNews::Ended(_, status, result) => News::Ended(status, result),
                })
            },
        )
        .node();
    let running = launch(&environment(domain), vec![(setup, node)]).unwrap();
    (running, heard)
}

fn feedback_is_heard(peer: &mut impl Foreign, heard: &Receiver<News>) {
    let next = || heard.recv_timeout(Duration::from_secs(10)).unwrap();
    let mut controller = Controller(peer);
    let (goal_id, _) = controller.take();
    assert_eq!(next(), News::Taken(true));
    // Of somebody else's goal: none of ours.
    controller.feedback(&UUID { uuid: [3; 16] }, 9, 0.9);
    for (line, progress) in [(1, 0.25), (2, 0.75)] {
        controller.feedback(&goal_id, line, progress);
        let News::Feedback(feedback) = next() else {
            panic!("no feedback of line {line}")
        };
        assert_eq!((feedback.line, feedback.progress), (line, progress));
    }
    controller.end(&goal_id, GoalStatus::STATUS_SUCCEEDED, 0, "");
    let News::Ended(Ended::Succeeded, Some(result)) = next() else {
        panic!("no result")
    };
    assert_eq!((result.outcome, result.line), (0, 2));
}

#[test]
fn a_client_of_ours_hears_how_far_a_controller_on_cyclone_is() {
    let domain = domain(16);
    let Some(mut peer) = cyclone("feedback of a controller on cyclone", domain) else {
        return;
    };
    let (running, heard) = operator(domain);
    peer.matched_after_s(FEEDBACK);
    feedback_is_heard(&mut peer, &heard);
    running.stop().unwrap();
    peer.stop();
}

#[test]
fn a_client_of_ours_hears_how_far_a_controller_on_fast_dds_is_and_passes_over_half_a_word() {
    let domain = domain(17);
    let Some(mut peer) = fast_dds("feedback of a controller on fast_dds", domain) else {
        return;
    };
    let (running, heard) = operator(domain);
    peer.matched(FEEDBACK);
    // Shorter than the name of a goal.
    peer.write_named(FEEDBACK, &[&ENCAPSULATION[..], &[1, 2, 3]].concat());
    feedback_is_heard(&mut peer, &heard);
    running.stop().unwrap();
}
