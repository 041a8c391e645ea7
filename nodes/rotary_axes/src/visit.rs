//! One centre of a sphere at one pose of the rotary axes.

use machine::SphereDesign;
use metrology::PerAxis;
use nalgebra::{Matrix3, Vector3};

/// A probed centre.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereVisit {
    /// Name of the sphere.
    pub sphere: String,
    /// Rotary positions, rad.
    pub pose_rad: PerAxis<f64>,
    /// Centre as it was read, machine frame, mm.
    pub centre_mm: Vector3<f64>,
    /// Its covariance, mm².
    pub covariance_mm2: Matrix3<f64>,
    /// What the linear axes are known to add to the reading, machine frame, mm.
    pub known_mm: Vector3<f64>,
}

/// Rotary positions that are one pose, rad.
pub(crate) const ONE_POSE_RAD: f64 = 1e-3;

impl SphereVisit {
    /// Whether two visits are of one sphere at one pose.
    #[must_use]
    pub fn repeats(&self, other: &Self, design: &SphereDesign) -> bool {
        self.sphere == other.sphere
            && design
                .rotary_axes()
                .iter()
                .all(|&axis| (self.pose_rad[axis] - other.pose_rad[axis]).abs() < ONE_POSE_RAD)
    }
}
