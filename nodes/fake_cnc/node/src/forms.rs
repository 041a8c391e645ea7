//! Between the machine's inputs and outputs and their messages.

use std::cell::Cell;

use abbe_msgs::action::{RunProgram, RunProgramFeedback, RunProgramGoal, RunProgramResult};
use abbe_msgs::sensor_msgs::msg::JointState;
use abbe_msgs::std_srvs::srv::TriggerResponse;
use abbe_msgs::{joint_state, topics};
use fake_cnc::{Input, Outcome, Output, ProgramState};
use metrology::sample::{AxisState, GridSample, LengthSample, ProbeTrigger, TemperatureSample};
use metrology::stamp::Span;
use metrology::{Host, Stamp};
use node_runtime::{Diagnostic, GoalSignal, GoalStatus, Level, Wiring};

use crate::witness::Witnessed;

/// Everybody's tools get positions at 50 Hz.
const JOINT_PERIOD: Span = Span::from_nanos(20_000_000);

pub(crate) fn state(output: &Output) -> Option<&AxisState> {
    match output {
        Output::State(state) => Some(state),
        _ => None,
    }
}

/// Joint states at most every [`JOINT_PERIOD`].
pub(crate) fn joints() -> impl Fn(&Output) -> Option<JointState> + Send + 'static {
    let last: Cell<Option<Stamp<Host>>> = Cell::new(None);
    move |output| {
        let state = state(output)?;
        let since = last.get().map(|last| state.received_at - last);
        // Before the last one: the clock was set back.
        if since.is_some_and(|since| since.nanos() >= 0 && since < JOINT_PERIOD) {
            return None;
        }
        last.set(Some(state.received_at));
        Some(joint_state(state))
    }
}

pub(crate) fn trigger(output: &Output) -> Option<&ProbeTrigger> {
    match output {
        Output::Trigger(trigger) => Some(trigger),
        _ => None,
    }
}

pub(crate) fn grid(output: &Output) -> Option<&GridSample> {
    match output {
        Output::Grid(sample) => Some(sample),
        _ => None,
    }
}

pub(crate) fn length(output: &Output) -> Option<&LengthSample> {
    match output {
        Output::Length(sample) => Some(sample),
        _ => None,
    }
}

pub(crate) fn temperature<'a>(output: &'a Output, sensor: &str) -> Option<&'a TemperatureSample> {
    match output {
        Output::Temperature(sample) if sample.sensor == sensor => Some(sample),
        _ => None,
    }
}

pub(crate) fn run(goal: u64, request: RunProgramGoal) -> Input {
    Input::RunProgram {
        goal,
        text: request.program,
        name: request.name,
    }
}

pub(crate) fn cancel(goal: u64) -> Input {
    Input::CancelProgram { goal }
}

/// A refused program is taken and aborted at once, so that the reason reaches its client.
pub(crate) fn signals(output: &Output) -> Vec<GoalSignal<RunProgram>> {
    match output {
        Output::Accepted { goal } => vec![GoalSignal::Accept(*goal)],
        Output::Refused { goal, message } => {
            let result = RunProgramResult {
                outcome: RunProgramResult::OUTCOME_REFUSED,
                message: message.clone(),
                line: 0,
            };
            vec![
                GoalSignal::Accept(*goal),
                GoalSignal::Finish(*goal, GoalStatus::Aborted, result),
            ]
        }
        Output::Feedback {
            goal,
            line,
            state,
            progress,
        } => {
            let feedback = RunProgramFeedback {
                line: *line,
                state: state_code(*state),
                progress: *progress,
            };
            vec![GoalSignal::Feedback(*goal, feedback)]
        }
        Output::Finished {
            goal,
            outcome,
            message,
            line,
        } => {
            let status = match outcome {
                Outcome::Done => GoalStatus::Succeeded,
                Outcome::Stopped => GoalStatus::Canceled,
                _ => GoalStatus::Aborted,
            };
            let result = RunProgramResult {
                outcome: outcome_code(*outcome),
                message: message.clone(),
                line: *line,
            };
            vec![GoalSignal::Finish(*goal, status, result)]
        }
        _ => Vec::new(),
    }
}

fn state_code(state: ProgramState) -> u8 {
    match state {
        ProgramState::Idle => RunProgramFeedback::STATE_IDLE,
        ProgramState::Running => RunProgramFeedback::STATE_RUNNING,
        ProgramState::Probing => RunProgramFeedback::STATE_PROBING,
        ProgramState::Holding => RunProgramFeedback::STATE_HOLDING,
        ProgramState::Fault => RunProgramFeedback::STATE_FAULT,
    }
}

fn outcome_code(outcome: Outcome) -> u8 {
    match outcome {
        Outcome::Done => RunProgramResult::OUTCOME_DONE,
        Outcome::Refused => RunProgramResult::OUTCOME_REFUSED,
        Outcome::ProbeMissed => RunProgramResult::OUTCOME_PROBE_MISSED,
        Outcome::ProbeStuck => RunProgramResult::OUTCOME_PROBE_STUCK,
        Outcome::Limit => RunProgramResult::OUTCOME_LIMIT,
        Outcome::Stopped => RunProgramResult::OUTCOME_STOPPED,
        Outcome::Fault => RunProgramResult::OUTCOME_FAULT,
    }
}

/// What a person at the control has: its services and its conditions.
pub(crate) fn at_the_control(wiring: Wiring<Witnessed>) -> Wiring<Witnessed> {
    wiring
        .service(&topics::PAUSE_PROGRAM, |_| Input::Pause, answer)
        .service(&topics::RESUME_PROGRAM, |_| Input::Resume, answer)
        .service(&topics::STEP_PROGRAM, |_| Input::StepBlock, answer)
        .service(&topics::HOME, |_| Input::Home, answer)
        .diagnose(condition)
}

/// The answer to a request of the control.
fn answer(outcome: Result<&[Output], &str>) -> TriggerResponse {
    let message = match outcome {
        Ok(outputs) => outputs.iter().find_map(|output| match output {
            Output::Answer(answer) => Some(answer.err()),
            _ => None,
        }),
        Err(fault) => Some(Some(fault)),
    };
    let message = message.unwrap_or(Some("the control gave no answer"));
    TriggerResponse {
        success: message.is_none(),
        message: message.unwrap_or_default().to_owned(),
    }
}

fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let level = Level::from(condition.severity());
    let told = Diagnostic::new(level, condition.name(), condition.to_string());
    Some(match condition {
        fake_cnc::Diagnostic::CompensationRefused { fault, times } => {
            told.with("reason", fault.reason()).with("refused", times)
        }
        _ => told,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_answered_with_done_or_with_the_reason() {
        let done = answer(Ok(&[Output::AtRest, Output::Answer(Ok(()))]));
        assert!(done.success && done.message.is_empty());
        let refused = answer(Ok(&[Output::Answer(Err("no program is running"))]));
        assert_eq!(
            (refused.success, refused.message.as_str()),
            (false, "no program is running")
        );
        let lost = answer(Err("the node is not configured"));
        assert_eq!(
            (lost.success, lost.message.as_str()),
            (false, "the node is not configured")
        );
        assert!(!answer(Ok(&[])).success);
    }
}
