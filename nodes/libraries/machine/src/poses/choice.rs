//! Picks poses out of a grid: for calibration those that tell most, for verification others.
//!
//! Candidates are evenly spaced over the travel of each rotary axis (over one turn where it has more).
//! Calibration poses are chosen one by one, each the one that enlarges the determinant of the
//! information on the location errors and the sphere's place most (D-optimal), and are then exchanged
//! as long as that helps \[1\]. Verification poses are those farthest from all others, in turn.
//! Both are put in an order with little turning: by the first axis, the second up and down in turn.
//!
//! # References
//! \[1\] V. V. Fedorov, Theory of Optimal Experiments, Academic Press, 1972, chapter 3 (exchange
//! algorithm; from memory).

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, Vector3};

use super::merit::arm_mm;
use super::{PoseError, Reach, ReachLimits, SphereDesign, reach, sphere_of};
use crate::file::MachineFile;

/// Candidates along an axis that turns less than once, and along one that turns all round.
const ALONG_ARC: usize = 9;
const ALONG_TURN: usize = 12;
/// Information before the first pose, so that a determinant exists: nothing is known to better than
/// 1000 times a probed centre.
const BEFORE: f64 = 1e-6;
/// Rounds of exchange at most.
const EXCHANGES: usize = 20;

/// Poses (rad) at which `sphere` tells most about the location errors of the rotary axes.
///
/// # Errors
/// Unknown sphere, a chain that does not suit, too few poses for the unknowns, too few candidates
/// that can be reached.
pub fn calibration_poses(
    file: &MachineFile,
    sphere: &str,
    n: usize,
    limits: &ReachLimits,
) -> Result<Vec<PerAxis<f64>>, PoseError> {
    let design = SphereDesign::new(file)?;
    let unknowns = design.components().len() + 3;
    let least = unknowns.div_ceil(3);
    if n < least {
        return Err(PoseError::TooFew { n, unknowns, least });
    }
    let (place, _) = sphere_of(file, sphere)?;
    let candidates = candidates(file, &design, sphere, n, limits)?;
    let rows = information_rows(&design, &place, &candidates);
    let chosen = exchange(&rows, greedy(&rows, n));
    Ok(in_order(
        &design,
        chosen.into_iter().map(|k| candidates[k]).collect(),
    ))
}

/// Poses (rad) at which `sphere` can be probed, far from each other and from those `used`.
///
/// # Errors
/// Unknown sphere, a chain that does not suit, too few candidates that can be reached.
pub fn verification_poses(
    file: &MachineFile,
    sphere: &str,
    n: usize,
    used: &[PerAxis<f64>],
    limits: &ReachLimits,
) -> Result<Vec<PerAxis<f64>>, PoseError> {
    let design = SphereDesign::new(file)?;
    let candidates = candidates(file, &design, sphere, n, limits)?;
    let mut taken = used.to_vec();
    let mut chosen = Vec::new();
    for _ in 0..n {
        let spacing = |pose: &PerAxis<f64>| {
            let apart = taken.iter().map(|other| distance(&design, pose, other));
            apart.fold(f64::INFINITY, f64::min)
        };
        let farthest = candidates
            .iter()
            .max_by(|a, b| spacing(a).total_cmp(&spacing(b)))
            .copied();
        let Some(pose) = farthest else { break };
        taken.push(pose);
        chosen.push(pose);
    }
    Ok(in_order(&design, chosen))
}

/// Every pose of the grid that can be probed.
fn candidates(
    file: &MachineFile,
    design: &SphereDesign,
    sphere: &str,
    wanted: usize,
    limits: &ReachLimits,
) -> Result<Vec<PerAxis<f64>>, PoseError> {
    let (place, radius_mm) = sphere_of(file, sphere)?;
    let mut grid = vec![PerAxis::<f64>::default()];
    for &axis in design.rotary_axes() {
        let along = positions_rad(file, axis);
        grid = grid
            .iter()
            .flat_map(|pose| {
                along.iter().map(move |&position_rad| {
                    let mut pose = *pose;
                    pose[axis] = position_rad;
                    pose
                })
            })
            .collect();
    }
    let n_candidates = grid.len();
    let mut refused: BTreeMap<&'static str, usize> = BTreeMap::new();
    grid.retain(
        |pose| match reach(file, design, (&place, radius_mm), pose, limits) {
            Reach::Reachable => true,
            other => {
                *refused.entry(other.reason()).or_default() += 1;
                false
            }
        },
    );
    if grid.len() < wanted {
        let most_common = refused
            .iter()
            .max_by_key(|(_, n)| **n)
            .map_or("nothing", |(why, _)| *why);
        return Err(PoseError::Unreachable {
            sphere: sphere.to_owned(),
            wanted,
            reachable: grid.len(),
            candidates: n_candidates,
            most_common,
        });
    }
    Ok(grid)
}

/// Evenly spaced positions of an axis, rad; those of a full turn leave out its end.
fn positions_rad(file: &MachineFile, axis: Axis) -> Vec<f64> {
    let Some(entry) = file.rotary_axis(axis) else {
        return vec![0.0];
    };
    let [least, greatest] = entry.travel_deg.map(f64::to_radians);
    if greatest - least >= TAU * (1.0 - 1e-9) {
        // The turn that begins nearest to a half turn before zero.
        let first = least.max((-0.5 * TAU).min(greatest - TAU));
        return (0..ALONG_TURN)
            .map(|k| first + TAU * k as f64 / ALONG_TURN as f64)
            .collect();
    }
    (0..ALONG_ARC)
        .map(|k| least + (greatest - least) * k as f64 / (ALONG_ARC - 1) as f64)
        .collect()
}

/// Rows of the location errors (as lengths at the sphere) and of the sphere's place, per candidate.
fn information_rows(
    design: &SphereDesign,
    place: &Vector3<f64>,
    poses: &[PerAxis<f64>],
) -> Vec<DMatrix<f64>> {
    let arm_mm = arm_mm(design, std::iter::once(place));
    let p = design.components().len();
    poses
        .iter()
        .map(|pose| {
            let row = design.row(place, pose);
            let mut block = DMatrix::zeros(3, p + 3);
            for (j, &component) in design.components().iter().enumerate() {
                let scale = if component.is_angular() {
                    1.0 / arm_mm
                } else {
                    1.0
                };
                let effect = design.effect(&row, component) * scale;
                block.fixed_view_mut::<3, 1>(0, j).copy_from(&effect);
            }
            block
                .fixed_view_mut::<3, 3>(0, p)
                .copy_from(&row.machine_from_workpiece);
            block
        })
        .collect()
}

/// Logarithm of the determinant of the information in the chosen rows.
fn log_determinant(rows: &[DMatrix<f64>], chosen: impl Iterator<Item = usize>) -> f64 {
    let p = rows.first().map_or(0, DMatrix::ncols);
    let mut information = DMatrix::identity(p, p) * BEFORE;
    for k in chosen {
        information += rows[k].transpose() * &rows[k];
    }
    information.cholesky().map_or(f64::NEG_INFINITY, |root| {
        root.l().diagonal().map(f64::ln).sum()
    })
}

fn greedy(rows: &[DMatrix<f64>], n: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::with_capacity(n);
    while chosen.len() < n {
        let gain = |k: usize| log_determinant(rows, chosen.iter().copied().chain([k]));
        let free = (0..rows.len()).filter(|k| !chosen.contains(k));
        let Some((best, _)) = free
            .map(|k| (k, gain(k)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
        else {
            break;
        };
        chosen.push(best);
    }
    chosen
}

fn exchange(rows: &[DMatrix<f64>], mut chosen: Vec<usize>) -> Vec<usize> {
    let mut best = log_determinant(rows, chosen.iter().copied());
    for _ in 0..EXCHANGES {
        let before = best;
        for place in 0..chosen.len() {
            for candidate in 0..rows.len() {
                if chosen.contains(&candidate) {
                    continue;
                }
                let old = std::mem::replace(&mut chosen[place], candidate);
                let now = log_determinant(rows, chosen.iter().copied());
                if now > best + 1e-9 {
                    best = now;
                } else {
                    chosen[place] = old;
                }
            }
        }
        if best <= before {
            break;
        }
    }
    chosen
}

/// Distance of two poses, turns of an axis that goes all round counted the shorter way, rad.
fn distance(design: &SphereDesign, a: &PerAxis<f64>, b: &PerAxis<f64>) -> f64 {
    let squares = design.rotary_axes().iter().map(|&axis| {
        let apart = (a[axis] - b[axis]).rem_euclid(TAU);
        apart.min(TAU - apart).powi(2)
    });
    squares.sum::<f64>().sqrt()
}

/// By the first axis, the last one up and down in turn.
fn in_order(design: &SphereDesign, mut poses: Vec<PerAxis<f64>>) -> Vec<PerAxis<f64>> {
    let (Some(&first), Some(&last)) = (design.rotary_axes().first(), design.rotary_axes().last())
    else {
        return poses;
    };
    poses.sort_by(|a, b| {
        a[first]
            .total_cmp(&b[first])
            .then(a[last].total_cmp(&b[last]))
    });
    let mut ordered = Vec::with_capacity(poses.len());
    for (k, group) in poses
        .chunk_by(|a, b| (a[first] - b[first]).abs() < 1e-9)
        .enumerate()
    {
        if k % 2 == 0 {
            ordered.extend_from_slice(group);
        } else {
            ordered.extend(group.iter().rev());
        }
    }
    ordered
}
