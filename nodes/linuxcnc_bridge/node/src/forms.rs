//! Between the bridge's inputs and outputs and their messages.

use std::path::{Path, PathBuf};

use abbe_msgs::action::{RunProgram, RunProgramFeedback, RunProgramGoal, RunProgramResult};
use abbe_msgs::joint_state;
use abbe_msgs::sensor_msgs::msg::JointState;
use anyhow::{Result, bail};
use linuxcnc_bridge::Output;
use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::live::LiveInput;
use linuxcnc_bridge::run::{Ending, Outcome};
use metrology::sample::{AxisState, ProbeTrigger};
use node_runtime::{Diagnostic, GoalSignal, GoalStatus, Level, Setup};

/// Refuses a control that goes by `/clock`: where that rests or runs fast, no silence would be true.
pub(crate) fn refuse_simulated_time(setup: &Setup) -> Result<()> {
    if setup.use_sim_time() {
        let reason = "use_sim_time = true: must be false, since a control goes by real time";
        bail!("{}", setup.placed(reason));
    }
    Ok(())
}

/// The folder to which `relative` is relative when it leads to `path`.
pub(crate) fn folder_of(path: &Path, relative: &str) -> PathBuf {
    let levels = Path::new(relative).components().count();
    path.ancestors()
        .nth(levels)
        .map_or_else(PathBuf::new, Path::to_owned)
}

pub(crate) fn state(output: &Output) -> Option<&AxisState> {
    match output {
        Output::State(state) => Some(state),
        _ => None,
    }
}

pub(crate) fn joints(output: &Output) -> Option<JointState> {
    match output {
        Output::Joints(state) => Some(joint_state(state)),
        _ => None,
    }
}

pub(crate) fn trigger(output: &Output) -> Option<&ProbeTrigger> {
    match output {
        Output::Trigger(trigger) => Some(trigger),
        _ => None,
    }
}

pub(crate) fn run(goal: u64, request: RunProgramGoal) -> LiveInput {
    LiveInput::Goal {
        goal,
        program: request.program,
    }
}

pub(crate) fn cancel(goal: u64) -> LiveInput {
    LiveInput::Cancel { goal }
}

/// A refused program is taken and aborted at once, so that the reason reaches its client.
pub(crate) fn signals(output: &Output) -> Vec<GoalSignal<RunProgram>> {
    match output {
        Output::Accepted { goal } => vec![GoalSignal::Accept(*goal)],
        Output::Refused { goal, refusal } => {
            vec![GoalSignal::Accept(*goal), finish(*goal, &refusal.ending())]
        }
        Output::Feedback {
            goal,
            line,
            state,
            progress,
        } => {
            let feedback = RunProgramFeedback {
                line: *line,
                state: *state as u8,
                progress: *progress,
            };
            vec![GoalSignal::Feedback(*goal, feedback)]
        }
        Output::Finished { goal, ending } => vec![finish(*goal, ending)],
        _ => Vec::new(),
    }
}

fn finish(goal: u64, ending: &Ending) -> GoalSignal<RunProgram> {
    let status = match ending.outcome {
        Outcome::Done => GoalStatus::Succeeded,
        Outcome::Stopped => GoalStatus::Canceled,
        _ => GoalStatus::Aborted,
    };
    let result = RunProgramResult {
        outcome: ending.outcome as u8,
        message: ending.message.clone(),
        line: ending.line,
    };
    GoalSignal::Finish(goal, status, result)
}

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Condition(condition) = output else {
        return None;
    };
    let level = Level::from(condition.severity());
    let told = Diagnostic::new(level, condition.name(), condition.to_string());
    Some(match condition {
        Condition::CompensationRefused { fault, times } => {
            told.with("reason", fault.reason()).with("refused", times)
        }
        _ => told,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use linuxcnc_bridge::run::{Refusal, RunState};

    #[test]
    fn the_folder_of_a_relative_path_is_what_stands_before_it() {
        let path = Path::new("scenarios/latency/controller/latency.ini");
        let folder = folder_of(path, "controller/latency.ini");
        assert_eq!(folder, Path::new("scenarios/latency"));
        assert_eq!(folder.join("controller/latency.ini"), path);
    }

    #[test]
    fn a_refused_program_is_taken_and_ended_with_the_reason() {
        let refused = Output::Refused {
            goal: 7,
            refusal: Refusal::DrivesOff,
        };
        let signals = signals(&refused);
        assert!(matches!(signals[0], GoalSignal::Accept(7)));
        let GoalSignal::Finish(7, GoalStatus::Aborted, result) = &signals[1] else {
            panic!("no end");
        };
        assert_eq!(result.outcome, RunProgramResult::OUTCOME_REFUSED);
        assert_eq!(result.message, "drives are off");
    }

    #[test]
    fn numbers_of_outcomes_and_states_are_those_of_the_action() {
        for (outcome, number) in [
            (Outcome::Done, RunProgramResult::OUTCOME_DONE),
            (Outcome::Refused, RunProgramResult::OUTCOME_REFUSED),
            (Outcome::ProbeMissed, RunProgramResult::OUTCOME_PROBE_MISSED),
            (Outcome::ProbeStuck, RunProgramResult::OUTCOME_PROBE_STUCK),
            (Outcome::Limit, RunProgramResult::OUTCOME_LIMIT),
            (Outcome::Stopped, RunProgramResult::OUTCOME_STOPPED),
            (Outcome::Fault, RunProgramResult::OUTCOME_FAULT),
        ] {
            assert_eq!(outcome as u8, number);
        }
        for (state, number) in [
            (RunState::Idle, RunProgramFeedback::STATE_IDLE),
            (RunState::Running, RunProgramFeedback::STATE_RUNNING),
            (RunState::Probing, RunProgramFeedback::STATE_PROBING),
            (RunState::Holding, RunProgramFeedback::STATE_HOLDING),
            (RunState::Fault, RunProgramFeedback::STATE_FAULT),
        ] {
            assert_eq!(state as u8, number);
        }
    }
}
