//! Parameters of the machine's frames.

use metrology::ParameterDoc;
use metrology::stamp::Span;
use serde::{Deserialize, Serialize};

use crate::error::MachineFramesError;

/// Operational parameters; the machine itself comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MachineFramesConfig {
    /// Greatest rate of moving frames; 0: with every position.
    pub rate_hz: f64,
    /// Time without positions that is reported.
    pub silence_s: f64,
    /// Machine file, relative to the parameter file; read by whoever builds the node.
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

/// What each parameter means.
pub const PARAMETERS: [ParameterDoc; 3] = [
    ParameterDoc {
        name: "rate_hz",
        unit: "Hz",
        description: "Greatest rate of moving frames; 0: with every position.",
        range: Some((0.0, 1e3)),
    },
    ParameterDoc {
        name: "silence_s",
        unit: "s",
        description: "Time without positions that is reported.",
        range: Some((1.0, 3600.0)),
    },
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
];

impl MachineFramesConfig {
    /// Checks every value against its range.
    pub(crate) fn check(&self) -> Result<(), MachineFramesError> {
        for (doc, value) in PARAMETERS.iter().zip([self.rate_hz, self.silence_s]) {
            if let Some((least, greatest)) = doc.range
                && !(least..=greatest).contains(&value)
            {
                return Err(MachineFramesError::OutOfRange {
                    name: doc.name,
                    value,
                    least,
                    greatest,
                });
            }
        }
        Ok(())
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
