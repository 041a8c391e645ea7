//! A flat face: a square grid of points about its middle.

use std::num::NonZeroU32;

use metrology::Axis;
use metrology::sample::TestKind;
use nalgebra::Vector3;

use super::program::{Path, Program, Touch};
use super::{Cycle, FeatureId};
use crate::error::CycleError;
use crate::file::{ArtefactEntry, MachineFile};

/// Least number of points along one side.
const LEAST_PER_SIDE: u32 = 2;

/// Touches a grid of `per_side` by `per_side` points on each plane; `ids` empty: all planes.
///
/// # Errors
/// Unknown planes or none, fewer than two points a side, a normal that is not along an axis or
/// points down, touches outside the travel, feeds the stand-off does not allow.
pub fn planes(
    file: &MachineFile,
    ids: &[String],
    per_side: u32,
    repeats: NonZeroU32,
) -> Result<Cycle, CycleError> {
    if per_side < LEAST_PER_SIDE {
        return Err(CycleError::TooFewPoints {
            shape: "plane, along each side,",
            points: per_side,
            least: LEAST_PER_SIDE,
        });
    }
    let mut program = Program::new(file)?;
    for entry in super::feature::chosen(file, ids, "plane", |entry| {
        matches!(entry, ArtefactEntry::Plane { .. })
    })? {
        let ArtefactEntry::Plane {
            id,
            point_mm,
            normal,
            half_side_mm,
        } = entry
        else {
            continue;
        };
        program.name_feature(id);
        let approach = approach_along_axis(id, normal)?;
        let points = grid(
            &Vector3::from(*point_mm),
            &approach,
            *half_side_mm,
            per_side,
        );
        for (index, contact_mm) in (1..).zip(points) {
            let mut path = Path::Over;
            for _ in 0..repeats.get() {
                let feature = FeatureId::Point {
                    artefact: id,
                    index,
                };
                let touch = Touch::ordinary(file, feature.to_string(), approach, contact_mm);
                program.touch(touch, path)?;
                path = Path::Straight;
            }
        }
    }
    Ok(program.finish(TestKind::Plane))
}

/// Grid points, row by row, forward and back.
fn grid(
    middle_mm: &Vector3<f64>,
    approach: &Vector3<f64>,
    half_side_mm: f64,
    per_side: u32,
) -> Vec<Vector3<f64>> {
    let [u, v] = match approach.iamax() {
        0 => [Axis::Y, Axis::Z],
        1 => [Axis::X, Axis::Z],
        _ => [Axis::X, Axis::Y],
    };
    let step_mm = 2.0 * half_side_mm / f64::from(per_side - 1);
    let mut points = Vec::new();
    for row in 0..per_side {
        for column in 0..per_side {
            let column = if row % 2 == 0 {
                column
            } else {
                per_side - 1 - column
            };
            let mut point = *middle_mm;
            point[u.index()] += step_mm * f64::from(column) - half_side_mm;
            point[v.index()] += step_mm * f64::from(row) - half_side_mm;
            points.push(point);
        }
    }
    points
}

fn approach_along_axis(id: &str, normal: &[f64; 3]) -> Result<Vector3<f64>, CycleError> {
    let [x, y, z] = *normal;
    let not_along = || CycleError::NormalNotAlongAxis {
        feature: id.to_owned(),
        x,
        y,
        z,
    };
    let direction = Vector3::from(*normal)
        .try_normalize(f64::MIN_POSITIVE)
        .ok_or_else(not_along)?;
    if direction.amax() < 1.0 - 1e-12 {
        return Err(not_along());
    }
    let mut approach = Vector3::zeros();
    approach[direction.iamax()] = -direction[direction.iamax()].signum();
    if approach.z > 0.0 {
        return Err(CycleError::ApproachFromBelow {
            feature: id.to_owned(),
        });
    }
    Ok(approach)
}
