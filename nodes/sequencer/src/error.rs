//! What can be wrong with a plan or an event.

use machine::{CycleError, TrajectoryError};
use metrology::BoundError;
use metrology::number::number;

/// Why an ordered cycle is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum OrderError {
    #[error(transparent)]
    Bound(#[from] BoundError),
    #[error(transparent)]
    Cycle(#[from] CycleError),
    #[error("{key} = {value}: a {cycle} cycle does not use it: {reason}")]
    Unused {
        key: &'static str,
        value: String,
        cycle: &'static str,
        reason: &'static str,
    },
    #[error("features: {n} names ({names}): a latency cycle touches exactly one feature")]
    OneFeature { n: usize, names: String },
}

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
    #[error("steps[{step}].minutes = {minutes} min: must be above 0 and finite", minutes = number(*minutes))]
    Minutes { step: usize, minutes: f64 },
    #[error("steps[{step}].seconds = {seconds} s: must be above 0 and finite", seconds = number(*seconds))]
    Seconds { step: usize, seconds: f64 },
    #[error(transparent)]
    Bound(#[from] BoundError),
    #[error("steps[{step}]: {source}")]
    Cycle { step: usize, source: CycleError },
    #[error("steps[{step}]: {source}")]
    Order { step: usize, source: OrderError },
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
    #[error("steps[{step}].id = \"{id}\": the machine file has no artefact of this name")]
    UnknownArtefact { step: usize, id: String },
    #[error(
        "steps[{step}].program = \"{program}\", line {line}: (zero: {what}) sets the count to zero by which steps[{measured_by}] measures: remove it; that step sets its zero itself"
    )]
    ZeroInProgram {
        step: usize,
        program: String,
        line: usize,
        what: &'static str,
        measured_by: usize,
    },
    #[error("steps: the plan has none")]
    NoSteps,
}
