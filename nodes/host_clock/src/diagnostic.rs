//! What the stage has to say besides its map; each is on `/diagnostics`.

use metrology::Severity;

use crate::estimate::Impossible;

/// A condition worth reporting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each sentence names its fields with their units"
)]
pub enum Diagnostic {
    #[error("no answer of host {reference} for {silence_s:.1} s")]
    Silent { reference: String, silence_s: f64 },
    #[error("host {reference} answers")]
    Heard { reference: String },
    #[error("a clock stepped: host {reference} is ahead by {by_s:.6} s more than before")]
    Stepped { reference: String, by_s: f64 },
    #[error("an exchange is not used: {0}")]
    Refused(Impossible),
    #[error("exchanges agree again")]
    Agreed,
    #[error("host {found} answers as reference, {expected} was asked")]
    OtherReference { found: String, expected: String },
}

impl Diagnostic {
    /// How much it matters.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Heard { .. } | Self::Agreed => Severity::Info,
            Self::Silent { .. } | Self::Stepped { .. } | Self::Refused(_) => Severity::Warn,
            Self::OtherReference { .. } => Severity::Error,
        }
    }

    /// Which condition it is; a silence ends with an answer, and a step or a senseless exchange when none came for a while.
    #[must_use]
    pub const fn condition(&self) -> &'static str {
        match self {
            Self::Silent { .. } | Self::Heard { .. } => "reference_silent",
            Self::Stepped { .. }
            | Self::Refused(_)
            | Self::OtherReference { .. }
            | Self::Agreed => "exchange",
        }
    }
}
