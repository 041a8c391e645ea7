//! Temperatures and external position references.

use crate::axis::Axis;
use crate::stamp::{Host, Stamp};

/// One reading of a temperature sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureSample {
    /// When it was read.
    pub at: Stamp<Host>,
    /// Sensor name in the machine file.
    pub sensor: String,
    /// Reading, °C.
    pub temperature_degc: f64,
    /// Variance, K²; zero: unknown.
    pub variance_k2: f64,
}

/// One reading of a grid encoder: position of the head over the plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSample {
    /// When it was read.
    pub at: Stamp<Host>,
    /// Plane of the plate.
    pub plane: super::TestPlane,
    /// First coordinate of the plane (X in XY, Y in YZ, Z in ZX), mm.
    pub u_mm: f64,
    /// Second coordinate, mm.
    pub v_mm: f64,
    /// Changes whenever the encoder is zeroed anew.
    pub zero_id: u32,
}

/// One reading of an angular reference of a rotary axis (polygon and autocollimator, rotary indexer).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleSample {
    /// When it was read.
    pub at: Stamp<Host>,
    /// Rotary axis whose position it measures.
    pub axis: Axis,
    /// Angle in the sense of the axis, rad.
    pub angle_rad: f64,
    /// Changes whenever the reference is zeroed anew.
    pub zero_id: u32,
}

/// How long a message may come after those of other topics with its stamp, s.
pub const LATE_S: f64 = 2.0;
/// Largest credible distance of a reading from its nominal value, mm, rad or K.
pub const FARTHEST_FROM_NOMINAL: f64 = 1e4;

/// One reading of a length reference (interferometer, tracker, step gauge).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthSample {
    /// When it was read.
    pub at: Stamp<Host>,
    /// Axis along which it measures, or along which a slanting beam advances most.
    pub axis: Axis,
    /// Displacement along the beam, mm.
    pub displacement_mm: f64,
    /// Changes whenever the reference is zeroed anew.
    pub zero_id: u32,
}
