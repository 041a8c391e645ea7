//! A budget that states nothing.

use std::collections::BTreeMap;

use super::{Body, Budget, Device, Instruments};

/// A device without uncertainty.
pub(super) const NO_DEVICE: Device = Device {
    expanded_uncertainty_um: 0.0,
    expanded_uncertainty_um_per_m: 0.0,
    coverage_factor: 2.0,
};
/// A body that does not expand.
pub(super) static NO_BODY: Body = Body {
    temperature_deviation_k: None,
    thermometers: Vec::new(),
    temperature_half_width_k: 0.0,
    expansion_um_per_m_k: 0.0,
    expansion_half_width_um_per_m_k: 0.0,
};

impl Budget {
    /// A budget without any term, for figures whose uncertainty is not stated.
    #[must_use]
    pub const fn nothing() -> Self {
        Self {
            grid_encoder: None,
            length_reference: None,
            machine: None,
            device: None,
            screws: BTreeMap::new(),
            length_error_period_um: None,
            mandrel: None,
            ballbar: None,
            plate: None,
            plate_squareness_urad: None,
            misalignment_mm: None,
            environmental_drift_um: None,
            environmental_unrest_um: None,
            angular_reference: None,
            length_corrected_by_instrument: false,
            instruments: Instruments::NONE,
            operator: None,
            warm_up: None,
        }
    }
}
