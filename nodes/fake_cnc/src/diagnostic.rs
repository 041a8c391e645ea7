//! Conditions that the control reports without being asked.

use metrology::number::{along, number};
use metrology::{Author, Axis, OffsetFault};

pub use metrology::Severity;

use crate::rs274::program::Wait;

/// Something worth telling; lengths mm, angles rad.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "the sentence of each variant is its documentation"
)]
pub enum Diagnostic {
    #[error("{fault}")]
    CompensationRefused { fault: OffsetFault, times: u64 },
    #[error("no compensation for {silent_periods} servo periods: fading")]
    CompensationStale { silent_periods: u64 },
    #[error(
        "two publishers of compensation are heard ({one} and {other}): offsets fade to zero and no program that touches runs; end one of them (`ros2 topic info --verbose /compensation` lists both)"
    )]
    CompensationContested { one: Author, other: Author },
    #[error("one publisher of compensation is heard: it is followed")]
    CompensationUncontested,
    #[error("compensation is followed again")]
    CompensationFollowed,
    #[error(
        "axis {axis} follows with an error of {}, limit {}: stopped",
        along(*axis, *error), along(*axis, *limit)
    )]
    FollowingError { axis: Axis, error: f64, limit: f64 },
    #[error(
        "probe closed in a motion that is no touch, or between touches, line {line}, at {place} (machine coordinates, mm and deg): stopped; move away from the surface, and look at what the probe met"
    )]
    ProbeTripped { line: u32, place: String },
    #[error("program waits at line {line} ({why}): resume it, or cancel it")]
    Waiting { line: u32, why: Wait },
    #[error("the program no longer waits")]
    WaitsNoLonger,
    #[error("compensation is held back at zero until every axis is homed")]
    CompensationHeldBack,
    #[error("every axis is homed: compensation is followed")]
    CompensationReleased,
    #[error("a new program runs after the fault")]
    FaultCleared,
    #[error(
        "time went back by {by_s} s: nothing is simulated until it has passed again",
        by_s = number(*by_s)
    )]
    TimeWentBack { by_s: f64 },
    #[error("time went back by {by_s} s: the controller's own clock goes on", by_s = number(*by_s))]
    TimeSetBack { by_s: f64 },
    #[error(
        "time jumped by {by_s} s, limit {limit_s} s: skipped",
        by_s = number(*by_s), limit_s = number(*limit_s)
    )]
    TimeJumped { by_s: f64, limit_s: f64 },
    #[error("time passes as it should again")]
    TimePasses,
    #[error(
        "line {line}: (zero: {what}) with nothing mounted that has a count: nothing is set to zero and nothing is read; mount it before, (mount: NAME) with a name of the machine file"
    )]
    NothingToZero { line: u32, what: &'static str },
    #[error("what is mounted has a count, which is set to zero")]
    CountZeroed,
    #[error("there is no program {goal} to cancel")]
    NothingToCancel { goal: u64 },
}

impl Diagnostic {
    /// Which condition it is about; a condition is over when told with [`Severity::Info`].
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::CompensationRefused { .. }
            | Self::CompensationStale { .. }
            | Self::CompensationFollowed => "compensation_input",
            Self::CompensationContested { .. } | Self::CompensationUncontested => {
                "compensation_publishers"
            }
            Self::FollowingError { .. } | Self::ProbeTripped { .. } | Self::FaultCleared => {
                "motion_fault"
            }
            Self::Waiting { .. } | Self::WaitsNoLonger => "program_waits",
            Self::CompensationHeldBack | Self::CompensationReleased => "compensation_held_back",
            Self::TimeWentBack { .. }
            | Self::TimeSetBack { .. }
            | Self::TimeJumped { .. }
            | Self::TimePasses => "time",
            Self::NothingToZero { .. } | Self::CountZeroed => "nothing_mounted",
            Self::NothingToCancel { .. } => "cancel",
        }
    }

    /// How much it matters.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::CompensationFollowed
            | Self::CompensationUncontested
            | Self::CompensationReleased
            | Self::WaitsNoLonger
            | Self::FaultCleared
            | Self::TimePasses
            | Self::CountZeroed
            | Self::NothingToCancel { .. } => Severity::Info,
            // Until the clocks of two hosts are related, stamps of the other differ: a start, not a fault.
            Self::CompensationRefused { fault, .. } if fault.is_of_time() => Severity::Warn,
            Self::CompensationStale { .. }
            | Self::CompensationHeldBack
            | Self::NothingToZero { .. }
            | Self::Waiting { .. }
            | Self::TimeJumped { .. }
            | Self::TimeSetBack { .. } => Severity::Warn,
            Self::CompensationRefused { .. }
            | Self::CompensationContested { .. }
            | Self::FollowingError { .. }
            | Self::ProbeTripped { .. }
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
            Diagnostic::ProbeTripped {
                line: 1,
                place: String::new(),
            },
            Diagnostic::TimeWentBack { by_s: 0.05 },
            Diagnostic::Waiting {
                line: 1,
                why: Wait::Stop,
            },
            Diagnostic::CompensationHeldBack,
            Diagnostic::CompensationContested {
                one: Author([1; 16]),
                other: Author([2; 16]),
            },
            Diagnostic::NothingToZero {
                line: 1,
                what: "grid",
            },
        ];
        let well = [
            Diagnostic::CompensationFollowed,
            Diagnostic::FaultCleared,
            Diagnostic::TimePasses,
            Diagnostic::WaitsNoLonger,
            Diagnostic::CompensationReleased,
            Diagnostic::CompensationUncontested,
            Diagnostic::CountZeroed,
        ];
        for (wrong, well) in wrong.iter().zip(&well) {
            assert_eq!(wrong.name(), well.name());
            assert!(wrong.severity() > Severity::Info);
            assert_eq!(well.severity(), Severity::Info);
        }
    }
}
