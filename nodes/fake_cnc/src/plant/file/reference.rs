//! Measuring devices of the plant file: scales, the grid encoder's plate and head, the laser.

use serde::{Deserialize, Serialize};

/// Every linear scale alike; each axis has errors of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearScalesEntry {
    /// Standard deviation from which the errors of the graduation are drawn.
    pub graduation_um: f64,
    /// Longest wave of the graduation's errors.
    pub graduation_length_mm: f64,
    /// Period of the signal.
    pub signal_period_um: f64,
    /// Amplitude of the error within one period.
    pub interpolation_um: f64,
}

/// The grid encoder as it really is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridPlateEntry {
    /// How far the head may be from the plate's nominal height and still read.
    pub gap_tolerance_mm: f64,
    /// Standard deviation of the plate's centre from its nominal place, per direction and mounting.
    pub placement_um: f64,
    /// Standard deviation of the plate's turn in its plane, per mounting.
    pub rotation_urad: f64,
    /// Standard deviation of the graduation's own errors, per direction.
    pub plate_error_um: f64,
    /// Shortest wave of the graduation's errors.
    pub plate_error_length_mm: f64,
    /// By how much the graduation is too long, per length: it then reads too little.
    #[serde(default)]
    pub plate_scale_um_per_m: f64,
    /// By how much the angle between its lines along u and v is less than a right one.
    #[serde(default)]
    pub plate_squareness_urad: f64,
    /// Standard deviation of one reading.
    pub head_noise_um: f64,
}

/// The laser interferometer as it really is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaserEntry {
    /// From the beam splitter to the beam's beginning.
    pub dead_path_mm: f64,
    /// Error of the assumed wavelength at the start, relative to it.
    pub wavelength_error_ppm: f64,
    /// Drift of the wavelength that is not compensated.
    pub wavelength_drift_ppm_per_h: f64,
    /// Standard deviation of the beam's direction, per mounting and direction across it.
    pub misalignment_urad: f64,
    /// Standard deviation of one reading.
    pub noise_um: f64,
    /// How far the reflector may stray from the beam and still send it back.
    pub beam_radius_mm: f64,
}
