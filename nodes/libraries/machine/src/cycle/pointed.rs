//! A sphere touched along given directions of the probe's axis.
//!
//! ```text
//!   A, C = the solution of `orientation` for d that is nearest to where the rotary axes stand     (1)
//!   p = w + R d,   n = -d                                                                        (2)
//! ```
//!
//! d is the unit vector from the ball to the spindle, w the sphere's centre, R its radius; all in the workpiece frame.
//! A sphere has one point whose normal is d, so the touch along the probe's own axis meets it there whatever d is. The
//! rotary axes turn with the tool at the top of Z, as in `rotary`.
//!
//! # References
//! \[1\] CN patent application on probing with a five-axis machine tool, published 2024-04-30, claim 3: (1).

use std::num::NonZeroU32;

use metrology::sample::TestKind;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use super::program::{Path, Program, Touch};
use super::rotary::check_swing;
use super::{Cycle, FeatureId};
use crate::error::CycleError;
use crate::file::MachineFile;
use crate::kinematics::TableSense;
use crate::orientation::{Orientation, Pointing, RotaryPosition};
use crate::poses::{PoseError, Reach, ReachLimits, SphereDesign, reach, sphere_of};

/// What is touched, and along which directions.
#[derive(Clone, Debug, PartialEq)]
pub struct PointedOrder<'a> {
    /// Name of the sphere.
    pub sphere: &'a str,
    /// Directions from the ball to the spindle, workpiece frame, of any length.
    pub probe_axes: &'a [Vector3<f64>],
    /// Touches along each.
    pub repeats: NonZeroU32,
}

/// Touches one sphere along each direction of the probe's axis; with the program comes how each direction is taken.
///
/// # Errors
/// No direction, one without length or that neither solution reaches within the travel, a sphere that cannot be
/// reached there, a turn that would swing it into the tool, feeds the stand-off does not allow.
pub fn pointed(
    file: &MachineFile,
    order: &PointedOrder<'_>,
) -> Result<(Cycle, Vec<Pointing>), CycleError> {
    let refuse = |source: PoseError| CycleError::Pose { source };
    let design = SphereDesign::new(file).map_err(refuse)?;
    let sphere = sphere_of(file, order.sphere).map_err(refuse)?;
    if order.probe_axes.is_empty() {
        return Err(CycleError::NothingToTouch {
            wanted: "probe axis in the request",
        });
    }
    let of = |index: usize| move |source| CycleError::ProbeAxis { index, source };
    let orientation = Orientation::new(file, TableSense::Table).map_err(of(0))?;
    let mut program = Program::new(file)?;
    program.name_feature(order.sphere);
    let mut at = PerAxis::default();
    let mut pointings = Vec::new();
    for (index, axis) in order.probe_axes.iter().enumerate() {
        let pointing = orientation
            .solve(axis, RotaryPosition::of(&at))
            .map_err(of(index))?;
        let mut pose = PerAxis::default();
        (pose[Axis::A], pose[Axis::C]) = (pointing.position.a_rad, pointing.position.c_rad);
        check_reach(file, &design, (&sphere.0, sphere.1), index, &pose)?;
        let ball = (order.sphere, &sphere.0, sphere.1);
        check_swing(&program, &design, ball, (&at, &pose))?;
        program.turn_to(&design, &pose);
        let tool = design.tool_in_machine(&pose);
        let contact_mm = design.row(&sphere.0, &pose).centre_mm + tool * sphere.1; // (2)
        let mut path = Path::Over;
        for _ in 0..order.repeats.get() {
            let feature = FeatureId::Point {
                artefact: order.sphere,
                index: u32::try_from(index + 1).unwrap_or(u32::MAX),
            };
            let touch = Touch::ordinary(file, feature.to_string(), -tool, contact_mm);
            program.touch(touch, path)?;
            path = Path::Straight;
        }
        pointings.push(pointing);
        at = pose;
    }
    Ok((program.finish(TestKind::Touch), pointings))
}

/// Refuses a pose at which the sphere cannot be reached. One touch along the tool stays clear of the stem at any tilt
/// up to level.
fn check_reach(
    file: &MachineFile,
    design: &SphereDesign,
    sphere: (&Vector3<f64>, f64),
    index: usize,
    pose: &PerAxis<f64>,
) -> Result<(), CycleError> {
    let limits = ReachLimits {
        greatest_tilt_rad: std::f64::consts::FRAC_PI_2,
        ..ReachLimits::default()
    };
    match reach(file, design, sphere, pose, &limits) {
        Reach::Reachable => Ok(()),
        other => Err(CycleError::ProbeAxisUnreachable {
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
