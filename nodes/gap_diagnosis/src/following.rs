//! Parameters of the node that follows a live machine; keys carry their units, limits are checked once.

use metrology::ParameterDoc;
use serde::{Deserialize, Serialize};

use crate::config::GapConfig;
use crate::error::GapError;

/// Operational parameters; what is physical comes from the machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GapDiagnosisConfig {
    /// Most recent runs that a diagnosis looks at.
    pub last_runs: usize,
    /// Runs before the first diagnosis.
    pub least_runs: usize,
    /// Runs of one test cycle: the last so many are diagnosed, those before say what noise is.
    pub cycle_runs: usize,
    /// Least time between two diagnoses.
    pub least_period_s: f64,
    /// Confidence from which a new effect is warned of.
    pub least_confidence: f64,
    /// Stations that a circle, or one pass of a line, is thinned to.
    pub stations_per_pass: usize,
    /// Draws of the significance test.
    pub draws_of_significance: usize,
    /// Draws of the bootstrap over held-out runs.
    pub draws_of_intervals: usize,
    /// Machine file, relative to the parameter file; read by whoever builds the node.
    pub machine_file: String,
}

impl Default for GapDiagnosisConfig {
    fn default() -> Self {
        Self {
            last_runs: 40,
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

/// What each parameter means.
pub const PARAMETERS: [ParameterDoc; 9] = [
    ParameterDoc {
        name: "last_runs",
        unit: "",
        description: "Most recent runs that a diagnosis looks at.",
        range: Some((2.0, 1e4)),
    },
    ParameterDoc {
        name: "least_runs",
        unit: "",
        description: "Runs before the first diagnosis.",
        range: Some((2.0, 1e4)),
    },
    ParameterDoc {
        name: "cycle_runs",
        unit: "",
        description: "Runs of one test cycle: the last so many are diagnosed, those before say what noise is.",
        range: Some((1.0, 1e4)),
    },
    ParameterDoc {
        name: "least_period_s",
        unit: "s",
        description: "Least time between two diagnoses.",
        range: Some((0.0, 1e5)),
    },
    ParameterDoc {
        name: "least_confidence",
        unit: "",
        description: "Confidence from which a new effect is warned of.",
        range: Some((0.0, 1.0)),
    },
    ParameterDoc {
        name: "stations_per_pass",
        unit: "",
        description: "Stations that a circle, or one pass of a line, is thinned to.",
        range: Some((16.0, 1e5)),
    },
    ParameterDoc {
        name: "draws_of_significance",
        unit: "",
        description: "Draws of the significance test.",
        range: Some((99.0, 1e5)),
    },
    ParameterDoc {
        name: "draws_of_intervals",
        unit: "",
        description: "Draws of the bootstrap over held-out runs.",
        range: Some((100.0, 1e6)),
    },
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
];

impl GapDiagnosisConfig {
    /// Checks every value against its range and gives the settings of each diagnosis.
    pub(crate) fn gap_config(&self) -> Result<GapConfig, GapError> {
        let values = [
            self.last_runs as f64,
            self.least_runs as f64,
            self.cycle_runs as f64,
            self.least_period_s,
            self.least_confidence,
            self.stations_per_pass as f64,
            self.draws_of_significance as f64,
            self.draws_of_intervals as f64,
        ];
        for (doc, value) in PARAMETERS.iter().zip(values) {
            if let Some((low, high)) = doc.range
                && !(low..=high).contains(&value)
            {
                return Err(GapError::Parameter {
                    name: doc.name,
                    value,
                    low,
                    high,
                });
            }
        }
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
    fn the_readme_lists_every_parameter_with_its_default() {
        let readme = include_str!("../README.md");
        let defaults = ["40", "6", "12", "5.0", "0.8", "120", "199", "500", "\"\""];
        for (doc, default) in PARAMETERS.iter().zip(defaults) {
            let unit = if doc.unit.is_empty() { "-" } else { doc.unit };
            let name = doc.name;
            let row = format!("| `{name}` | {unit} | {default} | {} |", doc.description);
            assert!(readme.contains(&row), "{row}");
        }
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let config = GapDiagnosisConfig {
            least_confidence: 1.5,
            ..GapDiagnosisConfig::default()
        };
        assert_eq!(
            config.gap_config().map_err(|error| error.to_string()),
            Err("least_confidence = 1.5: must be within 0 and 1".to_owned())
        );
    }
}
