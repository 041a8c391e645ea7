//! Between the sequencer's inputs and outputs and their messages.

use abbe_msgs::Wire;
use abbe_msgs::action::{
    RunCycle, RunCycleFeedback, RunCycleGoal, RunCycleResult, RunProgram, RunProgramGoal,
    RunProgramResult,
};
use abbe_msgs::std_srvs::srv::{SetBoolRequest, SetBoolResponse};
use metrology::sample::{PlanState, PlanStatus, TestSegment};
use node_runtime::{ClientSignal, Diagnostic, GoalNews, GoalSignal, GoalStatus, Level};
use sequencer::{CANCELED, CycleGoal, CycleOutcome, Input, Output, ProgramEnd};

pub(crate) fn segment(output: &Output) -> Option<&TestSegment> {
    match output {
        Output::Segment(segment) => Some(segment),
        _ => None,
    }
}

pub(crate) fn status(output: &Output) -> Option<&PlanStatus> {
    match output {
        Output::Status(status) => Some(status),
        _ => None,
    }
}

pub(crate) fn switch(output: &Output) -> Option<(u64, SetBoolRequest)> {
    match *output {
        Output::SwitchCompensation { id, enable } => Some((id, SetBoolRequest { data: enable })),
        _ => None,
    }
}

pub(crate) fn switched(id: u64, response: Option<SetBoolResponse>) -> Input {
    let answer = response.map(|response| (response.success, response.message));
    Input::CompensationAnswer { id, answer }
}

pub(crate) fn program(output: &Output) -> Option<ClientSignal<RunProgram>> {
    match output {
        Output::SendProgram { id, name, text } => Some(ClientSignal::Send(
            *id,
            RunProgramGoal {
                program: text.clone(),
                name: name.clone(),
            },
        )),
        Output::CancelProgram(id) => Some(ClientSignal::Cancel(*id)),
        _ => None,
    }
}

pub(crate) fn program_news(news: GoalNews<RunProgram>) -> Input {
    match news {
        GoalNews::Answer(id, accepted) => Input::ProgramAnswer { id, accepted },
        GoalNews::Feedback(id, feedback) => Input::ProgramProgress {
            id,
            progress: feedback.progress,
        },
        GoalNews::Ended(id, status, result) => {
            let end = result.map(|result| end(status, result));
            Input::ProgramEnd { id, end }
        }
    }
}

fn end(status: GoalStatus, result: RunProgramResult) -> ProgramEnd {
    let message = match status {
        GoalStatus::Canceled => CANCELED.to_owned(),
        _ => result.message,
    };
    ProgramEnd {
        done: result.outcome == RunProgramResult::OUTCOME_DONE,
        message,
    }
}

pub(crate) fn cycle(id: u64, goal: RunCycleGoal) -> Input {
    match goal.into_inner() {
        Ok(order) => Input::Cycle(CycleGoal { id, order }),
        Err(error) => Input::BadCycle {
            id,
            reason: error.to_string(),
        },
    }
}

pub(crate) fn cycle_signal(output: &Output) -> Option<GoalSignal<RunCycle>> {
    match output {
        Output::CycleAccepted(id) => Some(GoalSignal::Accept(*id)),
        Output::CycleRejected { id, .. } => Some(GoalSignal::Reject(*id)),
        Output::CycleProgress {
            id,
            touches,
            planned,
        } => Some(GoalSignal::Feedback(
            *id,
            RunCycleFeedback {
                touches: *touches,
                planned: *planned,
            },
        )),
        Output::CycleEnded(outcome) => Some(finish(outcome)),
        _ => None,
    }
}

fn finish(outcome: &CycleOutcome) -> GoalSignal<RunCycle> {
    let status = match (outcome.success, outcome.canceled) {
        (true, _) => GoalStatus::Succeeded,
        (false, true) => GoalStatus::Canceled,
        (false, false) => GoalStatus::Aborted,
    };
    let result = RunCycleResult {
        success: outcome.success,
        message: outcome.message.clone(),
        run: outcome.run,
    };
    GoalSignal::Finish(outcome.id, status, result)
}

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    match output {
        Output::ProgramFailed { name, run, message } => Some(
            Diagnostic::new(Level::Warn, "program_failed", format!("{name}: {message}"))
                .with("run", run),
        ),
        Output::ToldBefore { sequence } => {
            let message =
                format!("touch {sequence} was told before, or a later one before it; not counted");
            Some(Diagnostic::new(Level::Warn, "told_before", message))
        }
        Output::CycleRejected { reason, .. } => Some(Diagnostic::new(
            Level::Warn,
            "cycle_rejected",
            reason.clone(),
        )),
        Output::Status(status) if status.state == PlanState::Failed => Some(Diagnostic::new(
            Level::Error,
            "plan_failed",
            status.message.clone(),
        )),
        _ => None,
    }
}
