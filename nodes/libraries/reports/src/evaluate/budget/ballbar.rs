//! What a budget states of a ballbar.

use iso230::budget::DeviceUncertainty;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Body, Budget, Device};

/// Coverage factor of the plate's squareness, as in the certificate and in the parameters of `grid_encoder`.
const OF_SQUARENESS: f64 = 2.0;

/// A ballbar, as its certificate states it.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ballbar {
    /// Constant part of the expanded uncertainty of one reading.
    expanded_uncertainty_um: f64,
    /// Part that grows with what is read, some µm: without weight.
    expanded_uncertainty_um_per_m: f64,
    /// Coverage factor of both.
    coverage_factor: f64,
    /// Uncertainty of its calibrated length; where absent, F and D have no uncertainty and are not corrected to 20 °C.
    #[serde(default)]
    length: Option<Device>,
    /// Its own body; where absent, F and D are not corrected to 20 °C.
    #[serde(default)]
    body: Option<Body>,
}

impl Ballbar {
    fn reading(&self) -> Device {
        Device {
            expanded_uncertainty_um: self.expanded_uncertainty_um,
            expanded_uncertainty_um_per_m: self.expanded_uncertainty_um_per_m,
            coverage_factor: self.coverage_factor,
        }
    }

    /// Coverage factors by their keys.
    pub(super) fn factors(&self) -> [(&'static str, Option<f64>); 2] {
        let of_length = self.length.map(|length| length.coverage_factor);
        [
            ("ballbar", Some(self.coverage_factor)),
            ("ballbar.length", of_length),
        ]
    }

    pub(super) const fn body(&self) -> Option<&Body> {
        self.body.as_ref()
    }

    /// Its numbers by their keys.
    pub(super) fn numbers(&self) -> Vec<(&'static str, f64)> {
        let mut numbers = vec![
            (
                "ballbar.expanded_uncertainty_um",
                self.expanded_uncertainty_um,
            ),
            (
                "ballbar.expanded_uncertainty_um_per_m",
                self.expanded_uncertainty_um_per_m,
            ),
        ];
        if let Some(length) = &self.length {
            numbers.extend([
                (
                    "ballbar.length.expanded_uncertainty_um",
                    length.expanded_uncertainty_um,
                ),
                (
                    "ballbar.length.expanded_uncertainty_um_per_m",
                    length.expanded_uncertainty_um_per_m,
                ),
            ]);
        }
        if let Some(body) = &self.body {
            numbers.extend([
                (
                    "ballbar.body.temperature_half_width_k",
                    body.temperature_half_width_k,
                ),
                (
                    "ballbar.body.expansion_um_per_m_k",
                    body.expansion_um_per_m_k,
                ),
                (
                    "ballbar.body.expansion_half_width_um_per_m_k",
                    body.expansion_half_width_um_per_m_k,
                ),
            ]);
        }
        numbers
    }
}

impl Budget {
    /// With the ballbar in the place of the grid encoder, its own body in that of the device's; none where the budget states no
    /// ballbar. No other instrument's entry counts for it, and it corrects nothing to 20 °C itself.
    #[must_use]
    pub fn of_ballbar(&self) -> Option<Self> {
        let ballbar = self.ballbar.as_ref()?;
        let mut own = self.clone();
        own.grid_encoder = Some(ballbar.reading());
        if let Some(body) = &ballbar.body {
            own.device = Some(body.clone());
        }
        Some(own)
    }

    /// Uncertainty of the ballbar's calibrated length, where it is stated.
    #[must_use]
    pub fn ballbar_length(&self) -> Option<DeviceUncertainty> {
        let length = self.ballbar.as_ref()?.length?;
        Some(length.inner())
    }

    /// Whether temperature and expansion of the ballbar are stated.
    #[must_use]
    pub fn has_ballbar_body(&self) -> bool {
        self.ballbar.as_ref().is_some_and(|one| one.body.is_some())
    }

    /// Standard uncertainty of the angle between the axes of the plate, where it is stated, rad.
    #[must_use]
    pub fn plate_squareness_rad(&self) -> Option<f64> {
        let expanded_urad = self.plate_squareness_urad?;
        Some(expanded_urad * 1e-6 / OF_SQUARENESS)
    }
}
