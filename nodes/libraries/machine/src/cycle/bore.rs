//! A ring gauge from inside or a boss from outside: points on one circle at probing height.

use std::f64::consts::TAU;
use std::num::NonZeroU32;

use metrology::sample::TestKind;
use nalgebra::Vector3;

use super::program::{Path, Program, Touch};
use super::{Cycle, FeatureId, artefact_id};
use crate::error::CycleError;
use crate::file::{ArtefactEntry, MachineFile};

/// Least number of points on a circle: three determine it, the fourth shows its form.
const MIN_POINTS_OF_BORE: u32 = 4;
/// Clearance to the far wall at the start of a touch, mm.
const FAR_WALL_MM: f64 = 0.5;

/// Touches `points` evenly spaced points on each bore and boss; `ids` empty: all of both.
///
/// # Errors
/// Unknown artefacts or none, fewer than four points, a bore in which the ball cannot reach its
/// feed, touches outside the travel, feeds the stand-off does not allow.
pub fn bores(
    file: &MachineFile,
    ids: &[String],
    points: u32,
    repeats: NonZeroU32,
) -> Result<Cycle, CycleError> {
    if points < MIN_POINTS_OF_BORE {
        return Err(CycleError::TooFewPoints {
            shape: "bore or boss",
            points,
            least: MIN_POINTS_OF_BORE,
        });
    }
    let mut program = Program::new(file)?;
    for entry in super::feature::chosen(file, ids, "bore or boss", is_round)? {
        program.name_feature(artefact_id(entry));
        match entry {
            ArtefactEntry::Bore {
                id,
                centre_mm,
                radius_mm,
            } => bore(
                &mut program,
                file,
                &Circle::new(id, centre_mm, *radius_mm, points),
                repeats,
            )?,
            ArtefactEntry::Boss {
                id,
                centre_mm,
                radius_mm,
            } => boss(
                &mut program,
                file,
                &Circle::new(id, centre_mm, *radius_mm, points),
                repeats,
            )?,
            ArtefactEntry::Sphere { .. } | ArtefactEntry::Plane { .. } => {}
        }
    }
    Ok(program.finish(TestKind::Bore))
}

const fn is_round(entry: &ArtefactEntry) -> bool {
    matches!(
        entry,
        ArtefactEntry::Bore { .. } | ArtefactEntry::Boss { .. }
    )
}

struct Circle<'a> {
    id: &'a str,
    centre_mm: Vector3<f64>,
    radius_mm: f64,
    points: u32,
}

impl<'a> Circle<'a> {
    fn new(id: &'a str, centre_mm: &[f64; 3], radius_mm: f64, points: u32) -> Self {
        Self {
            id,
            centre_mm: Vector3::from(*centre_mm),
            radius_mm,
            points,
        }
    }

    /// The touch of point `index` (from 1); `outward` is +1 from inside, -1 from outside.
    fn touch(&self, file: &MachineFile, index: u32, outward: f64) -> Touch {
        let angle_rad = TAU * f64::from(index - 1) / f64::from(self.points);
        let radial = Vector3::new(angle_rad.cos(), angle_rad.sin(), 0.0);
        let id = FeatureId::Point {
            artefact: self.id,
            index,
        };
        let contact_mm = self.centre_mm + radial * self.radius_mm;
        Touch::ordinary(file, id.to_string(), radial * outward, contact_mm)
    }
}

/// From the middle outwards; a disc is convex, so straight moves between starts stay inside.
fn bore(
    program: &mut Program<'_>,
    file: &MachineFile,
    circle: &Circle<'_>,
    repeats: NonZeroU32,
) -> Result<(), CycleError> {
    let ball_radius_mm = program.ball_radius_mm();
    let room_mm = circle.radius_mm - ball_radius_mm;
    let standoff_mm = file.probe.standoff_mm;
    // The start may lie beyond the centre, but must stay clear of the far wall.
    if 2.0 * room_mm < standoff_mm + FAR_WALL_MM {
        return Err(CycleError::BoreTooSmall {
            feature: circle.id.to_owned(),
            radius_mm: circle.radius_mm,
            ball_radius_mm,
            room_mm,
            standoff_mm,
        });
    }
    program.go(circle.id, &circle.centre_mm, Path::Over)?;
    for index in 1..=circle.points {
        for _ in 0..repeats.get() {
            program.touch(circle.touch(file, index, 1.0), Path::Straight)?;
        }
    }
    program.go(circle.id, &circle.centre_mm, Path::Straight)
}

/// From outside inwards, over the top of Z between points: the file does not say how high it is.
fn boss(
    program: &mut Program<'_>,
    file: &MachineFile,
    circle: &Circle<'_>,
    repeats: NonZeroU32,
) -> Result<(), CycleError> {
    for index in 1..=circle.points {
        let mut path = Path::Over;
        for _ in 0..repeats.get() {
            program.touch(circle.touch(file, index, -1.0), path)?;
            path = Path::Straight;
        }
    }
    Ok(())
}
