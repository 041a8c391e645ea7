//! Parameters of the node that follows a live machine; keys carry their units, limits are checked once.

use metrology::check_parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::GapConfig;
use crate::error::GapError;

/// Operational parameters; what is physical comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GapDiagnosisConfig {
    /// Most recent runs that a diagnosis looks at.
    #[schemars(range(min = 2.0, max = 1e4))]
    pub last_runs: usize,
    /// Runs before the first diagnosis.
    #[schemars(range(min = 2.0, max = 1e4))]
    pub least_runs: usize,
    /// Runs of one test cycle: the last so many are also diagnosed by themselves, and those before say what noise is.
    #[schemars(range(min = 1.0, max = 1e4))]
    pub cycle_runs: usize,
    /// Least time between two diagnoses.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub least_period_s: f64,
    /// Confidence from which a new effect is warned of.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub least_confidence: f64,
    /// Stations that a circle, or one pass of a line, is thinned to.
    #[schemars(range(min = 16.0, max = 1e5))]
    pub stations_per_pass: usize,
    /// Draws of the significance test.
    #[schemars(range(min = 99.0, max = 1e5))]
    pub draws_of_significance: usize,
    /// Draws of the bootstrap over held-out runs.
    #[schemars(range(min = 100.0, max = 1e6))]
    pub draws_of_intervals: usize,
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
}

impl Default for GapDiagnosisConfig {
    fn default() -> Self {
        Self {
            last_runs: 200,
            least_runs: 6,
            cycle_runs: 12,
            least_period_s: 5.0,
            least_confidence: 0.8,
            stations_per_pass: 120,
            draws_of_significance: 199,
            draws_of_intervals: 500,
            machine_file: String::new(),
        }
    }
}

impl GapDiagnosisConfig {
    /// Checks every value against its range and gives the settings of each diagnosis.
    pub(crate) fn gap_config(&self) -> Result<GapConfig, GapError> {
        check_parameters(self)?;
        Ok(GapConfig {
            stations: self.stations_per_pass,
            significance_draws: self.draws_of_significance,
            bootstrap_draws: self.draws_of_intervals,
            ..GapConfig::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let config = GapDiagnosisConfig {
            least_confidence: 1.5,
            ..GapDiagnosisConfig::default()
        };
        assert_eq!(
            config.gap_config().map_err(|error| error.to_string()),
            Err("least_confidence = 1.5: must be from 0 to 1".to_owned())
        );
    }
}
