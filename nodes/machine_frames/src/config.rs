//! Parameters of the machine's frames.

use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::MachineFramesError;

/// Operational parameters; the machine itself comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MachineFramesConfig {
    /// Greatest rate of moving frames; 0: with every position.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub rate_hz: f64,
    /// Time without positions that is reported.
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub silence_s: f64,
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
}

impl Default for MachineFramesConfig {
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            silence_s: 5.0,
            machine_file: String::new(),
        }
    }
}

impl MachineFramesConfig {
    /// Checks every value against its limits.
    pub(crate) fn check(&self) -> Result<(), MachineFramesError> {
        Ok(check_parameters(self)?)
    }

    /// Least time between two moving poses of one frame.
    pub(crate) fn period(&self) -> Span {
        if self.rate_hz > 0.0 {
            return Span::from_secs_f64(1.0 / self.rate_hz);
        }
        Span::from_nanos(0)
    }

    pub(crate) fn silence(&self) -> Span {
        Span::from_secs_f64(self.silence_s)
    }
}
