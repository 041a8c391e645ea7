//! The tool error over the blocks' span, against the plant's truth.
//!
//! Thermal compensation answers for the *change* of the error since the cold reference, so the
//! cold verification is subtracted pose by pose; the geometric error that is there when cold stays
//! out of the judgement and is shown beside it.
//!
//! What is left is split by least squares over the poses r (about their mean r0):
//!
//! ```text
//!   e(r) = t + diag(s) (r - r0) + G (r - r0) + rest,   G without diagonal      (1)
//! ```
//!
//! t is what all poses share, s what two blocks can see besides it, G rotations and shears that two
//! blocks on one diagonal cannot tell from s, the rest is curved (hot zone, bending).

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::evidence::{PoseError, Verification};

/// Errors of one verification, changed since the cold one.
#[derive(Clone, Debug)]
pub struct ToolError {
    /// Label of the verification.
    pub label: String,
    /// Change since cold at each pose.
    pub change: Vec<PoseError>,
    /// 95 % quantile of the size of the change, mm.
    pub p95_mm: f64,
    /// Greatest size of the change, mm.
    pub max_mm: f64,
    /// 95 % quantile of the whole error, cold error included, mm.
    pub whole_p95_mm: f64,
    /// Root mean square of each part of (1), mm.
    pub parts: Parts,
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

/// Judges `verification` against the cold one; `None` when their poses differ.
pub fn judge(cold: &Verification, verification: &Verification) -> Option<ToolError> {
    if cold.poses.is_empty() || cold.poses.len() != verification.poses.len() {
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
    let sizes = || change.iter().map(|pose| pose.error_mm.norm());
    Some(ToolError {
        label: verification.label.clone(),
        p95_mm: quantile(sizes(), 0.95),
        max_mm: sizes().fold(0.0, f64::max),
        whole_p95_mm: quantile(verification.poses.iter().map(|p| p.error_mm.norm()), 0.95),
        parts: split(&change),
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

/// The pose nearest to a wanted place, and its change.
pub fn nearest(change: &[PoseError], wanted_mm: Vector3<f64>) -> Option<&PoseError> {
    let distance = |pose: &PoseError| (pose.commanded_mm - wanted_mm).norm();
    change
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
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
}
