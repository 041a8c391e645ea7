//! Conditions that the control reports without being asked.

use metrology::Axis;

/// Something worth telling; lengths mm, angles rad.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "the sentence of each variant is its documentation"
)]
pub enum Diagnostic {
    #[error("compensation of axis {axis} is {value}: refused")]
    CompensationNotFinite { axis: Axis, value: f64 },
    #[error("compensation of axis {axis} is {value}, limit {limit}: refused")]
    CompensationTooLarge { axis: Axis, value: f64, limit: f64 },
    #[error("no compensation for {silent_periods} servo periods: fading")]
    CompensationStale { silent_periods: u64 },
    #[error("compensation is followed again")]
    CompensationFollowed,
    #[error("axis {axis} follows with an error of {error}, limit {limit}: stopped")]
    FollowingError { axis: Axis, error: f64, limit: f64 },
    #[error("probe closed in a motion that is no touch, line {line}: stopped")]
    ProbeInMotion { line: u32 },
    #[error("a new program runs after the fault")]
    FaultCleared,
    #[error("time went back by {by_s} s: nothing is simulated until it has passed again")]
    TimeWentBack { by_s: f64 },
    #[error("time jumped by {by_s} s, limit {limit_s} s: skipped")]
    TimeJumped { by_s: f64, limit_s: f64 },
    #[error("time passes as it should again")]
    TimePasses,
    #[error("there is no program {goal} to cancel")]
    NothingToCancel { goal: u64 },
}
