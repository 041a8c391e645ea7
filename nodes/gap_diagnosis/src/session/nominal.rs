//! How far a touch was latched beyond the surface that the machine file describes.
//!
//! With the ball's centre b and the approach n in the workpiece frame, the ball's radius r, and a feature
//! of the machine file:
//!
//! ```text
//!   face, plane through p     d = (b + r n - p) . n                       (1)
//!   bore of centre c, radius R        d = (b - c) . n - (R - r)           (2)
//!   boss, sphere              d = (b - c) . n + (R + r)                   (3)
//! ```
//!
//! (2) and (3) hold to first order of the distance at which the approach passes the centre.

use machine::cycle::{FeatureId, artefact_id};
use machine::file::ArtefactEntry;
use machine::{Kinematics, MachineFile};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

/// Deviation (1) to (3) along the approach, mm; none for a feature that the file does not have.
pub(super) fn beyond_surface_mm(
    machine: &MachineFile,
    kinematics: &Kinematics,
    feature: &str,
    latched: &PerAxis<f64>,
    approach_in_machine: &Vector3<f64>,
) -> Option<f64> {
    let ball_mm = kinematics.ball_in_workpiece_mm(latched);
    let approach = kinematics.direction_in_workpiece(latched, approach_in_machine);
    let radius_mm = machine.ball_radius_mm();
    let beyond_face = |point: &[f64; 3]| {
        Some((ball_mm + approach * radius_mm - Vector3::from(*point)).dot(&approach))
    };
    let artefact = |id: &str| machine.artefacts.iter().find(|a| artefact_id(a) == id);
    let entry = match FeatureId::parse(feature) {
        Some(FeatureId::Face { block, .. }) => {
            let block = machine.blocks.iter().find(|entry| entry.id == block)?;
            return beyond_face(&block.corner_mm);
        }
        Some(FeatureId::Point { artefact: id, .. }) => artefact(id)?,
        None => artefact(feature)?,
    };
    let from = |centre: &[f64; 3]| (ball_mm - Vector3::from(*centre)).dot(&approach);
    match entry {
        ArtefactEntry::Plane { point_mm, .. } => beyond_face(point_mm),
        ArtefactEntry::Bore {
            centre_mm,
            radius_mm: of,
            ..
        } => Some(from(centre_mm) - (of - radius_mm)),
        ArtefactEntry::Boss {
            centre_mm,
            radius_mm: of,
            ..
        }
        | ArtefactEntry::Sphere {
            centre_mm,
            radius_mm: of,
            ..
        } => Some(from(centre_mm) + of + radius_mm),
    }
}

/// Where the axes stood when a face of a block was measured, for bags that hold block measurements but no
/// touches: feature, approach, positions.
pub(super) fn face(
    machine: &MachineFile,
    block_id: &str,
    axis: Axis,
    position_mm: f64,
) -> Option<(String, Vector3<f64>, PerAxis<f64>)> {
    let block = machine.blocks.iter().find(|entry| entry.id == block_id)?;
    let sign = f64::from(*block.approach_sign.get(axis.index())?);
    let mut approach = Vector3::zeros();
    approach[axis.index()] = sign;
    let mut positions = PerAxis::default();
    for other in Axis::LINEAR {
        let k = other.index();
        positions[other] = if other == axis {
            position_mm - sign * machine.ball_radius_mm()
        } else {
            block.corner_mm[k] + f64::from(block.approach_sign[k]) * block.inset_mm
        };
    }
    let feature = FeatureId::Face {
        block: block_id,
        axis,
    };
    Some((feature.to_string(), approach, positions))
}
