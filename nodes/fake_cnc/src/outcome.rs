//! How a program ends.

use metrology::Axis;
use metrology::number::number;

use crate::diagnostic::Diagnostic;

/// Kind of an end, as the action reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(
    missing_docs,
    reason = "named after the constants of RunProgram.action"
)]
pub enum Outcome {
    Done,
    Refused,
    ProbeMissed,
    ProbeStuck,
    Limit,
    Stopped,
    Fault,
}

/// What a control is doing, as the action's feedback reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(
    missing_docs,
    reason = "named after the constants of RunProgram.action"
)]
pub enum ProgramState {
    Idle,
    Running,
    Probing,
    Holding,
    Fault,
}

/// Why a program ended, with what a person needs to find the place.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "the sentence of each variant is its documentation"
)]
pub enum Ending {
    #[error("")]
    Done,
    #[error("line {line}: touch of {feature:?} ended without the probe {wanted}")]
    Missed {
        line: u32,
        feature: String,
        wanted: &'static str,
    },
    #[error("line {line}: the probe is already {state} before the touch of {feature:?}")]
    Stuck {
        line: u32,
        feature: String,
        state: &'static str,
    },
    #[error(
        "line {line}: after the first motion the text says {axis} = {wanted} {unit}, the machine is at {found} {unit}: the program's coordinates are not the machine's; look at the control's offsets",
        wanted = number(*wanted),
        found = number(*found)
    )]
    FrameDiffers {
        line: u32,
        axis: Axis,
        wanted: f64,
        found: f64,
        unit: &'static str,
    },
    #[error("line {line}: cancelled")]
    Cancelled { line: u32 },
    #[error("line {line}: {diagnostic}")]
    Fault { line: u32, diagnostic: Diagnostic },
}

impl Ending {
    /// Line at which it ended, where that is not the program's last.
    #[must_use]
    pub const fn line(&self) -> Option<u32> {
        match self {
            Self::Done => None,
            Self::Missed { line, .. }
            | Self::Stuck { line, .. }
            | Self::FrameDiffers { line, .. }
            | Self::Cancelled { line }
            | Self::Fault { line, .. } => Some(*line),
        }
    }

    /// Its kind.
    #[must_use]
    pub const fn outcome(&self) -> Outcome {
        match self {
            Self::Done => Outcome::Done,
            Self::Missed { .. } => Outcome::ProbeMissed,
            Self::Stuck { .. } => Outcome::ProbeStuck,
            Self::FrameDiffers { .. } => Outcome::Refused,
            Self::Cancelled { .. } => Outcome::Stopped,
            Self::Fault { .. } => Outcome::Fault,
        }
    }
}
