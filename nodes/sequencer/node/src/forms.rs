//! Between the sequencer's inputs and outputs and their messages.

use abbe_msgs::Wire;
use abbe_msgs::action::{
    RunCycle, RunCycleFeedback, RunCycleGoal, RunCycleResult, RunProgram, RunProgramGoal,
    RunProgramResult,
};
use abbe_msgs::std_srvs::srv::{SetBoolRequest, SetBoolResponse};
use machine::orientation::RotaryPosition;
use metrology::sample::{PlanState, PlanStatus, TestSegment};
use node_runtime::{ClientSignal, Diagnostic, GoalNews, GoalSignal, GoalStatus, Level};
use sequencer::touch_along::PointedTouch;
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
    let answer = response.map(|response| (response.success, shown(response.message)));
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

/// Bytes of a sentence of another node that are shown: it stands in every status from then on.
const MOST_SHOWN_BYTES: usize = 64 * 1024;

fn shown(message: String) -> String {
    match message.len() {
        ..=MOST_SHOWN_BYTES => message,
        n => format!("a message of {n} bytes, which is not shown: at most {MOST_SHOWN_BYTES}"),
    }
}

fn end(status: GoalStatus, result: RunProgramResult) -> ProgramEnd {
    let message = match status {
        GoalStatus::Canceled => CANCELED.to_owned(),
        _ => shown(result.message),
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
        Output::Pointed { run, touch } => Some(pointed(*run, touch)),
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

/// How a direction of the probe's axis is taken, with both solutions; angles in degrees.
fn pointed(run: u32, touch: &PointedTouch) -> Diagnostic {
    let [x, y, z] = touch.probe_axis;
    let angles = |at: RotaryPosition| (at.a_rad.to_degrees(), at.c_rad.to_degrees());
    let [(a, c), (other_a, other_c)] = touch.pointing.solutions.map(|s| angles(s.position));
    let is_inside = touch.pointing.solutions[1].is_inside_travel;
    let other = match (touch.pointing.singular, is_inside) {
        (true, _) => "C is free along this direction and stays".to_owned(),
        (false, true) => {
            format!("the other solution, A {other_a:.4} deg, C {other_c:.4} deg, is farther")
        }
        (false, false) => format!(
            "the other solution, A {other_a:.4} deg, C {other_c:.4} deg, is outside the travel"
        ),
    };
    let message = format!(
        "run {run}, {}: probe axis ({x:.6}, {y:.6}, {z:.6}) is A {a:.4} deg, C {c:.4} deg; {other}",
        touch.feature_id
    );
    Diagnostic::new(Level::Ok, "probe_axis", message)
        .with("run", run)
        .with("feature", &touch.feature_id)
        .with("axis_x", x)
        .with("axis_y", y)
        .with("axis_z", z)
        .with("a_deg", a)
        .with("c_deg", c)
        .with("other_a_deg", other_a)
        .with("other_c_deg", other_c)
        .with("other_is_inside_travel", is_inside)
        .with("singular", touch.pointing.singular)
}
