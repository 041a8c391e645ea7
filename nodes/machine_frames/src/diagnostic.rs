//! What a person should know of the positions that come.

use std::fmt;

use metrology::{AxisSet, Severity};

/// A condition that began or ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Diagnostic {
    /// No positions for longer than `silence_s`; tf stands still.
    Silent {
        /// How long, s.
        for_s: f64,
    },
    /// Positions come again.
    Heard,
    /// Positions lack axes of the machine; what these move is not told.
    Lacking {
        /// The axes.
        axes: AxisSet,
    },
    /// Every axis of the machine is told.
    Complete,
}

impl Diagnostic {
    /// Name of the condition.
    #[must_use]
    pub const fn condition(&self) -> &'static str {
        match self {
            Self::Silent { .. } | Self::Heard => "joints_silent",
            Self::Lacking { .. } | Self::Complete => "axes_lacking",
        }
    }

    /// How much it matters.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Silent { .. } | Self::Lacking { .. } => Severity::Warn,
            Self::Heard | Self::Complete => Severity::Info,
        }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent { for_s } => {
                write!(f, "no joint states for {for_s:.1} s: moving frames stand")
            }
            Self::Lacking { axes } => {
                f.write_str(
                    "joint states lack axes of the machine file, and what these move is not told:",
                )?;
                axes.iter().try_for_each(|axis| write!(f, " {axis}"))
            }
            Self::Heard | Self::Complete => Ok(()),
        }
    }
}
