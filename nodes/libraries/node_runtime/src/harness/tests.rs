use std::cell::RefCell;
use std::rc::Rc;

use abbe_msgs::action::{RunProgram, RunProgramFeedback, RunProgramGoal, RunProgramResult};
use abbe_msgs::std_srvs::srv::{SetBoolRequest, SetBoolResponse};
use abbe_msgs::{Wire, topics};
use metrology::Stage;
use metrology::sample::{UpdateReason, UpdateRequest};

use super::*;
use crate::{ClientSignal, GoalNews, GoalSignal, Wiring};

const PERIOD: Span = Span::from_nanos(1_000_000);

/// Asks on a timer: publishes a request, switches a service, proposes a program.
struct Asker {
    ticks: u64,
}

#[derive(Debug)]
enum AskerIn {
    Tick,
    Switched(u64, Option<bool>),
    News(String),
    Stop,
}

#[derive(Debug)]
enum Said {
    Request(UpdateRequest),
    Switch(u64),
    Program(u64),
    Heard(String),
    Stopped,
}

#[derive(Debug, thiserror::Error)]
#[error("refused")]
struct Refused;

impl Stage for Asker {
    type Input = AskerIn;
    type Output = Said;
    type Error = Refused;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: AskerIn,
        out: &mut Vec<Said>,
    ) -> Result<(), Refused> {
        match input {
            AskerIn::Tick => {
                self.ticks += 1;
                match self.ticks {
                    1 => out.push(Said::Request(UpdateRequest {
                        at,
                        reason: UpdateReason::Period,
                        elapsed_s: 900.0,
                    })),
                    2 => out.push(Said::Switch(77)),
                    3 => out.push(Said::Program(5)),
                    _ => {}
                }
            }
            AskerIn::Switched(id, answer) => out.push(Said::Heard(format!("{id} {answer:?}"))),
            AskerIn::News(news) => out.push(Said::Heard(news)),
            AskerIn::Stop => out.push(Said::Stopped),
        }
        Ok(())
    }
}

fn news(news: GoalNews<RunProgram>) -> AskerIn {
    AskerIn::News(match news {
        GoalNews::Answer(id, accepted) => format!("answer {id} {accepted}"),
        GoalNews::Feedback(id, feedback) => format!("feedback {id} line {}", feedback.line),
        GoalNews::Ended(id, status, result) => {
            format!(
                "ended {id} {status:?} {:?}",
                result.map(|result| result.message)
            )
        }
    })
}

fn asker() -> Box<dyn Node> {
    Wiring::new("asker", Vec::new(), Asker { ticks: 0 })
        .every(PERIOD, || AskerIn::Tick)
        .publish(&topics::THERMAL_UPDATE_REQUEST, |said| match said {
            Said::Request(request) => Some(request),
            _ => None,
        })
        .client(
            &topics::SET_COMPENSATION,
            |said| match said {
                Said::Switch(id) => Some((*id, SetBoolRequest { data: true })),
                _ => None,
            },
            |id, response| AskerIn::Switched(id, response.map(|r: SetBoolResponse| r.success)),
        )
        .action_client(
            &topics::RUN_PROGRAM,
            |said| match said {
                Said::Program(id) => Some(ClientSignal::Send(
                    *id,
                    RunProgramGoal {
                        program: "M2".to_owned(),
                        name: String::new(),
                    },
                )),
                _ => None,
            },
            news,
        )
        .diagnose(|said| match said {
            Said::Heard(text) => Some(Diagnostic::new(Level::Ok, "heard", text.clone())),
            _ => None,
        })
        .shutdown(|| AskerIn::Stop, |said| matches!(said, Said::Stopped))
        .node()
}

/// Answers: counts requests, obeys the switch, runs the program in one instant.
struct Answerer;

#[derive(Debug)]
enum AnswererIn {
    Request,
    Switch(bool),
    Goal(u64),
    Ignored,
}

#[derive(Debug)]
enum Answer {
    Counted,
    Switched,
    Accepted(u64),
    Line(u64),
    Done(u64),
}

impl Stage for Answerer {
    type Input = AnswererIn;
    type Output = Answer;
    type Error = Refused;

    fn step(
        &mut self,
        _at: Stamp<Host>,
        input: AnswererIn,
        out: &mut Vec<Answer>,
    ) -> Result<(), Refused> {
        match input {
            AnswererIn::Request => out.push(Answer::Counted),
            AnswererIn::Switch(true) => out.push(Answer::Switched),
            AnswererIn::Switch(false) => return Err(Refused),
            AnswererIn::Goal(id) => {
                out.extend([Answer::Accepted(id), Answer::Line(id), Answer::Done(id)]);
            }
            AnswererIn::Ignored => {}
        }
        Ok(())
    }
}

fn goal_signal(answer: &Answer) -> Option<GoalSignal<RunProgram>> {
    match answer {
        Answer::Accepted(id) => Some(GoalSignal::Accept(*id)),
        Answer::Line(id) => {
            let feedback = RunProgramFeedback {
                line: 3,
                ..RunProgramFeedback::default()
            };
            Some(GoalSignal::Feedback(*id, feedback))
        }
        Answer::Done(id) => {
            let result = RunProgramResult {
                message: "fine".to_owned(),
                ..RunProgramResult::default()
            };
            Some(GoalSignal::Finish(*id, GoalStatus::Succeeded, result))
        }
        _ => None,
    }
}

fn answerer() -> Box<dyn Node> {
    Wiring::new("answerer", Vec::new(), Answerer)
        .on(&topics::THERMAL_UPDATE_REQUEST, |_| AnswererIn::Request)
        .service(
            &topics::SET_COMPENSATION,
            |request| AnswererIn::Switch(request.data),
            |outcome| SetBoolResponse {
                success: outcome.is_ok_and(|outputs| !outputs.is_empty()),
                message: String::new(),
            },
        )
        .action_server(
            &topics::RUN_PROGRAM,
            |id, _| AnswererIn::Goal(id),
            |_| AnswererIn::Ignored,
            goal_signal,
        )
        .diagnose(|answer| {
            matches!(answer, Answer::Counted)
                .then(|| Diagnostic::new(Level::Ok, "counted", String::new()))
        })
        .node()
}

fn composed(nodes: Vec<Box<dyn Node>>) -> (Harness, Rc<RefCell<Vec<String>>>) {
    let mut harness = Harness::compose(nodes, Stamp::default()).unwrap();
    let log = Rc::new(RefCell::new(Vec::new()));
    let sink = Rc::clone(&log);
    harness.observe_conditions(Box::new(move |_, node, diagnostic| {
        sink.borrow_mut()
            .push(format!("{node} {} {}", diagnostic.name, diagnostic.message));
    }));
    (harness, log)
}

#[test]
fn messages_services_and_actions_arrive_in_one_order() {
    let (mut harness, log) = composed(vec![asker(), answerer()]);
    harness.run_until(Stamp::from_nanos(10_000_000));
    assert_eq!(
        *log.borrow(),
        [
            "answerer counted ",
            "asker heard 77 Some(true)",
            "asker heard answer 5 true",
            "asker heard feedback 5 line 3",
            "asker heard ended 5 Succeeded Some(\"fine\")",
        ]
    );
    assert_eq!(harness.now(), Stamp::from_nanos(10_000_000));
    assert!(harness.shutdown(PERIOD));
}

#[test]
fn calls_that_nobody_serves_are_answered_as_such() {
    let (mut harness, log) = composed(vec![asker()]);
    harness.run_until(Stamp::from_nanos(3_000_000));
    assert_eq!(
        *log.borrow(),
        [
            "asker heard 77 None",
            "asker no_action_server action \"cnc/run_program\": no node offers it",
            "asker heard answer 5 false",
        ]
    );
}

#[test]
fn a_second_node_of_the_same_name_is_refused_by_name() {
    let error = Harness::compose(vec![answerer(), answerer()], Stamp::default())
        .err()
        .unwrap();
    assert_eq!(
        error.to_string(),
        "node \"answerer\" is there twice: names must be unique"
    );
}

#[test]
fn a_message_that_breaks_the_contract_is_a_fault_and_the_node_goes_on() {
    let (mut harness, log) = composed(vec![answerer()]);
    assert!(harness.inject("thermal/update_request", &[0, 1, 0, 0, 1]));
    assert!(
        log.borrow()[0].starts_with("answerer input_refused answerer: thermal/update_request:")
    );
    let request = UpdateRequest {
        at: Stamp::default(),
        reason: UpdateReason::Period,
        elapsed_s: f64::NAN,
    };
    let nan = abbe_msgs::to_cdr(&abbe_msgs::msg::ThermalUpdateRequest::from_inner(&request));
    harness.inject("thermal/update_request", &nan);
    assert!(log.borrow()[1].contains("elapsed_s"), "{log:?}");
    assert!(!harness.inject("no/such_topic", &nan));
}

#[test]
fn equal_nodes_publish_equal_bytes() {
    let run = || {
        let (mut harness, _) = composed(vec![asker(), answerer()]);
        let bytes = Rc::new(RefCell::new(Vec::new()));
        let sink = Rc::clone(&bytes);
        harness.observe(Box::new(move |published: Published<'_>| {
            sink.borrow_mut()
                .push((published.at, published.topic, published.bytes.to_vec()));
        }));
        harness.run_until(Stamp::from_nanos(10_000_000));
        bytes.take()
    };
    let first = run();
    // One request, the event of one call, and five conditions on /diagnostics.
    assert_eq!(first.len(), 7);
    assert_eq!(first, run());
}

#[test]
fn a_restarted_node_takes_its_place_and_one_with_other_ports_does_not() {
    let (mut harness, log) = composed(vec![answerer()]);
    harness.restart(answerer()).unwrap();
    assert!(harness.restart(asker()).is_err());
    let request = UpdateRequest {
        at: Stamp::default(),
        reason: UpdateReason::Period,
        elapsed_s: 1.0,
    };
    let bytes = abbe_msgs::to_cdr(&abbe_msgs::msg::ThermalUpdateRequest::from_inner(&request));
    harness.inject("thermal/update_request", &bytes);
    assert_eq!(*log.borrow(), ["answerer counted "]);
}

/// Asks with elapsed times that are good, no number, infinite, and good again.
struct Spoiler(usize);

impl Stage for Spoiler {
    type Input = ();
    type Output = UpdateRequest;
    type Error = Refused;

    fn step(
        &mut self,
        at: Stamp<Host>,
        (): (),
        out: &mut Vec<UpdateRequest>,
    ) -> Result<(), Refused> {
        let elapsed_s = [1.0, f64::NAN, f64::INFINITY, 2.0, 3.0][self.0];
        self.0 += 1;
        out.push(UpdateRequest {
            at,
            reason: UpdateReason::Period,
            elapsed_s,
        });
        Ok(())
    }
}

#[test]
fn what_no_reader_could_take_is_not_published_and_told_of_by_the_node_that_made_it() {
    let spoiler = Wiring::new("spoiler", Vec::new(), Spoiler(0))
        .every(PERIOD, || ())
        .publish(&topics::THERMAL_UPDATE_REQUEST, |request| Some(request))
        .node();
    let (mut harness, log) = composed(vec![spoiler, answerer()]);
    harness.run_until(Stamp::from_nanos(5_500_000));
    let log = log.borrow();
    let told = |place: usize, words: &[&str]| {
        assert!(
            words.iter().all(|word| log[place].contains(word)),
            "{log:?}"
        );
    };
    assert_eq!(log.len(), 6, "{log:?}");
    told(0, &["answerer counted"]);
    let refused = "spoiler output_refused/thermal/update_request";
    told(1, &[refused, "elapsed_s", "NaN", "not published"]);
    told(2, &[refused, "elapsed_s", "inf", "not published"]);
    told(3, &[refused, "published again"]);
    told(4, &["answerer counted"]);
    told(5, &["answerer counted"]);
}
