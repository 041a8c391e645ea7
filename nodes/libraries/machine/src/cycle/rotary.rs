//! A sphere touched at several poses of the rotary axes.
//!
//! At each pose the rotary axes turn first, with the tool at the top of Z; the nominal centre follows
//! from the chain; the touches come along a hemisphere about the tool's axis: its pole, a ring at its
//! equator and, from nine points on, a ring at 45°. The numbers of the points begin anew at each
//! pose. Repeats visit all poses again, backwards every second time, so that a drift that is linear
//! in time does not lean towards the poses at one end.
//!
//! A ring of four points takes a pretravel with three lobes for a shift of the centre, since
//! cos 3x = cos x there; rings of five or more do not. With 6 points the equator has 5, with 11 both
//! rings have 5.

use std::num::NonZeroU32;

use metrology::PerAxis;
use metrology::sample::TestKind;
use nalgebra::{Rotation3, Vector3};

use super::program::{Path, Program, Touch};
use super::sphere::{MIN_POINTS_OF_SPHERE, normals};
use super::{Cycle, FeatureId};
use crate::error::CycleError;
use crate::file::MachineFile;
use crate::poses::{PoseError, Reach, ReachLimits, SphereDesign, reach, sphere_of};

/// Clearance above the sphere when the tool goes from one side of it to another, mm.
const OVER_MM: f64 = 1.0;
/// Looks at a turn from one pose to the next, for the height of the sphere.
const LOOKS: u32 = 24;

/// What is touched, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct RotaryOrder<'a> {
    /// Name of the sphere.
    pub sphere: &'a str,
    /// Poses of the rotary axes, rad.
    pub poses_rad: &'a [PerAxis<f64>],
    /// Touches at each pose.
    pub points: u32,
    /// Visits of each pose.
    pub repeats: NonZeroU32,
    /// Whether a model is judged, not found.
    pub verification: bool,
}

/// Touches one sphere at each pose.
///
/// # Errors
/// No pose, poses outside the travel or at which the sphere cannot be touched all round, fewer than
/// five points, a turn that would swing the sphere into the tool, feeds the stand-off does not allow.
pub fn rotary(file: &MachineFile, order: &RotaryOrder<'_>) -> Result<Cycle, CycleError> {
    let refuse = |source: PoseError| CycleError::Pose { source };
    if order.points < MIN_POINTS_OF_SPHERE {
        return Err(CycleError::TooFewPoints {
            shape: "sphere",
            points: order.points,
            least: MIN_POINTS_OF_SPHERE,
        });
    }
    let design = SphereDesign::new(file).map_err(refuse)?;
    let (place_mm, radius_mm) = sphere_of(file, order.sphere).map_err(refuse)?;
    if order.poses_rad.is_empty() {
        return Err(CycleError::NothingToTouch {
            wanted: "pose in the request",
        });
    }
    for (index, pose) in order.poses_rad.iter().enumerate() {
        check(file, &design, (&place_mm, radius_mm), index, pose)?;
    }
    let mut program = Program::new(file)?;
    program.name_feature(order.sphere);
    let mut at = PerAxis::default();
    for visit in 0..order.repeats.get() {
        let mut poses: Vec<&PerAxis<f64>> = order.poses_rad.iter().collect();
        if visit % 2 == 1 {
            poses.reverse();
        }
        for pose in poses {
            check_swing(
                &program,
                &design,
                (order.sphere, &place_mm, radius_mm),
                (&at, pose),
            )?;
            program.turn_to(&design, pose);
            touch_all_round(
                &mut program,
                file,
                &design,
                order,
                (&place_mm, radius_mm),
                pose,
            )?;
            at = *pose;
        }
    }
    Ok(program.finish(if order.verification {
        TestKind::RotaryVerification
    } else {
        TestKind::Rotary
    }))
}

/// Refuses a pose that is none or that cannot be probed.
fn check(
    file: &MachineFile,
    design: &SphereDesign,
    (place_mm, radius_mm): (&Vector3<f64>, f64),
    index: usize,
    pose: &PerAxis<f64>,
) -> Result<(), CycleError> {
    for &axis in design.rotary_axes() {
        if !pose[axis].is_finite() {
            let source = PoseError::NotFinite { index, axis };
            return Err(CycleError::Pose { source });
        }
    }
    let limits = ReachLimits::default();
    match reach(file, design, (place_mm, radius_mm), pose, &limits) {
        Reach::Reachable => Ok(()),
        Reach::RotaryTravel { axis } => Err(CycleError::Pose {
            source: PoseError::OutsideTravel {
                index,
                axis,
                position_deg: pose[axis].to_degrees(),
                travel_deg: file
                    .rotary_axis(axis)
                    .map_or([0.0; 2], |entry| entry.travel_deg),
            },
        }),
        other => Err(CycleError::PoseUnreachable {
            index,
            pose: design
                .rotary_axes()
                .iter()
                .map(|&axis| (axis, pose[axis].to_degrees()))
                .collect(),
            reason: other.reason(),
        }),
    }
}

/// Refuses a turn during which the sphere would come as high as the ball at the top of Z.
pub(super) fn check_swing(
    program: &Program<'_>,
    design: &SphereDesign,
    (sphere, place_mm, radius_mm): (&str, &Vector3<f64>, f64),
    (from, to): (&PerAxis<f64>, &PerAxis<f64>),
) -> Result<(), CycleError> {
    for look in 0..=LOOKS {
        let share = f64::from(look) / f64::from(LOOKS);
        let mut pose = PerAxis::default();
        for &axis in design.rotary_axes() {
            pose[axis] = from[axis] + share * (to[axis] - from[axis]);
        }
        let ball_mm = program.top_z_mm() + design.ball_from_slides_mm(&pose).z;
        let lowest_mm = ball_mm - program.ball_radius_mm() - OVER_MM;
        let highest_mm = design.row(place_mm, &pose).centre_mm.z + radius_mm;
        if highest_mm > lowest_mm {
            return Err(CycleError::SwingsIntoTool {
                feature: sphere.to_owned(),
                highest_mm,
                lowest_mm,
            });
        }
    }
    Ok(())
}

fn touch_all_round(
    program: &mut Program<'_>,
    file: &MachineFile,
    design: &SphereDesign,
    order: &RotaryOrder<'_>,
    (place_mm, radius_mm): (&Vector3<f64>, f64),
    pose: &PerAxis<f64>,
) -> Result<(), CycleError> {
    let centre_mm = design.row(place_mm, pose).centre_mm;
    let tool = design.tool_in_machine(pose);
    // A tool that points straight down from above needs no turn and has no opposite here.
    let turn =
        Rotation3::rotation_between(&Vector3::z(), &tool).unwrap_or_else(Rotation3::identity);
    let over_mm =
        centre_mm.z + radius_mm + program.ball_radius_mm() + file.probe.standoff_mm + OVER_MM;
    let mut path = Path::Over;
    for (index, normal) in (1..).zip(normals(order.points)) {
        let normal = turn * normal;
        let feature = FeatureId::Point {
            artefact: order.sphere,
            index,
        };
        let contact_mm = centre_mm + normal * radius_mm;
        let touch = Touch::ordinary(file, feature.to_string(), -normal, contact_mm);
        program.touch(touch, path)?;
        path = Path::LowOver(over_mm);
    }
    Ok(())
}
