//! The numbers of a budget by their keys, which limits are kept by.

use super::{Ballbar, Body, Budget, Device};

/// Keys of a device.
type OfDevice = [&'static str; 2];
/// Keys of a body, in the order of [`Body::numbers`].
type OfBody = [&'static str; 3];

const GRID_ENCODER: OfDevice = [
    "grid_encoder.expanded_uncertainty_um",
    "grid_encoder.expanded_uncertainty_um_per_m",
];
const LENGTH_REFERENCE: OfDevice = [
    "length_reference.expanded_uncertainty_um",
    "length_reference.expanded_uncertainty_um_per_m",
];
const MACHINE: OfBody = [
    "machine.temperature_half_width_k",
    "machine.expansion_um_per_m_k",
    "machine.expansion_half_width_um_per_m_k",
];
const DEVICE: OfBody = [
    "device.temperature_half_width_k",
    "device.expansion_um_per_m_k",
    "device.expansion_half_width_um_per_m_k",
];
const PLATE: OfBody = [
    "plate.temperature_half_width_k",
    "plate.expansion_um_per_m_k",
    "plate.expansion_half_width_um_per_m_k",
];

type Number = (&'static str, f64);

fn of_device(keys: OfDevice, device: Option<&Device>) -> impl Iterator<Item = Number> {
    let values = device.map(|one| {
        [
            one.expanded_uncertainty_um,
            one.expanded_uncertainty_um_per_m,
        ]
    });
    keys.into_iter().zip(values.into_iter().flatten())
}

fn of_body(keys: OfBody, body: Option<&Body>) -> impl Iterator<Item = Number> {
    let values = body.map(|one| one.numbers().map(|(_, value)| value));
    keys.into_iter().zip(values.into_iter().flatten())
}

impl Budget {
    /// The numbers of the angular reference.
    fn numbers_of_angles(&self) -> impl Iterator<Item = Number> {
        let all = self.angular_reference.iter().flat_map(|one| {
            [
                (
                    "angular_reference.expanded_uncertainty_arcsec",
                    Some(one.expanded_uncertainty_arcsec),
                ),
                (
                    "angular_reference.environmental_drift_arcsec",
                    Some(one.environmental_drift_arcsec),
                ),
                (
                    "angular_reference.environmental_unrest_arcsec",
                    one.environmental_unrest_arcsec,
                ),
            ]
        });
        all.filter_map(|(key, value)| Some((key, value?)))
    }

    /// Every number that is stated.
    pub(super) fn numbers(&self) -> Vec<Number> {
        let single = [
            ("misalignment_mm", self.misalignment_mm),
            ("environmental_drift_um", self.environmental_drift_um),
            ("environmental_unrest_um", self.environmental_unrest_um),
            ("plate_squareness_urad", self.plate_squareness_urad),
        ];
        let single = single
            .into_iter()
            .filter_map(|(key, value)| Some((key, value?)));
        of_device(GRID_ENCODER, self.grid_encoder.as_ref())
            .chain(of_device(LENGTH_REFERENCE, self.length_reference.as_ref()))
            .chain(of_body(MACHINE, self.machine.as_ref()))
            .chain(of_body(DEVICE, self.device.as_ref()))
            .chain(of_body(PLATE, self.plate.as_ref()))
            .chain(single)
            .chain(self.numbers_of_angles())
            .chain(self.ballbar.iter().flat_map(Ballbar::numbers))
            .chain(self.numbers_of_drift_test())
            .collect()
    }
}
