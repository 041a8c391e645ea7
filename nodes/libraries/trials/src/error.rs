//! What can keep a trial from being made.

use fake_cnc::{CncError, PlantError};
use machine::MachineFileError;
use sequencer::SequencerError;

use crate::arm::Arm;
use crate::compared::Compared;
use metrology::number::number;

/// A trial that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// There is no such arm.
    #[error("arm \"{name}\": must be one of {}", Arm::ALL.map(Arm::numeral).join(" "))]
    UnknownArm {
        /// The text that was read.
        name: String,
    },
    /// The drawn machine file breaks a rule.
    #[error("drawn machine: {source}")]
    Machine {
        /// Which.
        #[from]
        source: MachineFileError,
    },
    /// The machine file or the plan cannot be written as text.
    #[error("drawn machine or its plan: {source}")]
    Text {
        /// Why.
        #[from]
        source: serde_saphyr::SerializeError,
    },
    /// The drawn plant breaks a rule.
    #[error("drawn plant: {source}")]
    Plant {
        /// Which.
        #[from]
        source: PlantError,
    },
    /// The control refuses its parameters.
    #[error("drawn control: {source}")]
    Control {
        /// Which.
        #[from]
        source: CncError,
    },
    /// The plan cannot be run on the drawn machine.
    #[error("drawn programme: {source}")]
    Programme {
        /// Which step, and why.
        #[from]
        source: SequencerError,
    },
    /// The plan is no plan.
    #[error("drawn programme: {source}")]
    ProgrammeText {
        /// Line, and what is wrong there.
        source: sequencer::PlanError,
    },
    /// A programme of the comparison does not fit into its minutes.
    #[error("programme {programme}: {} min are too few, it needs {} min: give more with --minutes", number(*minutes), number(*needs_min))]
    TooFewMinutes {
        /// Which.
        programme: Compared,
        /// What there is.
        minutes: f64,
        /// What one pass of it takes, set-ups included.
        needs_min: f64,
    },
    /// A program ended early on the plant.
    #[error("run {run} failed: {message}")]
    Failed {
        /// Which run.
        run: u32,
        /// Why.
        message: String,
    },
    /// The plan did not end.
    #[error("the programme takes more than {limit_s} s", limit_s = number(*limit_s))]
    Endless {
        /// Simulated time that it had.
        limit_s: f64,
    },
    /// An effect that this machine cannot have.
    #[error("hidden {effect} {axis}: {size} cannot be hidden in this machine", size = number(*size))]
    Impossible {
        /// Id of the effect.
        effect: &'static str,
        /// What it acts on.
        axis: &'static str,
        /// Its size.
        size: f64,
    },
}

impl TrialError {
    /// Whether a programme began on the plant and did not get to its end: that is so of this machine alone.
    #[must_use]
    pub const fn is_of_the_plant(&self) -> bool {
        matches!(self, Self::Failed { .. } | Self::Endless { .. })
    }
}
