//! Parameters of the rotary-axis calibration; what is physical comes from the machine file.

use metrology::check_parameters;
use metrology::stamp::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::allowance::Allowance;
use crate::error::RotaryAxesError;
use crate::estimate::EstimateRules;

/// Operational parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RotaryAxesConfig {
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
    /// How long the end of a run waits for its last sphere.
    #[schemars(range(min = 0.0, max = 60_000.0))]
    pub hold_ms: f64,
    /// How far the sphere is off when the axes come back to a pose, 1 standard deviation.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub pose_repeatability_um: f64,
    /// Greatest order of the harmonics of error motions that are tried; 0: none.
    #[schemars(range(min = 0.0, max = 4.0))]
    pub harmonic_orders: u8,
    /// Lack of fit is taken for real below this p value.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub lack_of_fit_limit: f64,
    /// A visit is left out if chance gives its residual with less than this p value in the whole set.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub doubtful_limit: f64,
    /// Merit of the poses below which a warning is given.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub least_merit: f64,
    /// What is alike in all visits and so in no residual; without it uncertainties are those of the noise alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub allowance: Option<Allowance>,
}

impl Default for RotaryAxesConfig {
    fn default() -> Self {
        Self {
            machine_file: String::new(),
            hold_ms: 1000.0,
            pose_repeatability_um: 0.0,
            harmonic_orders: 2,
            lack_of_fit_limit: 0.01,
            doubtful_limit: 0.001,
            least_merit: 1.0,
            allowance: None,
        }
    }
}

impl RotaryAxesConfig {
    /// Checks every value against its limits.
    pub(crate) fn check(&self) -> Result<(), RotaryAxesError> {
        Ok(check_parameters(self)?)
    }

    pub(crate) fn hold(&self) -> Span {
        Span::from_secs_f64(self.hold_ms / 1e3)
    }

    pub(crate) const fn rules(&self) -> EstimateRules {
        EstimateRules {
            harmonic_orders: self.harmonic_orders,
            doubtful_p: self.doubtful_limit,
            lack_of_fit_p: self.lack_of_fit_limit,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let config = RotaryAxesConfig {
            pose_repeatability_um: -0.1,
            ..RotaryAxesConfig::default()
        };
        assert_eq!(
            config.check().unwrap_err().to_string(),
            "pose_repeatability_um = -0.1 µm: must be from 0 to 100 µm"
        );
        let error = serde_saphyr::from_str::<RotaryAxesConfig>("harmonics: 3").unwrap_err();
        assert!(error.to_string().contains("harmonics"));
    }
}
