//! Three faces of each reference block, each where it lies along its own normal.
//!
//! # Model
//!
//! ```text
//!   position = mean over touches of (q_axis + n_axis r), at the mean of their instants   (1)
//!   u² = Σ u_independent² / N² + Σ_T (Σ_k s_k / N)² u²(T)                                (2)
//!   s_k = −n_axis f                                                                      (3)
//! ```
//!
//! The last term of (2) is common to all faces corrected by the same latency T: with value, uncertainty
//! and mean sensitivity (3) it is told beside the total. Where the latency changed among the touches of
//! one face, that is the last one's; what others leave counts as independent.
//!
//! q is the machine's own reading at contact, motor feedback with the compensation included: the
//! drift of a face is a change of this reading. A face that was not touched, or only by rejected
//! touches, is given as unknown and reported by name.

use machine::cycle::FeatureId;
use machine::file::BlockEntry;
use metrology::Axis;
use metrology::PerAxis;
use metrology::sample::{BlockMeasurement, FacePosition, LatencyShare};
use metrology::stamp::Span;

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
        if faces[axis].is_some() {
            at = at.max(usable.iter().map(|touch| touch.point.received_at).max());
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
    let (own, foreign_mm2) = common(axis, touches, last);
    let first = touches.first()?.point.received_at;
    let delays_s = touches
        .iter()
        .map(|touch| (touch.point.received_at - first).as_secs_f64());
    Some(FacePosition {
        position_mm: touches.iter().map(reading).sum::<f64>() / n, // (1)
        standard_uncertainty_mm: ((independent_mm2 + foreign_mm2).sqrt() / n)
            .hypot(own.standard_uncertainty_mm()), // (2)
        at: first + Span::from_secs_f64(delays_s.sum::<f64>() / n),
        latency: own,
    })
}

/// The share of the last touch's latency, and the squares of what the latencies of other touches leave
/// in the sum of all, mm².
fn common(axis: Axis, touches: &[&RunTouch], last: &RunTouch) -> (LatencyShare, f64) {
    let n = touches.len() as f64;
    let sensitivity_mm_s = |touch: &RunTouch| {
        -touch.point.approach[axis.index()] * touch.point.feed_mm_s // (3)
    };
    let is_own = |touch: &&&RunTouch| touch.latency == last.latency;
    let own = touches.iter().filter(is_own);
    let foreign = touches.iter().filter(|touch| !is_own(touch));
    let left_mm = |touch: &&RunTouch| {
        sensitivity_mm_s(touch) * touch.latency.map_or(0.0, |l| l.standard_uncertainty_s)
    };
    let latency = last.latency;
    let share = LatencyShare {
        latency_s: latency.map_or(0.0, |l| l.latency_s),
        standard_uncertainty_s: latency.map_or(0.0, |l| l.standard_uncertainty_s),
        sensitivity_mm_s: own.map(|touch| sensitivity_mm_s(touch)).sum::<f64>() / n,
    };
    (share, foreign.map(left_mm).map(|mm| mm * mm).sum())
}

pub(crate) fn count<T>(items: impl Iterator<Item = T>) -> u32 {
    u32::try_from(items.count()).unwrap_or(u32::MAX)
}
