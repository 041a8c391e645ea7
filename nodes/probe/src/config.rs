//! Parameters of the probe node; keys carry their units, limits are checked once.

use machine::MachineFile;
use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ProbeError;

/// Operational parameters have defaults; a latency has none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProbeConfig {
    /// Positions that the coordinate queue holds.
    #[schemars(range(min = 2.0, max = 1e6))]
    pub queue_samples: usize,
    /// Longest time between two positions that are interpolated.
    #[schemars(range(min = 0.01, max = 1e3))]
    pub longest_gap_ms: f64,
    /// How long a touch waits for the positions around its instant, and the end of a run for touches.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub hold_ms: f64,
    /// Whether a touch that the queue cannot answer is corrected with feed times latency.
    pub allow_feed_correction: bool,
    /// Latency until one is calibrated; overrides that of the machine file.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e3))]
    pub latency_ms: Option<f64>,
    /// Standard uncertainty of a latency that is given, not calibrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1e3))]
    pub latency_standard_uncertainty_ms: Option<f64>,
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
}

impl Default for ProbeConfig {
    fn default() -> Self {
        Self {
            queue_samples: 4096,
            longest_gap_ms: 5.0,
            hold_ms: 200.0,
            allow_feed_correction: false,
            latency_ms: None,
            latency_standard_uncertainty_ms: None,
            machine_file: String::new(),
        }
    }
}

/// A latency that was given rather than calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GivenLatency {
    pub(crate) latency_s: f64,
    pub(crate) standard_uncertainty_s: f64,
}

impl ProbeConfig {
    /// Checks every value against its limits.
    pub(crate) fn check(&self) -> Result<(), ProbeError> {
        Ok(check_parameters(self)?)
    }

    /// The latency of the parameters or, failing that, of the machine file.
    pub(crate) fn given_latency(
        &self,
        file: &MachineFile,
    ) -> Result<Option<GivenLatency>, ProbeError> {
        let Some(latency_ms) = self.latency_ms.or(file.probe.latency_ms) else {
            return Ok(None);
        };
        let uncertainty_ms = self
            .latency_standard_uncertainty_ms
            .ok_or(ProbeError::UncertaintyMissing { latency_ms })?;
        Ok(Some(GivenLatency {
            latency_s: latency_ms / 1e3,
            standard_uncertainty_s: uncertainty_ms / 1e3,
        }))
    }

    pub(crate) fn longest_gap(&self) -> Span {
        Span::from_secs_f64(self.longest_gap_ms / 1e3)
    }

    pub(crate) fn hold(&self) -> Span {
        Span::from_secs_f64(self.hold_ms / 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let refused = |config: ProbeConfig| config.check().unwrap_err().to_string();
        assert_eq!(
            refused(ProbeConfig {
                queue_samples: 1,
                ..ProbeConfig::default()
            }),
            "queue_samples = 1: must be from 2 to 1000000"
        );
        assert_eq!(
            refused(ProbeConfig {
                longest_gap_ms: f64::NAN,
                ..ProbeConfig::default()
            }),
            "longest_gap_ms = NaN ms: must be from 0.01 to 1000 ms"
        );
        assert_eq!(
            refused(ProbeConfig {
                latency_ms: Some(-1.0),
                ..ProbeConfig::default()
            }),
            "latency_ms = -1 ms: must be from 0 to 1000 ms"
        );
    }

    #[test]
    fn an_unknown_key_is_refused_by_name() {
        let error = serde_saphyr::from_str::<ProbeConfig>("hold_s: 1.0").unwrap_err();
        assert!(error.to_string().contains("hold_s"));
    }
}
