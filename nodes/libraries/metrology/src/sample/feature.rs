//! A shape fitted to probed points.

use nalgebra::{Matrix3, Vector3};

use crate::axis::{AxisSet, PerAxis};
use crate::stamp::{Host, Stamp};

/// Which shape was fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeatureKind {
    /// A flat face.
    Plane,
    /// A circle touched from inside.
    Bore,
    /// A circle touched from outside.
    Boss,
    /// A sphere.
    Sphere,
}

/// A plane, bore, boss or sphere fitted to the corrected points of one run, machine frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbedFeature {
    /// When its last point was touched.
    pub at: Stamp<Host>,
    /// Name of the artefact in the machine file.
    pub feature_id: String,
    /// Shape.
    pub kind: FeatureKind,
    /// Centre, mm; of a plane: the middle of its points.
    pub centre_mm: Vector3<f64>,
    /// Covariance of the centre, mm²; of a plane: along its normal only.
    pub centre_covariance_mm2: Matrix3<f64>,
    /// Outward normal of a plane, axis of a bore or boss; zero for a sphere.
    pub normal: Vector3<f64>,
    /// Standard uncertainty of the normal's direction, the larger of two, rad; NaN: not estimated.
    pub normal_standard_uncertainty_rad: f64,
    /// Radius, mm; NaN for a plane.
    pub radius_mm: f64,
    /// Standard uncertainty of the radius, mm; NaN for a plane.
    pub radius_standard_uncertainty_mm: f64,
    /// Greatest minus least distance of the points from the fitted shape, mm.
    pub form_mm: f64,
    /// Points used.
    pub n: u32,
    /// Points that were rejected.
    pub n_rejected: u32,
    /// The run (see `TestSegment`) in which it was measured.
    pub run: u32,
    /// Rotary axes that the machine has.
    pub rotary_axes: AxisSet,
    /// Their mean positions while it was touched, rad; zero for every other axis.
    pub rotary_rad: PerAxis<f64>,
}
