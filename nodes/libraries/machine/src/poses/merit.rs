//! What a set of poses would tell, before anything is measured.
//!
//! # Model
//!
//! Rows of equation (2) of `poses` are stacked; a tilt's column is divided by an arm rho (the
//! sphere's greatest distance from a rotary axis' point), so that every unknown is a length at the
//! sphere; the sphere's place is projected out:
//!
//! ```text
//!   D = (1 - N N+) X S,   D = U diag(sigma) V^T                              (1)
//!   merit = sigma_min = u(centre) / u(worst known combination)               (2)
//!   cov(b) = u(centre)^2 S V diag(1/sigma^2) V^T S                           (3)
//! ```
//!
//! (2) is this project's own figure: one divided by the standard uncertainty of the combination of
//! location errors that is known worst, in units of that of one probed centre. Higher is better; it
//! grows as the square root of the number of poses. From 1 on every combination is known at least as
//! well as a single centre; below that, poses are wanted that differ more. 0: some combination is
//! not seen. It resembles in purpose, not in value, the number that makers' cycles print for a set of
//! positions, whose definition is not published.
//!
//! A singular value below a thousandth of the greatest counts as zero: noise of the rotary positions
//! would otherwise count as rank.

use metrology::{ErrorComponent, PerAxis};
use nalgebra::{DMatrix, Vector3};

use super::SphereDesign;

/// Merit from which every combination is known at least as well as one probed centre.
pub const WANTED_MERIT: f64 = 1.0;
/// Share of the greatest singular value below which a combination is not seen.
const SEEN: f64 = 1e-3;
/// How near to 1 the share of a component in what is seen must be.
const ESTIMABLE: f64 = 1.0 - 1e-6;

/// What a set of poses would tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Merit {
    /// Equation (2).
    pub merit: f64,
    /// Singular values of (1), greatest first.
    pub singular_values: Vec<f64>,
    /// Combinations of location errors that are seen.
    pub rank: usize,
    /// Each component with its standard uncertainty for a centre known to 1 mm (mm per mm, rad per
    /// mm); `None`: not estimable alone.
    pub standard_uncertainty: Vec<(ErrorComponent, Option<f64>)>,
}

/// Judges poses (rad) for spheres at places in the workpiece frame (mm), each with its own poses.
#[must_use]
pub fn merit(design: &SphereDesign, spheres: &[(Vector3<f64>, Vec<PerAxis<f64>>)]) -> Merit {
    let components = design.components();
    let arm_mm = arm_mm(design, spheres.iter().map(|(place, _)| place));
    let scale: Vec<f64> = components
        .iter()
        .map(|component| {
            if component.is_angular() {
                1.0 / arm_mm
            } else {
                1.0
            }
        })
        .collect();
    let n_rows: usize = spheres.iter().map(|(_, poses)| 3 * poses.len()).sum();
    let p = components.len();
    let mut reduced = DMatrix::zeros(n_rows, p);
    let mut at = 0;
    for (place, poses) in spheres {
        let block = seen_by_one(design, place, poses, &scale);
        reduced
            .view_mut((at, 0), (block.nrows(), p))
            .copy_from(&block);
        at += block.nrows();
    }
    of_reduced(&reduced, components, &scale)
}

/// Greatest distance of a sphere from a point of a rotary axis' line, mm; at least 1.
pub(super) fn arm_mm<'a>(
    design: &SphereDesign,
    places: impl Iterator<Item = &'a Vector3<f64>>,
) -> f64 {
    places
        .flat_map(|place| {
            let axes = design.rotary_axes().iter();
            axes.map(move |&axis| (place - design.kinematics().origin_mm(axis)).norm())
        })
        .fold(1.0, f64::max)
}

/// D of equation (1) for one sphere: its place is projected out.
fn seen_by_one(
    design: &SphereDesign,
    place: &Vector3<f64>,
    poses: &[PerAxis<f64>],
    scale: &[f64],
) -> DMatrix<f64> {
    let rows: Vec<_> = poses.iter().map(|pose| design.row(place, pose)).collect();
    let n = poses.len() as f64;
    let mut block = DMatrix::zeros(3 * poses.len(), scale.len());
    for (j, &component) in design.components().iter().enumerate() {
        let effects: Vec<_> = rows
            .iter()
            .map(|row| design.effect(row, component))
            .collect();
        // The columns of the sphere's place are rotations: their projection is a mean.
        let mean = rows
            .iter()
            .zip(&effects)
            .map(|(row, effect)| row.machine_from_workpiece.transpose() * effect)
            .sum::<Vector3<f64>>()
            / n;
        for (k, (row, effect)) in rows.iter().zip(&effects).enumerate() {
            let left = (effect - row.machine_from_workpiece * mean) * scale[j];
            block.fixed_view_mut::<3, 1>(3 * k, j).copy_from(&left);
        }
    }
    block
}

fn of_reduced(reduced: &DMatrix<f64>, components: &[ErrorComponent], scale: &[f64]) -> Merit {
    let p = components.len();
    let nothing = Merit {
        merit: 0.0,
        singular_values: vec![0.0; p],
        rank: 0,
        standard_uncertainty: components.iter().map(|c| (*c, None)).collect(),
    };
    if reduced.nrows() == 0 {
        return nothing;
    }
    // Eigenvalues of D^T D are squares of what is wanted: enough, since SEEN is far above its rounding.
    let eigen = (reduced.transpose() * reduced).symmetric_eigen();
    let mut order: Vec<usize> = (0..p).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let singular_values: Vec<f64> = order
        .iter()
        .map(|&k| eigen.eigenvalues[k].max(0.0).sqrt())
        .collect();
    let limit = SEEN * singular_values.first().copied().unwrap_or(0.0);
    let seen: Vec<(usize, f64)> = order
        .iter()
        .zip(&singular_values)
        .filter(|(_, sigma)| **sigma > limit)
        .map(|(&k, &sigma)| (k, sigma))
        .collect();
    let standard_uncertainty = components.iter().enumerate().map(|(j, &component)| {
        let share: f64 = seen
            .iter()
            .map(|&(k, _)| eigen.eigenvectors[(j, k)].powi(2))
            .sum();
        let variance: f64 = seen
            .iter()
            .map(|&(k, sigma)| (eigen.eigenvectors[(j, k)] * scale[j] / sigma).powi(2))
            .sum();
        (component, (share > ESTIMABLE).then(|| variance.sqrt())) // (3)
    });
    Merit {
        merit: if seen.len() == p {
            singular_values.last().copied().unwrap_or(0.0)
        } else {
            0.0
        },
        rank: seen.len(),
        standard_uncertainty: standard_uncertainty.collect(),
        singular_values,
    }
}
