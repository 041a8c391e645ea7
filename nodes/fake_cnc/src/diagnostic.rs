//! Conditions that the control reports without being asked.

use metrology::Axis;

pub use metrology::Severity;

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
    #[error("time went back by {by_s} s: the controller's own clock goes on")]
    TimeSetBack { by_s: f64 },
    #[error("time jumped by {by_s} s, limit {limit_s} s: skipped")]
    TimeJumped { by_s: f64, limit_s: f64 },
    #[error("time passes as it should again")]
    TimePasses,
    #[error("there is no program {goal} to cancel")]
    NothingToCancel { goal: u64 },
}

impl Diagnostic {
    /// Which condition it is about; a condition is over when told with [`Severity::Info`].
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::CompensationNotFinite { .. }
            | Self::CompensationTooLarge { .. }
            | Self::CompensationStale { .. }
            | Self::CompensationFollowed => "compensation_input",
            Self::FollowingError { .. } | Self::ProbeInMotion { .. } | Self::FaultCleared => {
                "motion_fault"
            }
            Self::TimeWentBack { .. }
            | Self::TimeSetBack { .. }
            | Self::TimeJumped { .. }
            | Self::TimePasses => "time",
            Self::NothingToCancel { .. } => "cancel",
        }
    }

    /// How much it matters.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::CompensationFollowed
            | Self::FaultCleared
            | Self::TimePasses
            | Self::NothingToCancel { .. } => Severity::Info,
            Self::CompensationStale { .. } | Self::TimeJumped { .. } | Self::TimeSetBack { .. } => {
                Severity::Warn
            }
            Self::CompensationNotFinite { .. }
            | Self::CompensationTooLarge { .. }
            | Self::FollowingError { .. }
            | Self::ProbeInMotion { .. }
            | Self::TimeWentBack { .. } => Severity::Error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_condition_that_can_go_wrong_can_be_told_well_again() {
        let wrong = [
            Diagnostic::CompensationStale { silent_periods: 1 },
            Diagnostic::ProbeInMotion { line: 1 },
            Diagnostic::TimeWentBack { by_s: 0.05 },
            Diagnostic::TimeSetBack { by_s: 1.0 },
        ];
        let well = [
            Diagnostic::CompensationFollowed,
            Diagnostic::FaultCleared,
            Diagnostic::TimePasses,
        ];
        for (wrong, well) in wrong.iter().zip(&well) {
            assert_eq!(wrong.name(), well.name());
            assert!(wrong.severity() > Severity::Info);
            assert_eq!(well.severity(), Severity::Info);
        }
    }
}
