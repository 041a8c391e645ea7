//! What is not known about the measurements of a bag: `budget.yaml`, in the units of data sheets.
//!
//! Nothing in it has a default: a term that is left out would be an uncertainty of zero.

use std::path::Path;

use anyhow::{Result, anyhow, bail};
use metrology::iso230::budget::{DeviceUncertainty, Expansion};
use metrology::iso230::circular::CircularBudget;
use metrology::iso230::positioning::budget::PositioningBudget;
use node_runtime::complaint;
use serde::Deserialize;

/// Uncertainty of a measuring device, as its certificate states it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Device {
    /// Constant part.
    expanded_uncertainty_um: f64,
    /// Part that grows with the length.
    expanded_uncertainty_um_per_m: f64,
    /// Coverage factor of both.
    coverage_factor: f64,
}

/// Temperature and expansion of a body.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Body {
    temperature_deviation_k: f64,
    temperature_half_width_k: f64,
    expansion_um_per_m_k: f64,
    expansion_half_width_um_per_m_k: f64,
}

/// `budget.yaml`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Plate and head, for circles.
    grid_encoder: Device,
    /// Interferometer, tracker or step gauge, or the scales where they measured.
    length_reference: Device,
    /// The machine, or the workpiece that lengths are corrected to.
    machine: Body,
    /// The device's own body; coefficient 0 for an interferometer.
    device: Body,
    /// By how much beam and axis can part sideways over the measured length.
    misalignment_mm: f64,
    /// Range of a reading with the axes at rest, as long as a test takes.
    environmental_drift_um: f64,
}

impl Device {
    fn inner(&self) -> DeviceUncertainty {
        DeviceUncertainty {
            expanded_uncertainty_mm: self.expanded_uncertainty_um * 1e-3,
            expanded_uncertainty_per_length: self.expanded_uncertainty_um_per_m * 1e-6,
            coverage_factor: self.coverage_factor,
        }
    }
}

impl Body {
    fn inner(&self) -> Expansion {
        Expansion {
            temperature_deviation_k: self.temperature_deviation_k,
            temperature_half_width_k: self.temperature_half_width_k,
            expansion_per_k: self.expansion_um_per_m_k * 1e-6,
            expansion_half_width_per_k: self.expansion_half_width_um_per_m_k * 1e-6,
        }
    }
}

impl Budget {
    /// Reads the text of a budget file; `place` names it in errors.
    ///
    /// # Errors
    /// With key and value where one is missing, unknown or no number above zero where it must be.
    pub fn read(text: &str, place: &Path) -> Result<Self> {
        let place = place.display();
        let budget: Self = serde_saphyr::from_str(text).map_err(|error| {
            anyhow!("budget file {place}: {}", complaint::of_yaml(&error, text))
        })?;
        for (key, device) in [
            ("grid_encoder", &budget.grid_encoder),
            ("length_reference", &budget.length_reference),
        ] {
            let factor = device.coverage_factor;
            if !(factor.is_finite() && factor > 0.0) {
                bail!("{place}: {key}.coverage_factor = {factor}: must be finite and above 0");
            }
        }
        for (key, value) in budget.numbers() {
            if !(value.is_finite() && value >= 0.0) {
                bail!("{place}: {key} = {value}: must be finite and not below 0");
            }
        }
        Ok(budget)
    }

    fn numbers(&self) -> Vec<(&'static str, f64)> {
        let Self {
            grid_encoder: grid,
            length_reference: length,
            machine,
            device,
            ..
        } = self;
        vec![
            (
                "grid_encoder.expanded_uncertainty_um",
                grid.expanded_uncertainty_um,
            ),
            (
                "grid_encoder.expanded_uncertainty_um_per_m",
                grid.expanded_uncertainty_um_per_m,
            ),
            (
                "length_reference.expanded_uncertainty_um",
                length.expanded_uncertainty_um,
            ),
            (
                "length_reference.expanded_uncertainty_um_per_m",
                length.expanded_uncertainty_um_per_m,
            ),
            (
                "machine.temperature_half_width_k",
                machine.temperature_half_width_k,
            ),
            ("machine.expansion_um_per_m_k", machine.expansion_um_per_m_k),
            (
                "machine.expansion_half_width_um_per_m_k",
                machine.expansion_half_width_um_per_m_k,
            ),
            (
                "device.temperature_half_width_k",
                device.temperature_half_width_k,
            ),
            ("device.expansion_um_per_m_k", device.expansion_um_per_m_k),
            (
                "device.expansion_half_width_um_per_m_k",
                device.expansion_half_width_um_per_m_k,
            ),
            ("misalignment_mm", self.misalignment_mm),
            ("environmental_drift_um", self.environmental_drift_um),
        ]
    }

    /// For ISO 230-2 and 230-6.
    #[must_use]
    pub fn positioning(&self) -> PositioningBudget {
        PositioningBudget {
            device: self.length_reference.inner(),
            misalignment_mm: self.misalignment_mm,
            machine: self.machine.inner(),
            device_expansion: self.device.inner(),
            environmental_drift_mm: self.environmental_drift_um * 1e-3,
        }
    }

    /// For ISO 230-4.
    #[must_use]
    pub fn circular(&self) -> CircularBudget {
        CircularBudget {
            displacement: self.grid_encoder.inner(),
            length: self.grid_encoder.inner(),
            expansion: self.machine.inner(),
            environmental_drift_mm: self.environmental_drift_um * 1e-3,
        }
    }

    /// A budget without any term, for figures whose uncertainty is not stated.
    #[must_use]
    pub const fn nothing() -> Self {
        const DEVICE: Device = Device {
            expanded_uncertainty_um: 0.0,
            expanded_uncertainty_um_per_m: 0.0,
            coverage_factor: 2.0,
        };
        const BODY: Body = Body {
            temperature_deviation_k: 0.0,
            temperature_half_width_k: 0.0,
            expansion_um_per_m_k: 0.0,
            expansion_half_width_um_per_m_k: 0.0,
        };
        Self {
            grid_encoder: DEVICE,
            length_reference: DEVICE,
            machine: BODY,
            device: BODY,
            misalignment_mm: 0.0,
            environmental_drift_um: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: &str = "
grid_encoder: {expanded_uncertainty_um: 0.6, expanded_uncertainty_um_per_m: 1.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 0.5, temperature_half_width_k: 0.5, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.6
";

    fn refusal(from: &str, to: &str) -> String {
        assert!(WHOLE.contains(from));
        let text = WHOLE.replacen(from, to, 1);
        let error = Budget::read(&text, Path::new("budget.yaml")).unwrap_err();
        format!("{error:#}")
    }

    #[test]
    fn a_data_sheet_becomes_mm_and_ratios() {
        let budget = Budget::read(WHOLE, Path::new("budget.yaml")).unwrap();
        let device = budget.positioning().device;
        assert!((device.expanded_uncertainty_mm - 1e-4).abs() < 1e-18);
        assert!((device.expanded_uncertainty_per_length - 5e-7).abs() < 1e-18);
        assert!((budget.circular().environmental_drift_mm - 6e-4).abs() < 1e-18);
    }

    #[test]
    fn a_wrong_budget_is_refused_with_key_and_value() {
        assert!(
            refusal("misalignment_mm: 0.1", "misalignment_mm: -0.1")
                .contains("misalignment_mm = -0.1: must be finite and not below 0")
        );
        assert!(
            refusal("misalignment_mm: 0.1", "misalignment_um: 0.1").contains("misalignment_um")
        );
        assert!(refusal("misalignment_mm: 0.1\n", "").contains("misalignment_mm"));
        assert!(
            refusal("coverage_factor: 2.0", "coverage_factor: 0.0")
                .contains("grid_encoder.coverage_factor = 0")
        );
    }
}
