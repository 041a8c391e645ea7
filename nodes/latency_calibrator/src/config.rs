//! Parameters of the latency calibrator; keys carry their units, limits are checked once.

use metrology::ParameterDoc;
use metrology::stamp::Span;
use serde::{Deserialize, Serialize};

use crate::error::LatencyCalibratorError;

/// Operational parameters; what is physical comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LatencyCalibratorConfig {
    /// Positions that the motion log holds.
    pub log_samples: usize,
    /// Time before the latch over which the feed at contact is taken; at least the latency.
    pub feed_window_ms: f64,
    /// Largest change of the feed over that time, as a share of the feed.
    pub steady_share: f64,
    /// Feeds closer than this share of the smaller are one feed.
    pub same_feed_share: f64,
    /// How long a touch waits for its positions, and the end of a run for its last touch.
    pub hold_ms: f64,
    /// Lack of fit is reported below this p value.
    pub lack_of_fit_limit: f64,
    /// Machine file, relative to the parameter file; read by whoever builds the node.
    pub machine_file: String,
}

impl Default for LatencyCalibratorConfig {
    fn default() -> Self {
        Self {
            log_samples: 4096,
            feed_window_ms: 30.0,
            steady_share: 0.02,
            same_feed_share: 0.02,
            hold_ms: 200.0,
            lack_of_fit_limit: 0.01,
            machine_file: String::new(),
        }
    }
}

/// What each parameter means.
pub const PARAMETERS: [ParameterDoc; 7] = [
    ParameterDoc {
        name: "log_samples",
        unit: "",
        description: "Positions that the motion log holds.",
        range: Some((8.0, 1e6)),
    },
    ParameterDoc {
        name: "feed_window_ms",
        unit: "ms",
        description: "Time before the latch over which the feed at contact is taken; at least the latency.",
        range: Some((1.0, 1e3)),
    },
    ParameterDoc {
        name: "steady_share",
        unit: "",
        description: "Largest change of the feed over that time, as a share of the feed.",
        range: Some((1e-4, 0.5)),
    },
    ParameterDoc {
        name: "same_feed_share",
        unit: "",
        description: "Feeds closer than this share of the smaller are one feed.",
        range: Some((1e-6, 0.5)),
    },
    ParameterDoc {
        name: "hold_ms",
        unit: "ms",
        description: "How long a touch waits for its positions, and the end of a run for its last touch.",
        range: Some((0.0, 1e4)),
    },
    ParameterDoc {
        name: "lack_of_fit_limit",
        unit: "",
        description: "Lack of fit is reported below this p value.",
        range: Some((0.0, 1.0)),
    },
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
];

impl LatencyCalibratorConfig {
    /// Checks every value against its range.
    pub(crate) fn check(&self) -> Result<(), LatencyCalibratorError> {
        let values = [
            self.log_samples as f64,
            self.feed_window_ms,
            self.steady_share,
            self.same_feed_share,
            self.hold_ms,
            self.lack_of_fit_limit,
        ];
        for (doc, value) in PARAMETERS.iter().zip(values) {
            if let Some((least, greatest)) = doc.range
                && !(least..=greatest).contains(&value)
            {
                return Err(LatencyCalibratorError::OutOfRange {
                    name: doc.name,
                    value,
                    least,
                    greatest,
                });
            }
        }
        Ok(())
    }

    pub(crate) fn feed_window(&self) -> Span {
        Span::from_secs_f64(self.feed_window_ms / 1e3)
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
        let yaml = serde_saphyr::to_string(&LatencyCalibratorConfig::default()).unwrap();
        let defaults = ["4096", "30.0", "0.02", "0.02", "200.0", "0.01"];
        for (doc, default) in PARAMETERS.iter().zip(defaults) {
            let unit = if doc.unit.is_empty() { "-" } else { doc.unit };
            let name = doc.name;
            let row = format!("| `{name}` | {unit} | {default} | {} |", doc.description);
            assert!(readme.contains(&row), "{row}");
            assert!(yaml.contains(&format!("{name}: {default}")), "{yaml}");
        }
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let config = LatencyCalibratorConfig {
            steady_share: 0.0,
            ..LatencyCalibratorConfig::default()
        };
        assert_eq!(
            config.check().unwrap_err().to_string(),
            "steady_share = 0: must be from 0.0001 to 0.5"
        );
        let error = serde_saphyr::from_str::<LatencyCalibratorConfig>("window: 3").unwrap_err();
        assert!(error.to_string().contains("window"));
    }
}
