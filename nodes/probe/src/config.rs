//! Parameters of the probe node; keys carry their units, limits are checked once.

use machine::MachineFile;
use metrology::ParameterDoc;
use metrology::stamp::Span;
use serde::{Deserialize, Serialize};

use crate::error::ProbeError;

/// Operational parameters have defaults; a latency has none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProbeConfig {
    /// Positions that the coordinate queue holds.
    pub queue_samples: usize,
    /// Longest time between two positions that are interpolated.
    pub longest_gap_ms: f64,
    /// How long a touch waits for the positions around its instant, and the end of a run for touches.
    pub hold_ms: f64,
    /// Whether a touch that the queue cannot answer is corrected with feed times latency.
    pub allow_feed_correction: bool,
    /// Latency until one is calibrated; overrides that of the machine file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency_ms: Option<f64>,
    /// Standard uncertainty of a latency that is given, not calibrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency_standard_uncertainty_ms: Option<f64>,
    /// Machine file, relative to the parameter file; read by whoever builds the node.
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

/// What each parameter means.
pub const PARAMETERS: [ParameterDoc; 7] = [
    ParameterDoc {
        name: "queue_samples",
        unit: "",
        description: "Positions that the coordinate queue holds.",
        range: Some((2.0, 1e6)),
    },
    ParameterDoc {
        name: "longest_gap_ms",
        unit: "ms",
        description: "Longest time between two positions that are interpolated.",
        range: Some((0.01, 1e3)),
    },
    ParameterDoc {
        name: "hold_ms",
        unit: "ms",
        description: "How long a touch waits for the positions around its instant, and the end of a run for touches.",
        range: Some((0.0, 1e4)),
    },
    ParameterDoc {
        name: "allow_feed_correction",
        unit: "",
        description: "Whether a touch that the queue cannot answer is corrected with feed times latency.",
        range: None,
    },
    ParameterDoc {
        name: "latency_ms",
        unit: "ms",
        description: "Latency until one is calibrated; overrides that of the machine file.",
        range: Some((0.0, 1e3)),
    },
    ParameterDoc {
        name: "latency_standard_uncertainty_ms",
        unit: "ms",
        description: "Standard uncertainty of a latency that is given, not calibrated.",
        range: Some((0.0, 1e3)),
    },
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
];

/// A latency that was given rather than calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GivenLatency {
    pub(crate) latency_s: f64,
    pub(crate) standard_uncertainty_s: f64,
}

impl ProbeConfig {
    /// Checks every value against its range.
    pub(crate) fn check(&self) -> Result<(), ProbeError> {
        let values = [
            Some(self.queue_samples as f64),
            Some(self.longest_gap_ms),
            Some(self.hold_ms),
            None,
            self.latency_ms,
            self.latency_standard_uncertainty_ms,
        ];
        for (doc, value) in PARAMETERS.iter().zip(values) {
            let (Some((least, greatest)), Some(value)) = (doc.range, value) else {
                continue;
            };
            if !(least..=greatest).contains(&value) {
                return Err(ProbeError::OutOfRange {
                    name: doc.name,
                    value,
                    least,
                    greatest,
                });
            }
        }
        Ok(())
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
    fn the_readme_lists_every_parameter_with_its_default() {
        let readme = include_str!("../README.md");
        let defaults = ["4096", "5.0", "200.0", "false", "none", "none"];
        for (doc, default) in PARAMETERS.iter().zip(defaults) {
            let unit = if doc.unit.is_empty() { "-" } else { doc.unit };
            let row = format!(
                "| `{}` | {unit} | {default} | {} |",
                doc.name, doc.description
            );
            assert!(readme.contains(&row), "{row}");
        }
        let yaml = serde_saphyr::to_string(&ProbeConfig::default()).unwrap();
        for default in ["4096", "5.0", "200.0", "false"] {
            assert!(yaml.contains(default), "{yaml}");
        }
    }

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
