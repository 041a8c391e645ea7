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
    /// Greatest rate of moving frames, 0.001 or above; 0: with every position.
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

/// Least rate that is one: a frame in a quarter of an hour. The period is its inverse.
const LEAST_RATE_HZ: f64 = 1e-3;

impl MachineFramesConfig {
    /// Checks every value against its limits.
    pub(crate) fn check(&self) -> Result<(), MachineFramesError> {
        check_parameters(self)?;
        if self.rate_hz > 0.0 && self.rate_hz < LEAST_RATE_HZ {
            return Err(MachineFramesError::Rate {
                rate_hz: self.rate_hz,
                least_hz: LEAST_RATE_HZ,
            });
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_is_almost_none_is_refused_and_none_is_every_position() {
        let of = |rate_hz| MachineFramesConfig {
            rate_hz,
            ..MachineFramesConfig::default()
        };
        for rate_hz in [0.0, 1e-3, 50.0, 1e3] {
            assert!(of(rate_hz).check().is_ok(), "{rate_hz}");
        }
        for rate_hz in [1e-300, f64::MIN_POSITIVE, 9e-4] {
            let said = of(rate_hz).check().unwrap_err().to_string();
            assert!(said.starts_with("rate_hz = "), "{said}");
            assert!(
                said.ends_with("must be 0 (every position) or at least 0.001 Hz"),
                "{said}"
            );
        }
        for rate_hz in [-1.0, f64::NAN, f64::INFINITY, 1e4] {
            assert!(of(rate_hz).check().is_err(), "{rate_hz}");
        }
    }
}
