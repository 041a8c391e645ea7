//! A sphere: its pole from above and rings of points around it, each along the surface normal.

use std::f64::consts::{FRAC_PI_4, TAU};
use std::num::NonZeroU32;

use metrology::sample::TestKind;
use nalgebra::Vector3;

use super::program::{Path, Program, Touch};
use super::{Cycle, FeatureId};
use crate::error::CycleError;
use crate::file::{ArtefactEntry, MachineFile};

/// Least number of points: four determine a sphere, the fifth shows its form.
pub(super) const MIN_POINTS_OF_SPHERE: u32 = 5;
/// From this number on, half of the ring's points move to a second ring at 45°.
const TWO_RINGS: u32 = 9;

/// Touches `points` points on each sphere: the pole, a ring at the equator and, from nine points
/// on, a ring at 45°; `ids` empty: all spheres.
///
/// # Errors
/// Unknown spheres or none, fewer than five points, touches outside the travel, feeds the stand-off
/// does not allow.
pub fn spheres(
    file: &MachineFile,
    ids: &[String],
    points: u32,
    repeats: NonZeroU32,
) -> Result<Cycle, CycleError> {
    if points < MIN_POINTS_OF_SPHERE {
        return Err(CycleError::TooFewPoints {
            shape: "sphere",
            points,
            least: MIN_POINTS_OF_SPHERE,
        });
    }
    let mut program = Program::new(file)?;
    for entry in super::feature::chosen(file, ids, "sphere", |entry| {
        matches!(entry, ArtefactEntry::Sphere { .. })
    })? {
        let ArtefactEntry::Sphere {
            id,
            centre_mm,
            radius_mm,
        } = entry
        else {
            continue;
        };
        program.name_feature(id);
        for (index, normal) in (1..).zip(normals(points)) {
            let feature = FeatureId::Point {
                artefact: id,
                index,
            }
            .to_string();
            let mut path = Path::Over;
            for _ in 0..repeats.get() {
                let contact_mm = Vector3::from(*centre_mm) + normal * *radius_mm;
                let touch = Touch::ordinary(file, feature.clone(), -normal, contact_mm);
                program.touch(touch, path)?;
                path = Path::Straight;
            }
        }
    }
    Ok(program.finish(TestKind::Sphere))
}

/// Outward normals of the points: pole, equator, 45°.
pub(super) fn normals(points: u32) -> Vec<Vector3<f64>> {
    let upper = if points < TWO_RINGS {
        0
    } else {
        (points - 1) / 2
    };
    let mut normals = vec![Vector3::z()];
    normals.extend(ring(points - 1 - upper, 0.0));
    normals.extend(ring(upper, FRAC_PI_4));
    normals
}

fn ring(points: u32, elevation_rad: f64) -> impl Iterator<Item = Vector3<f64>> {
    (0..points).map(move |k| {
        let angle_rad = TAU * f64::from(k) / f64::from(points);
        Vector3::new(
            elevation_rad.cos() * angle_rad.cos(),
            elevation_rad.cos() * angle_rad.sin(),
            elevation_rad.sin(),
        )
    })
}
