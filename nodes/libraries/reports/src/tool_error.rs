//! The tool error over the blocks' span, against the plant's truth.
//!
//! Thermal compensation answers for the *change* of the error since the cold reference, so the
//! cold verification is subtracted pose by pose; the geometric error that is there when cold stays
//! out of the judgement and is shown beside it.
//!
//! It is judged at the poses inside the span of the reference blocks, in X, Y and Z: elsewhere the drift
//! is extrapolated. A face of a block may lie off its nominal place, so a pose within 0.5 mm of the span
//! counts as inside.
//!
//! What is left is split by least squares over the poses r (about their mean r0):
//!
//! ```text
//!   e(r) = t + diag(s) (r - r0) + G (r - r0) + rest,   G without diagonal      (1)
//! ```
//!
//! t is what all poses share, s what two blocks can see besides it, G rotations and shears that two
//! blocks on one diagonal cannot tell from s, the rest is curved (hot zone, bending).

use metrology::Axis;
use metrology::sample::BlockMeasurement;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::evidence::{PoseError, Verification};

/// Errors of one verification, changed since the cold one.
#[derive(Clone, Debug)]
pub struct ToolError {
    /// Label of the verification.
    pub label: String,
    /// Change since cold at every pose, inside the span or not.
    pub change: Vec<PoseError>,
    /// Poses inside the span.
    pub n_inside: usize,
    /// 95 % quantile of the size of the change inside the span, mm.
    pub change_p95_mm: f64,
    /// Greatest size of the change inside the span, mm.
    pub change_max_mm: f64,
    /// 95 % quantile of the whole error inside the span, cold error included, mm.
    pub whole_p95_mm: f64,
    /// Root mean square of each part of (1) inside the span, mm.
    pub parts: Parts,
}

/// The box between the outermost faces of the reference blocks, machine frame, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlocksSpan {
    /// Least X, Y, Z.
    pub low_mm: Vector3<f64>,
    /// Greatest X, Y, Z.
    pub high_mm: Vector3<f64>,
}

/// How far a face may lie off its nominal place, mm.
const PLACEMENT_MM: f64 = 0.5;

impl BlocksSpan {
    /// Of what was measured of the blocks; `None` when an axis has no two faces apart.
    pub fn of(blocks: &[BlockMeasurement]) -> Option<Self> {
        let mut low_mm = Vector3::repeat(f64::INFINITY);
        let mut high_mm = Vector3::repeat(f64::NEG_INFINITY);
        for block in blocks {
            for (row, axis) in Axis::LINEAR.into_iter().enumerate() {
                if let Some(face) = block.faces[axis] {
                    low_mm[row] = low_mm[row].min(face.position_mm);
                    high_mm[row] = high_mm[row].max(face.position_mm);
                }
            }
        }
        let is_box = (0..3).all(|row| high_mm[row] - low_mm[row] > PLACEMENT_MM);
        is_box.then_some(Self { low_mm, high_mm })
    }

    /// Whether a place is inside.
    pub fn holds(&self, place_mm: &Vector3<f64>) -> bool {
        (0..3).all(|row| {
            let (low_mm, high_mm) = (self.low_mm[row], self.high_mm[row]);
            (low_mm - PLACEMENT_MM..=high_mm + PLACEMENT_MM).contains(&place_mm[row])
        })
    }
}

/// Root mean squares of the parts of (1), mm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parts {
    /// t.
    pub shift_mm: f64,
    /// diag(s).
    pub stretch_mm: f64,
    /// G.
    pub rotation_mm: f64,
    /// The rest.
    pub curved_mm: f64,
}

/// The smallest value that at least the share `q` of `values` do not exceed; NaN without values.
pub fn quantile(values: impl Iterator<Item = f64>, q: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a rank"
    )]
    let rank = ((sorted.len() as f64 * q).ceil() as usize).max(1);
    sorted.get(rank - 1).copied().unwrap_or(f64::NAN)
}

/// Judges `verification` against the cold one at the poses inside `span`; `None` when their poses differ
/// or none is inside.
pub fn judge(
    cold: &Verification,
    verification: &Verification,
    span: &BlocksSpan,
) -> Option<ToolError> {
    if cold.poses.len() != verification.poses.len() {
        return None;
    }
    let mut change = Vec::with_capacity(cold.poses.len());
    for (before, now) in cold.poses.iter().zip(&verification.poses) {
        if (before.commanded_mm - now.commanded_mm).norm() > 1e-6 {
            return None;
        }
        let error_mm = now.error_mm - before.error_mm;
        change.push(PoseError {
            commanded_mm: now.commanded_mm,
            error_mm,
        });
    }
    let inside = |poses: &[PoseError]| -> Vec<PoseError> {
        let held = poses.iter().filter(|pose| span.holds(&pose.commanded_mm));
        held.cloned().collect()
    };
    let (whole, inner) = (inside(&verification.poses), inside(&change));
    if inner.is_empty() {
        return None;
    }
    let sizes = |poses: &[PoseError]| -> Vec<f64> {
        poses.iter().map(|pose| pose.error_mm.norm()).collect()
    };
    let changes_mm = sizes(&inner);
    Some(ToolError {
        label: verification.label.clone(),
        n_inside: inner.len(),
        change_p95_mm: quantile(changes_mm.iter().copied(), 0.95),
        change_max_mm: changes_mm.iter().copied().fold(0.0, f64::max),
        whole_p95_mm: quantile(sizes(&whole).into_iter(), 0.95),
        parts: split(&inner),
        change,
    })
}

/// Splits the change as (1).
fn split(change: &[PoseError]) -> Parts {
    let n = change.len();
    let count = n as f64;
    let mean_mm = change.iter().map(|p| p.commanded_mm).sum::<Vector3<f64>>() / count;
    let design = DMatrix::from_fn(n, 4, |row, column| match column {
        0 => 1.0,
        column => (change[row].commanded_mm - mean_mm)[column - 1],
    });
    let svd = design.clone().svd(true, true);
    let mut shift_mm = Vector3::zeros();
    let mut gradient = Matrix3::zeros();
    for axis in 0..3 {
        let values = DVector::from_iterator(n, change.iter().map(|p| p.error_mm[axis]));
        if let Ok(fit) = svd.solve(&values, 1e-12) {
            shift_mm[axis] = fit[0];
            for column in 0..3 {
                gradient[(axis, column)] = fit[column + 1];
            }
        }
    }
    let own = Matrix3::from_diagonal(&gradient.diagonal());
    let rms = |part: &dyn Fn(&PoseError) -> Vector3<f64>| {
        (change
            .iter()
            .map(|pose| part(pose).norm_squared())
            .sum::<f64>()
            / count)
            .sqrt()
    };
    Parts {
        shift_mm: shift_mm.norm(),
        stretch_mm: rms(&|pose| own * (pose.commanded_mm - mean_mm)),
        rotation_mm: rms(&|pose| (gradient - own) * (pose.commanded_mm - mean_mm)),
        curved_mm: rms(&|pose| pose.error_mm - shift_mm - gradient * (pose.commanded_mm - mean_mm)),
    }
}

/// Corners and centre of the area that was visited, at one height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Places {
    /// The lowest height at which all five were visited, mm.
    pub z_mm: f64,
    /// Corners -X -Y, +X -Y, -X +Y, +X +Y, and the centre, mm.
    pub at_mm: [Vector3<f64>; 5],
}

/// Names of [`Places::at_mm`].
pub const PLACE_NAMES: [&str; 5] = [
    "corner -X -Y",
    "corner +X -Y",
    "corner -X +Y",
    "corner +X +Y",
    "centre",
];

/// Two commanded poses that are this near are one, mm.
const SAME_MM: f64 = 1e-6;

impl Places {
    /// Of the poses that were visited; `None` when no height has all five.
    pub fn of(poses: &[PoseError]) -> Option<Self> {
        let all = || poses.iter().map(|pose| pose.commanded_mm);
        let low = all().reduce(|a, b| a.inf(&b))?;
        let high = all().reduce(|a, b| a.sup(&b))?;
        let middle = (low + high) / 2.0;
        let mut heights: Vec<f64> = all().map(|place| place.z).collect();
        heights.sort_by(f64::total_cmp);
        heights.into_iter().find_map(|z_mm| {
            let at_mm = [
                Vector3::new(low.x, low.y, z_mm),
                Vector3::new(high.x, low.y, z_mm),
                Vector3::new(low.x, high.y, z_mm),
                Vector3::new(high.x, high.y, z_mm),
                Vector3::new(middle.x, middle.y, z_mm),
            ];
            let visited = |place: &Vector3<f64>| all().any(|at| (at - place).norm() < SAME_MM);
            at_mm.iter().all(visited).then_some(Self { z_mm, at_mm })
        })
    }
}

/// The change at a place that was visited.
pub fn at(change: &[PoseError], place_mm: &Vector3<f64>) -> Option<Vector3<f64>> {
    let mut there = change
        .iter()
        .filter(|pose| (pose.commanded_mm - place_mm).norm() < SAME_MM);
    there.next().map(|pose| pose.error_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(error: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<PoseError> {
        let mut poses = Vec::new();
        for x in [-1.0, 0.0, 1.0] {
            for y in [-1.0, 0.0, 1.0] {
                for z in [-1.0, 0.0, 1.0] {
                    let commanded_mm = Vector3::new(x, y, z) * 100.0;
                    poses.push(PoseError {
                        commanded_mm,
                        error_mm: error(commanded_mm),
                    });
                }
            }
        }
        poses
    }

    #[test]
    fn eq1_each_part_is_found_where_it_was_put() {
        let turn = 1e-4;
        let parts = split(&grid(|r| {
            Vector3::new(0.002 - turn * r.y, turn * r.x, 1e-5 * r.z)
        }));
        assert!((parts.shift_mm - 0.002).abs() < 1e-12);
        let rms_of_axis = (2.0_f64 / 3.0).sqrt() * 100.0;
        assert!((parts.stretch_mm - 1e-5 * rms_of_axis).abs() < 1e-12);
        assert!((parts.rotation_mm - turn * rms_of_axis * 2.0_f64.sqrt()).abs() < 1e-12);
        assert!(parts.curved_mm < 1e-12);
        let curved = split(&grid(|r| Vector3::new(1e-7 * r.x * r.x, 0.0, 0.0)));
        assert!(curved.curved_mm > 4e-4, "{curved:?}");
    }

    #[test]
    fn the_quantile_is_a_value_that_occurred() {
        assert!((quantile((1..=20).map(f64::from), 0.95) - 19.0).abs() < 1e-12);
        assert!(quantile(std::iter::empty(), 0.95).is_nan());
    }

    fn verification(label: &str, poses: Vec<PoseError>) -> Verification {
        Verification {
            label: label.to_owned(),
            at: metrology::Stamp::from_nanos(0),
            is_compensated: false,
            poses,
        }
    }

    #[test]
    fn poses_outside_the_blocks_span_in_any_axis_are_not_judged() {
        let span = BlocksSpan {
            low_mm: Vector3::new(-100.03, -100.0, -100.0),
            high_mm: Vector3::new(99.98, 0.0, 99.0),
        };
        let cold = verification("cold", grid(|_| Vector3::new(0.001, 0.0, 0.0)));
        let outside = |r: Vector3<f64>| r.y > 0.0 || r.z > 99.5;
        let warm = verification(
            "warm",
            grid(|r| Vector3::new(0.001, 0.0, if outside(r) { 0.5 } else { 0.004 })),
        );
        let judged = judge(&cold, &warm, &span).unwrap();
        assert_eq!(judged.n_inside, 3 * 2 * 2);
        assert!((judged.change_max_mm - 0.004).abs() < 1e-12, "{judged:?}");
        assert!((judged.change_p95_mm - 0.004).abs() < 1e-12);
        assert!((judged.whole_p95_mm - 0.001_f64.hypot(0.004)).abs() < 1e-12);
        assert_eq!(judged.change.len(), 27);
        let nowhere = BlocksSpan {
            low_mm: Vector3::repeat(500.0),
            high_mm: Vector3::repeat(600.0),
        };
        assert!(judge(&cold, &warm, &nowhere).is_none());
    }

    #[test]
    fn the_places_are_at_the_lowest_height_that_has_all_of_them() {
        let mut poses = grid(|_| Vector3::zeros());
        let lowest = Places::of(&poses).unwrap();
        assert!((lowest.z_mm + 100.0).abs() < 1e-12);
        poses.retain(|pose| pose.commanded_mm != Vector3::new(100.0, 100.0, -100.0));
        let next = Places::of(&poses).unwrap();
        assert!(next.z_mm.abs() < 1e-12);
        assert_eq!(at(&poses, &next.at_mm[3]), Some(Vector3::zeros()));
        assert_eq!(at(&poses, &lowest.at_mm[3]), None);
        poses.retain(|pose| pose.commanded_mm.x < 0.0 || pose.commanded_mm.y < 0.0);
        assert!(Places::of(&poses).is_none());
    }
}
