//! What can be wrong with a plan or an event.

use machine::{CycleError, TrajectoryError};

/// Why a plan cannot be run or an event cannot be taken.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum SequencerError {
    #[error("steps[{step}].program = \"{program}\": no such program was given (known: {known})")]
    UnknownProgram {
        step: usize,
        program: String,
        known: String,
    },
    #[error("steps[{step}].minutes = {minutes}: must be above 0 and finite")]
    Minutes { step: usize, minutes: f64 },
    #[error("steps[{step}].seconds = {seconds}: must be above 0 and finite")]
    Seconds { step: usize, seconds: f64 },
    #[error("steps[{step}]: {source}")]
    Cycle { step: usize, source: CycleError },
    #[error("steps[{step}]: {source}")]
    Trajectory {
        step: usize,
        source: TrajectoryError,
    },
    #[error("steps[{step}].{key}: missing, {of} needs it")]
    KeyMissing {
        step: usize,
        key: &'static str,
        of: &'static str,
    },
    #[error("steps[{step}].{key}: {of} has none")]
    KeySuperfluous {
        step: usize,
        key: &'static str,
        of: &'static str,
    },
    #[error("steps[{step}]: no beam, run or repetition: there is nothing to run")]
    NothingToRun { step: usize },
    #[error(
        "steps[{step}]: {poses} poses and planned = {planned}: exactly one of the two must be given"
    )]
    PosesOrPlanned {
        step: usize,
        poses: usize,
        planned: u32,
    },
    #[error("steps[{step}].poses[{pose}]: {n} positions, the rotary axes are {axes}")]
    PoseLength {
        step: usize,
        pose: usize,
        n: usize,
        axes: String,
    },
    #[error("steps[{step}].repeats = 0: must be above 0")]
    NoRepeats { step: usize },
    #[error("steps[{step}].points = 0: must be above 0")]
    NoPoints { step: usize },
    #[error("steps: the plan has none")]
    NoSteps,
}
