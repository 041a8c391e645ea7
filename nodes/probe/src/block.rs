//! Three faces of each reference block, each where it lies along its own normal.
//!
//! # Model
//!
//! ```text
//!   position = mean over touches of (q_axis + n_axis r)                             (1)
//!   u² = Σ u_independent² / N² + u_common²                                          (2)
//! ```
//!
//! q is the machine's own reading at contact, motor feedback with the compensation included: the
//! drift of a face is a change of this reading. A face that was not touched, or only by rejected
//! touches, is given as unknown and reported by name.

use machine::cycle::FeatureId;
use machine::file::BlockEntry;
use metrology::Axis;
use metrology::PerAxis;
use metrology::sample::{BlockMeasurement, FacePosition};

use crate::diagnostic::Diagnostic;
use crate::run::{Run, RunTouch};
use crate::stage::Output;

/// Least cosine between approach and normal: 1°.
const ALONG_NORMAL: f64 = 0.999_848;

/// Evaluates one block at the end of its run.
pub(crate) fn evaluate(run: &Run, block: &BlockEntry, radius_mm: f64, out: &mut Vec<Output>) {
    let mut faces = PerAxis::from_fn(|_| None);
    let mut at = None;
    for axis in Axis::LINEAR {
        let touches: Vec<&RunTouch> = run
            .touches_of(|id| matches!(id, FeatureId::Face { block: name, axis: of } if name == block.id && of == axis))
            .collect();
        let usable = usable(run, block, axis, &touches, out);
        faces[axis] = face(axis, radius_mm, &usable);
        if let Some(face) = &faces[axis] {
            at = at.max(Some(face.at));
        } else {
            out.push(Output::Diagnostic(Diagnostic::FaceMissing {
                run: run.number(),
                block: block.id.clone(),
                axis,
                rejected: count(touches.iter().filter(|touch| !touch.is_usable())),
            }));
        }
    }
    out.push(Output::Block(BlockMeasurement {
        at: at.unwrap_or(run.segment.at),
        block_id: block.id.clone(),
        faces,
        cold: run.segment.cold,
        run: run.number(),
    }));
}

/// Touches that are not rejected and came along the face's normal.
fn usable<'a>(
    run: &Run,
    block: &BlockEntry,
    axis: Axis,
    touches: &[&'a RunTouch],
    out: &mut Vec<Output>,
) -> Vec<&'a RunTouch> {
    let inward = f64::from(block.approach_sign[axis.index()]);
    let mut usable = Vec::new();
    for touch in touches.iter().filter(|touch| touch.is_usable()) {
        let approach = &touch.point.approach;
        if approach[axis.index()] * inward >= ALONG_NORMAL {
            usable.push(*touch);
        } else {
            out.push(Output::Diagnostic(Diagnostic::FaceNotAlongNormal {
                run: run.number(),
                sequence: touch.point.sequence,
                block: block.id.clone(),
                axis,
                approach: [approach.x, approach.y, approach.z],
            }));
        }
    }
    usable
}

fn face(axis: Axis, radius_mm: f64, touches: &[&RunTouch]) -> Option<FacePosition> {
    let last = touches.last()?;
    let n = touches.len() as f64;
    let reading = |touch: &&RunTouch| {
        touch.point.axes_at_contact[axis] + touch.point.approach[axis.index()] * radius_mm
    };
    let independent_mm2: f64 = touches
        .iter()
        .map(|touch| touch.uncertainty.independent_mm.powi(2))
        .sum();
    let common_mm: f64 = touches.iter().map(|t| t.uncertainty.common_mm).sum();
    Some(FacePosition {
        position_mm: touches.iter().map(reading).sum::<f64>() / n, // (1)
        standard_uncertainty_mm: (independent_mm2.sqrt() / n).hypot(common_mm / n), // (2)
        at: last.point.received_at,
    })
}

pub(crate) fn count<T>(items: impl Iterator<Item = T>) -> u32 {
    u32::try_from(items.count()).unwrap_or(u32::MAX)
}
