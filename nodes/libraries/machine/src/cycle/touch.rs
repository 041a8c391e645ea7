//! Single points: one face of a block or the middle of a plane.

use std::num::NonZeroU32;

use metrology::sample::TestKind;
use nalgebra::Vector3;

use super::block::face_touch;
use super::program::{Path, Program, Touch};
use super::{Cycle, FeatureId};
use crate::error::CycleError;
use crate::file::{ArtefactEntry, MachineFile};

/// Touches each feature `repeats` times; a feature is `<block>.x|y|z` or the name of a plane.
///
/// # Errors
/// Unknown features or none, touches outside the travel or from below, feeds the stand-off does
/// not allow.
pub fn touches(
    file: &MachineFile,
    features: &[String],
    repeats: NonZeroU32,
) -> Result<Cycle, CycleError> {
    if features.is_empty() {
        return Err(CycleError::NothingToTouch {
            wanted: "feature in the request",
        });
    }
    let mut program = Program::new(file)?;
    for feature in features {
        program.name_feature(feature);
        let mut path = Path::Over;
        for _ in 0..repeats.get() {
            program.touch(single(file, feature)?, path)?;
            path = Path::Straight;
        }
    }
    Ok(program.finish(TestKind::Touch))
}

/// The touch of one face or of a plane's middle.
pub(super) fn single(file: &MachineFile, feature: &str) -> Result<Touch, CycleError> {
    let unknown = || CycleError::UnknownFeature {
        feature: feature.to_owned(),
        wanted: "block face or plane",
    };
    if let Some(FeatureId::Face { block, axis }) = FeatureId::parse(feature) {
        let block = file.blocks.iter().find(|entry| entry.id == block);
        return face_touch(file, block.ok_or_else(unknown)?, axis);
    }
    let name = feature.strip_suffix(".1").unwrap_or(feature);
    file.artefacts
        .iter()
        .find_map(|entry| match entry {
            ArtefactEntry::Plane {
                id,
                point_mm,
                normal,
                ..
            } if id == name => Some((point_mm, normal)),
            _ => None,
        })
        .ok_or_else(unknown)
        .and_then(|(point_mm, normal)| {
            let approach = -Vector3::from(*normal).normalize();
            if approach.z > 0.0 {
                return Err(CycleError::ApproachFromBelow {
                    feature: feature.to_owned(),
                });
            }
            let id = FeatureId::Point {
                artefact: name,
                index: 1,
            };
            let point_mm = Vector3::from(*point_mm);
            Ok(Touch::ordinary(file, id.to_string(), approach, point_mm))
        })
}
