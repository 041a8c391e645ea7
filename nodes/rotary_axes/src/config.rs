//! Parameters of the rotary-axis calibration; what is physical comes from the machine file.

use metrology::ParameterDoc;
use metrology::stamp::Span;
use serde::{Deserialize, Serialize};

use crate::allowance::Allowance;
use crate::error::RotaryAxesError;
use crate::estimate::EstimateRules;

/// Operational parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RotaryAxesConfig {
    /// Machine file, relative to the parameter file; read by whoever builds the node.
    pub machine_file: String,
    /// How long the end of a run waits for its last sphere.
    pub hold_ms: f64,
    /// Repeatability of a pose: how far the sphere is off when the axes come back, 1 standard deviation.
    pub pose_repeatability_um: f64,
    /// Greatest order of the harmonics of error motions that are tried; 0: none.
    pub harmonic_orders: u8,
    /// Lack of fit is taken for real below this p value.
    pub lack_of_fit_limit: f64,
    /// A visit is left out if chance gives its residual with less than this p value in the whole set.
    pub doubtful_limit: f64,
    /// Least merit of the poses; below it a warning is given.
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

/// What each parameter means.
pub const PARAMETERS: [ParameterDoc; 14] = [
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
    ParameterDoc {
        name: "hold_ms",
        unit: "ms",
        description: "How long the end of a run waits for its last sphere.",
        range: Some((0.0, 60_000.0)),
    },
    ParameterDoc {
        name: "pose_repeatability_um",
        unit: "µm",
        description: "How far the sphere is off when the axes come back to a pose, 1 standard deviation.",
        range: Some((0.0, 100.0)),
    },
    ParameterDoc {
        name: "harmonic_orders",
        unit: "",
        description: "Greatest order of the harmonics of error motions that are tried; 0: none.",
        range: Some((0.0, 4.0)),
    },
    ParameterDoc {
        name: "lack_of_fit_limit",
        unit: "",
        description: "Lack of fit is taken for real below this p value.",
        range: Some((0.0, 0.5)),
    },
    ParameterDoc {
        name: "doubtful_limit",
        unit: "",
        description: "A visit is left out if chance gives its residual with less than this p value in the whole set.",
        range: Some((0.0, 0.1)),
    },
    ParameterDoc {
        name: "least_merit",
        unit: "",
        description: "Merit of the poses below which a warning is given.",
        range: Some((0.0, 100.0)),
    },
    ParameterDoc {
        name: "allowance.setup_um",
        unit: "µm",
        description: "Place of the probe's ball against the point that works, standard uncertainty in each direction.",
        range: Some((0.0, 1000.0)),
    },
    ParameterDoc {
        name: "allowance.linear_scale_um_per_m",
        unit: "µm/m",
        description: "Scale of each linear axis, standard uncertainty; where no model of them is known.",
        range: Some((0.0, 1000.0)),
    },
    ParameterDoc {
        name: "allowance.linear_squareness_urad",
        unit: "µrad",
        description: "Each squareness of the linear axes, standard uncertainty; where no model of them is known.",
        range: Some((0.0, 1000.0)),
    },
    ParameterDoc {
        name: "allowance.linear_error_um",
        unit: "µm",
        description: "Any other error of the linear axes, standard uncertainty in each direction; where no model of them is known.",
        range: Some((0.0, 1000.0)),
    },
    ParameterDoc {
        name: "allowance.linear_error_length_mm",
        unit: "mm",
        description: "Distance over which that error changes.",
        range: Some((1.0, 100_000.0)),
    },
    ParameterDoc {
        name: "allowance.motion_um",
        unit: "µm",
        description: "Each error motion of a rotary axis, standard deviation over a turn.",
        range: Some((0.0, 1000.0)),
    },
    ParameterDoc {
        name: "allowance.motion_urad",
        unit: "µrad",
        description: "Each turning error motion of a rotary axis, standard deviation over a turn.",
        range: Some((0.0, 1000.0)),
    },
];

impl RotaryAxesConfig {
    /// Checks every value against its range.
    pub(crate) fn check(&self) -> Result<(), RotaryAxesError> {
        let values = [
            f64::NAN,
            self.hold_ms,
            self.pose_repeatability_um,
            f64::from(self.harmonic_orders),
            self.lack_of_fit_limit,
            self.doubtful_limit,
            self.least_merit,
        ];
        let allowed = self.allowance.map(|allowance| {
            [
                allowance.setup_um,
                allowance.linear_scale_um_per_m,
                allowance.linear_squareness_urad,
                allowance.linear_error_um,
                allowance.linear_error_length_mm,
                allowance.motion_um,
                allowance.motion_urad,
            ]
        });
        let values = values.into_iter().chain(allowed.into_iter().flatten());
        for (doc, value) in PARAMETERS.iter().zip(values) {
            if let Some((least, greatest)) = doc.range
                && !(least..=greatest).contains(&value)
            {
                return Err(RotaryAxesError::OutOfRange {
                    name: doc.name,
                    value,
                    least,
                    greatest,
                });
            }
        }
        Ok(())
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
    fn the_readme_lists_every_parameter_with_its_default() {
        let readme = include_str!("../README.md");
        let defaults = ["\"\"", "1000.0", "0.0", "2", "0.01", "0.001", "1.0"];
        let defaults = defaults.into_iter().chain(["none"; 7]);
        for (doc, default) in PARAMETERS.iter().zip(defaults) {
            let unit = if doc.unit.is_empty() { "-" } else { doc.unit };
            let row = format!(
                "| `{}` | {unit} | {default} | {} |",
                doc.name, doc.description
            );
            assert!(readme.contains(&row), "{row}");
        }
    }

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
