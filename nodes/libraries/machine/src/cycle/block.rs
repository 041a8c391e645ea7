//! Three faces of each reference block, each touched only along its own normal near the corner.

use std::num::NonZeroU32;

use metrology::Axis;
use metrology::sample::TestKind;
use nalgebra::Vector3;

use super::program::{Path, Program, Touch};
use super::{Cycle, FeatureId};
use crate::error::CycleError;
use crate::file::{BlockEntry, MachineFile};

/// Touches the X, Y and Z face of each block `repeats` times; `ids` empty: all blocks.
///
/// # Errors
/// Unknown or missing blocks, touches outside the travel or from below, feeds the stand-off does
/// not allow.
pub fn blocks(
    file: &MachineFile,
    ids: &[String],
    repeats: NonZeroU32,
) -> Result<Cycle, CycleError> {
    let mut program = Program::new(file)?;
    for block in chosen(file, ids)? {
        program.name_feature(&block.id);
        let mut path = Path::Over;
        for axis in Axis::LINEAR {
            for _ in 0..repeats.get() {
                program.touch(face_touch(file, block, axis)?, path)?;
                path = Path::Straight;
            }
            path = Path::LowOver(low_height_mm(file, block));
        }
    }
    Ok(program.finish(TestKind::Block))
}

/// Height of the ball's centre that clears a block's top by the ball and two stand-offs, mm.
pub(super) fn low_height_mm(file: &MachineFile, block: &BlockEntry) -> f64 {
    let ball_mm = file.ball_radius_mm();
    block.corner_mm[2] + ball_mm + 2.0 * file.probe.standoff_mm
}

/// The touch of one face: `inset_mm` along the two other axes from the corner.
pub(super) fn face_touch(
    file: &MachineFile,
    block: &BlockEntry,
    axis: Axis,
) -> Result<Touch, CycleError> {
    let feature_id = FeatureId::Face {
        block: &block.id,
        axis,
    }
    .to_string();
    if block.approach_sign[2] > 0 {
        return Err(CycleError::ApproachFromBelow {
            feature: feature_id,
        });
    }
    let inward = Vector3::from(block.approach_sign.map(f64::from));
    let mut contact_mm = Vector3::from(block.corner_mm) + inward * block.inset_mm;
    contact_mm[axis.index()] = block.corner_mm[axis.index()];
    let mut approach = Vector3::zeros();
    approach[axis.index()] = inward[axis.index()];
    Ok(Touch::ordinary(file, feature_id, approach, contact_mm))
}

fn chosen<'a>(file: &'a MachineFile, ids: &[String]) -> Result<Vec<&'a BlockEntry>, CycleError> {
    let wanted = "block";
    if file.blocks.is_empty() {
        return Err(CycleError::NothingToTouch { wanted });
    }
    if ids.is_empty() {
        return Ok(file.blocks.iter().collect());
    }
    ids.iter()
        .map(|id| {
            file.blocks
                .iter()
                .find(|block| block.id == *id)
                .ok_or_else(|| CycleError::UnknownFeature {
                    feature: id.clone(),
                    wanted,
                })
        })
        .collect()
}
