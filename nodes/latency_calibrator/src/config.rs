//! Parameters of the latency calibrator; keys carry their units, limits are checked once.

use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::LatencyCalibratorError;

/// Operational parameters; what is physical comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LatencyCalibratorConfig {
    /// Positions that the motion log holds.
    #[schemars(range(min = 8.0, max = 1e6))]
    pub log_samples: usize,
    /// Time before the latch over which the feed at contact is taken; at least the latency.
    #[schemars(range(min = 1.0, max = 1e3))]
    pub feed_window_ms: f64,
    /// Largest change of the feed over that time, as a share of the feed.
    #[schemars(range(min = 1e-4, max = 0.5))]
    pub steady_share: f64,
    /// Feeds closer than this share of the smaller are one feed.
    #[schemars(range(min = 1e-6, max = 0.5))]
    pub same_feed_share: f64,
    /// How long a touch waits for its positions, and the end of a run for its last touch.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub hold_ms: f64,
    /// Lack of fit is reported below this p value.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lack_of_fit_limit: f64,
    /// Machine file, relative to the parameter file.
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

impl LatencyCalibratorConfig {
    /// Checks every value against its limits.
    pub(crate) fn check(&self) -> Result<(), LatencyCalibratorError> {
        Ok(check_parameters(self)?)
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
