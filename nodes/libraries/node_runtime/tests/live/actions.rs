use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

use abbe_msgs::action::{RunProgram, RunProgramFeedback, RunProgramGoal, RunProgramResult};
use abbe_msgs::std_srvs::srv::{SetBool, SetBoolRequest, SetBoolResponse};
use abbe_msgs::{Action, GetResultResponse, Message, from_cdr, to_cdr};
use metrology::stamp::Span;
use node_runtime::node::{ActionPort, Ports};
use node_runtime::{Bytes, Emission, Event, GoalStatus};

use super::puppet::{Puppet, environment, on_dds, service, start, wait};

fn bytes<M: Message>(message: &M) -> Bytes {
    Arc::from(to_cdr(message))
}

/// What a client of these tests hears.
#[derive(Debug)]
enum Heard {
    Response(u64, Option<SetBoolResponse>),
    Answer(u64, bool),
    Feedback(u64, u32),
    Ended(u64, GoalStatus, Option<bool>),
}

/// Sends what `first` says once, and reports what comes back.
fn client(ports: Ports, first: Vec<Emission>, heard: Sender<Heard>, cancel_at: u32) -> Puppet {
    let ports = Ports {
        timers: vec![Span::from_nanos(10_000_000)],
        ..ports
    };
    let mut first = Some(first);
    Puppet::new("client", ports, move |_, event, out| {
        let news = match event {
            Event::Timer { .. } => {
                out.extend(first.take().into_iter().flatten());
                return Ok(());
            }
            Event::Response { id, bytes, .. } => {
                Heard::Response(id, bytes.map(|bytes| from_cdr(bytes).unwrap()))
            }
            Event::GoalAnswer { id, accepted, .. } => Heard::Answer(id, accepted),
            Event::GoalFeedback { client, id, bytes } => {
                let feedback: RunProgramFeedback = from_cdr(bytes).unwrap();
                if feedback.line == cancel_at {
                    out.push(Emission::CancelGoal { client, id });
                }
                Heard::Feedback(id, feedback.line)
            }
            Event::GoalResult {
                id, status, bytes, ..
            } => {
                let result = bytes.map(|bytes| {
                    let response: GetResultResponse<RunProgram> = from_cdr(bytes).unwrap();
                    response.result.outcome == RunProgramResult::OUTCOME_DONE
                });
                Heard::Ended(id, status, result)
            }
            _ => return Ok(()),
        };
        let _ = heard.send(news);
        Ok(())
    })
}

#[test]
fn a_service_is_answered_and_an_absent_one_is_said_to_be() {
    let environment = environment(4);
    let ports = Ports {
        services: vec![service::<SetBool>("enable")],
        ..Ports::default()
    };
    let server = Puppet::new("server", ports, |_, event, out| {
        if let Event::Request {
            service,
            id,
            bytes: request,
        } = event
        {
            let request: SetBoolRequest = from_cdr(request).unwrap();
            let response = SetBoolResponse {
                success: !request.data,
                message: "was".into(),
            };
            out.push(Emission::Respond {
                service,
                id,
                bytes: bytes(&response),
            });
        }
        Ok(())
    });
    let serving = start(&environment, server);
    let ports = Ports {
        clients: vec![service::<SetBool>("enable"), service::<SetBool>("nobody")],
        ..Ports::default()
    };
    let call = |client, id, data| {
        let bytes = bytes(&SetBoolRequest { data });
        Emission::Call { client, id, bytes }
    };
    let (sender, heard) = channel();
    let first = vec![call(0, 7, true), call(0, 8, false), call(1, 9, true)];
    let started = Instant::now();
    let asking = start(&environment, client(ports, first, sender, 0));
    let mut answers = Vec::new();
    while answers.len() < 2 {
        answers.push(wait(&heard, "a response", |heard| match heard {
            Heard::Response(id, Some(response)) => Some((id, response.success)),
            _ => None,
        }));
    }
    eprintln!(
        "two service calls, discovery included: {:?}",
        started.elapsed()
    );
    answers.sort_unstable();
    assert_eq!(answers, [(7, false), (8, true)]);
    let silent = wait(&heard, "the timeout", |heard| match heard {
        Heard::Response(id, None) => Some(id),
        _ => None,
    });
    assert_eq!(silent, 9);
    asking.stop().unwrap();
    serving.stop().unwrap();
}

/// Does not end by itself.
const ENDLESS: &str = "G4 P3600";

/// Counts lines at every tick for every goal; ends at line 5, or when called off.
fn counter() -> Puppet {
    let ports = Ports {
        action_servers: vec![ActionPort {
            action: "cnc/run_program".to_owned(),
            type_name: RunProgram::TYPE_NAME,
        }],
        timers: vec![Span::from_nanos(20_000_000)],
        ..Ports::default()
    };
    let mut goals: Vec<(u64, u32)> = Vec::new();
    let finish = |id, status, outcome| {
        let result = RunProgramResult {
            outcome,
            ..RunProgramResult::default()
        };
        let response = GetResultResponse::<RunProgram> {
            status: status as i8,
            result,
        };
        Emission::FinishGoal {
            server: 0,
            id,
            status,
            bytes: bytes(&response),
        }
    };
    Puppet::new("cnc", ports, move |_, event, out| {
        match event {
            Event::Goal { server, id, bytes } => {
                let goal: RunProgramGoal = from_cdr(bytes).unwrap();
                if goal.program.is_empty() {
                    out.push(Emission::RejectGoal { server, id });
                } else {
                    out.push(Emission::AcceptGoal { server, id });
                    let line = if goal.program == ENDLESS { 100 } else { 0 };
                    goals.push((id, line));
                }
            }
            Event::Cancel { id, .. } => {
                goals.retain(|(goal, _)| *goal != id);
                out.push(finish(
                    id,
                    GoalStatus::Canceled,
                    RunProgramResult::OUTCOME_REFUSED,
                ));
            }
            Event::Timer { .. } => {
                for (id, line) in &mut goals {
                    *line += 1;
                    let feedback = RunProgramFeedback {
                        line: *line,
                        ..Default::default()
                    };
                    out.push(Emission::Feedback {
                        server: 0,
                        id: *id,
                        bytes: bytes(&feedback),
                    });
                    if *line == 5 {
                        out.push(finish(
                            *id,
                            GoalStatus::Succeeded,
                            RunProgramResult::OUTCOME_DONE,
                        ));
                    }
                }
                goals.retain(|(_, line)| *line != 5);
            }
            _ => {}
        }
        Ok(())
    })
}

#[test]
fn goals_run_side_by_side_are_refused_and_called_off() {
    let environment = environment(5);
    let serving = start(&environment, counter());
    let ports = Ports {
        action_clients: vec![ActionPort {
            action: "cnc/run_program".to_owned(),
            type_name: RunProgram::TYPE_NAME,
        }],
        ..Ports::default()
    };
    let goal = |id, program: &str| {
        let goal = RunProgramGoal {
            program: program.to_owned(),
            ..Default::default()
        };
        Emission::SendGoal {
            client: 0,
            id,
            bytes: bytes(&goal),
        }
    };
    let (sender, heard) = channel();
    let first = vec![goal(1, "G0 X1"), goal(2, ""), goal(3, "G0 X3")];
    let asking = start(&environment, client(ports.clone(), first, sender, 0));
    let (mut answers, mut feedback, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    while ends.len() < 2 {
        wait(&heard, "the end of a goal", |heard| {
            match heard {
                Heard::Answer(id, accepted) => answers.push((id, accepted)),
                Heard::Feedback(id, line) => feedback.push((id, line)),
                Heard::Ended(id, status, result) => ends.push((id, status, result)),
                Heard::Response(..) => panic!("no service was called"),
            }
            Some(())
        });
    }
    answers.sort_unstable();
    assert_eq!(answers, [(1, true), (2, false), (3, true)]);
    assert!(
        feedback.iter().any(|(id, line)| *id == 1 && *line >= 2),
        "{feedback:?}"
    );
    ends.sort_by_key(|end| end.0);
    let succeeded = |id| (id, GoalStatus::Succeeded, Some(true));
    assert_eq!(ends, [succeeded(1), succeeded(3)]);
    asking.stop().unwrap();

    let (sender, heard) = channel();
    let asking = start(
        &environment,
        client(ports, vec![goal(4, "G0 X4")], sender, 2),
    );
    let end = wait(
        &heard,
        "the end of the cancelled goal",
        |heard| match heard {
            Heard::Ended(id, status, result) => Some((id, status, result)),
            _ => None,
        },
    );
    assert_eq!(end, (4, GoalStatus::Canceled, Some(false)));
    let lines = std::iter::from_fn(|| heard.recv_timeout(Duration::from_millis(200)).ok()).count();
    assert_eq!(lines, 0, "nothing comes after the end");
    asking.stop().unwrap();
    serving.stop().unwrap();
}

/// `RunProgram` as ros2-client would have it.
mod foreign {
    use serde::{Deserialize, Serialize};

    #[derive(Clone, Debug, Serialize, Deserialize)]
    pub struct Goal {
        pub program: String,
        pub name: String,
    }

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Result {
        pub outcome: u8,
        pub message: String,
        pub line: u32,
    }

    #[derive(Clone, Debug, Serialize, Deserialize)]
    pub struct Feedback {
        pub line: u32,
        pub state: u8,
        pub progress: f64,
    }

    impl ros2_client::Message for Goal {}
    impl ros2_client::Message for Result {}
    impl ros2_client::Message for Feedback {}
}

/// Asks until somebody answers: ros2-client sends also when it has met nobody yet, and what it sends then is lost.
async fn answered<T, F: Future<Output = T>>(ask: impl Fn() -> F) -> T {
    for _ in 0..10 {
        if let Ok(answer) = tokio::time::timeout(Duration::from_secs(3), ask()).await {
            return answer;
        }
    }
    panic!("no answer to ten requests");
}

#[test]
fn an_action_serves_ros2_clients_client_in_the_mapping_of_fast_dds() {
    let environment = on_dds(18);
    let serving = start(&environment, counter());
    let mut asker = super::parameters::Asker::new(environment.domain_id);
    let qos = ros2_client::QosProfile::publisher_default();
    let client = asker
        .node
        .create_action_client::<foreign::Goal, foreign::Result, foreign::Feedback>(
            ros2_client::ServiceMapping::Enhanced,
            &ros2_client::Name::new("/cnc", "run_program").unwrap(),
            &ros2_client::ActionTypeName::new("abbe_msgs", "RunProgram"),
            ros2_client::action::ActionClientQosPolicies {
                goal_service: qos.clone(),
                result_service: qos.clone(),
                cancel_service: qos.clone(),
                feedback_subscription: qos.clone(),
                status_subscription: qos,
            },
        )
        .unwrap();
    let goal = |program: &str| foreign::Goal {
        program: program.to_owned(),
        name: "foreign".to_owned(),
    };
    let story = async {
        let (id, answer) = answered(|| client.async_send_goal(goal("G0 X1")))
            .await
            .unwrap();
        assert!(answer.accepted);
        let (status, result) = answered(|| client.async_request_result(id)).await.unwrap();
        let outcome = RunProgramResult::OUTCOME_DONE;
        assert_eq!((status as u8, result.outcome), (4, outcome), "succeeded");
        let (_, answer) = client.async_send_goal(goal("")).await.unwrap();
        assert!(!answer.accepted);
        let (id, answer) = client.async_send_goal(goal(ENDLESS)).await.unwrap();
        assert!(answer.accepted);
        let any_time = ros2_client::builtin_interfaces::Time::ZERO;
        let canceling = answered(|| client.async_cancel_goal(id, any_time)).await;
        let canceling = canceling.unwrap();
        assert_eq!(canceling.goals_canceling.len(), 1);
        let (status, _) = client.async_request_result(id).await.unwrap();
        assert_eq!(status as u8, 5, "canceled");
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime
        .block_on(async { tokio::time::timeout(Duration::from_secs(60), story).await })
        .expect("the story's end within 60 s");
    drop((client, asker));
    serving.stop().unwrap();
}
