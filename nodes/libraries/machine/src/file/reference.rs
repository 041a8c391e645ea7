//! Grid encoder and length reference of the machine file: measuring devices that are put in place for a test.

use std::collections::BTreeSet;

use metrology::Axis;
use metrology::sample::TestPlane;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Check;
use crate::error::MachineFileError;

/// A grid encoder: one plate, one head, and the places where the plate is put.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridEncoderEntry {
    /// Radius of the plate's usable field.
    pub radius_mm: f64,
    /// Resolution.
    pub resolution_um: f64,
    /// Placements of the plate.
    pub placements: Vec<GridPlacement>,
}

/// One placement of a grid encoder's plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridPlacement {
    /// Name.
    pub id: String,
    /// Plane in which it lies or stands.
    pub plane: GridPlane,
    /// Centre of the plate, machine frame with every axis at zero.
    pub centre_mm: [f64; 3],
    /// From the point that the axis positions name to the head's measuring point.
    pub tool_offset_mm: [f64; 3],
}

/// Plane of a placement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "the planes of G17, G19 and G18")]
pub enum GridPlane {
    Xy,
    Yz,
    Zx,
}

impl GridPlane {
    /// First and second axis of the plane, then its normal.
    #[must_use]
    pub const fn axes(self) -> [Axis; 3] {
        match self {
            Self::Xy => [Axis::X, Axis::Y, Axis::Z],
            Self::Yz => [Axis::Y, Axis::Z, Axis::X],
            Self::Zx => [Axis::Z, Axis::X, Axis::Y],
        }
    }
}

impl From<GridPlane> for TestPlane {
    fn from(plane: GridPlane) -> Self {
        match plane {
            GridPlane::Xy => Self::Xy,
            GridPlane::Yz => Self::Yz,
            GridPlane::Zx => Self::Zx,
        }
    }
}

impl GridPlacement {
    /// Axis positions at which the head stands over the plate's centre, mm.
    #[must_use]
    pub fn axes_at_centre_mm(&self) -> Vector3<f64> {
        Vector3::from(self.centre_mm) - Vector3::from(self.tool_offset_mm)
    }
}

/// A laser interferometer or other reference of length along straight beams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LengthReferenceEntry {
    /// Resolution.
    pub resolution_um: f64,
    /// The beams along which it is put up.
    pub beams: Vec<BeamEntry>,
}

/// One beam; readings grow from its beginning to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BeamEntry {
    /// Name.
    pub id: String,
    /// Axis positions at its beginning.
    pub from_mm: [f64; 3],
    /// Axis positions at its end.
    pub to_mm: [f64; 3],
    /// From the point that the axis positions name to the reflector.
    pub tool_offset_mm: [f64; 3],
}

impl BeamEntry {
    /// Unit vector along it.
    #[must_use]
    pub fn direction(&self) -> Vector3<f64> {
        (Vector3::from(self.to_mm) - Vector3::from(self.from_mm)).normalize()
    }

    /// The axis along which it advances most.
    #[must_use]
    pub fn main_axis(&self) -> Axis {
        Axis::LINEAR[self.direction().iamax()]
    }

    /// Its axis, where it runs along one alone.
    #[must_use]
    pub fn axis(&self) -> Option<Axis> {
        let axis = self.main_axis();
        let mut others = Axis::LINEAR.iter().filter(|other| **other != axis);
        let same = |other: &Axis| {
            (self.to_mm[other.index()] - self.from_mm[other.index()]).abs() < SAME_MM
        };
        others.all(same).then_some(axis)
    }
}

/// Coordinates closer than this are the same, mm.
const SAME_MM: f64 = 1e-9;
/// Least length of a beam, mm.
const SHORTEST_BEAM_MM: f64 = 1.0;

/// Checks both entries.
pub(super) fn check(
    check: &Check<'_>,
    grid: Option<&GridEncoderEntry>,
    length: Option<&LengthReferenceEntry>,
) -> Result<(), MachineFileError> {
    let mut ids = BTreeSet::new();
    if let Some(grid) = grid {
        for (index, placement) in grid.placements.iter().enumerate() {
            let key = format!("grid_encoder.placements[{index}]");
            check.new_id(&format!("{key}.id"), &placement.id, &mut ids)?;
        }
    }
    if let Some(length) = length {
        for (index, beam) in length.beams.iter().enumerate() {
            let key = format!("length_reference.beams[{index}]");
            check.new_id(&format!("{key}.id"), &beam.id, &mut ids)?;
            let length_mm = (Vector3::from(beam.to_mm) - Vector3::from(beam.from_mm)).norm();
            let rule = "is its length, which must be at least 1 mm";
            check.number(&key, length_mm, length_mm >= SHORTEST_BEAM_MM, rule)?;
        }
    }
    Ok(())
}
