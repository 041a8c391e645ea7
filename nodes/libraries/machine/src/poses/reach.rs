//! Whether a sphere can be touched all round at a rotary pose.
//!
//! The ball comes along the tool's axis d and touches a hemisphere about it. It needs the distance
//! R + r + standoff round the sphere's centre within the travel, and more than the overtravel is
//! never needed beyond it. The sphere's stem points along -n, n being the table's normal: with the
//! angle tau between d and n the equator of the hemisphere comes within 90 deg - tau of the stem, so
//! tau is limited. Where the machine file describes the table's top, ball and spindle nose must stay
//! above it.

use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use super::SphereDesign;
use crate::file::MachineFile;

/// Limits of a pose besides the travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachLimits {
    /// Greatest angle between the tool's axis and the table's normal, rad.
    pub greatest_tilt_rad: f64,
    /// Distance kept from the ends of the linear travel and from the table, mm.
    pub margin_mm: f64,
}

impl Default for ReachLimits {
    /// 65° leaves 25° between the hemisphere's rim and the stem.
    fn default() -> Self {
        Self {
            greatest_tilt_rad: 65.0_f64.to_radians(),
            margin_mm: 1.0,
        }
    }
}

/// Whether a pose can be probed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// It can.
    Reachable,
    /// A rotary axis would leave its travel.
    RotaryTravel {
        /// The axis.
        axis: Axis,
    },
    /// A linear axis would leave its travel.
    LinearTravel {
        /// The axis.
        axis: Axis,
        /// Where it would go, mm.
        position_mm: f64,
    },
    /// The tool would lean too far over the table to reach round the sphere.
    Tilt {
        /// Angle between the tool's axis and the table's normal, rad.
        tilt_rad: f64,
    },
    /// Ball or spindle nose would come too near to the table's top.
    Table {
        /// Height above the table's top, mm.
        height_mm: f64,
    },
}

impl Reach {
    /// In words, for a list of reasons.
    #[must_use]
    pub const fn reason(self) -> &'static str {
        match self {
            Self::Reachable => "nothing",
            Self::RotaryTravel { .. } => "a rotary axis would leave its travel",
            Self::LinearTravel { .. } => "a linear axis would leave its travel",
            Self::Tilt { .. } => "the tool would lean too far over the table",
            Self::Table { .. } => "ball or spindle nose would come too near to the table",
        }
    }
}

/// Whether the sphere at `sphere_mm` (workpiece frame) of `radius_mm` can be probed at a pose.
#[must_use]
pub(crate) fn reach(
    file: &MachineFile,
    design: &SphereDesign,
    (sphere_mm, radius_mm): (&Vector3<f64>, f64),
    pose_rad: &PerAxis<f64>,
    limits: &ReachLimits,
) -> Reach {
    for &axis in design.rotary_axes() {
        let travel_deg = file.rotary_axis(axis).map(|entry| entry.travel_deg);
        let position_deg = pose_rad[axis].to_degrees();
        if !travel_deg.is_some_and(|[least, greatest]| {
            position_deg >= least - ROUNDING_DEG && position_deg <= greatest + ROUNDING_DEG
        }) {
            return Reach::RotaryTravel { axis };
        }
    }
    let row = design.row(sphere_mm, pose_rad);
    let room_mm = radius_mm + file.ball_radius_mm() + file.probe.standoff_mm + limits.margin_mm;
    let tool = design.tool_in_machine(pose_rad);
    for axis in Axis::LINEAR {
        let Some(entry) = file.linear(axis) else {
            return Reach::LinearTravel {
                axis,
                position_mm: f64::NAN,
            };
        };
        let [least, greatest] = entry.travel_mm;
        let centre_mm = row.positions[axis];
        for position_mm in [centre_mm - room_mm, centre_mm + room_mm] {
            // The side away from the tool is never gone to.
            let behind = (position_mm - centre_mm) * tool[axis.index()] < -HALF_SPACE * room_mm;
            if !behind && !(least..=greatest).contains(&position_mm) {
                return Reach::LinearTravel { axis, position_mm };
            }
        }
    }
    let normal = row.machine_from_workpiece * Vector3::z();
    let tilt_rad = tool.cross(&normal).norm().atan2(tool.dot(&normal));
    if tilt_rad > limits.greatest_tilt_rad {
        return Reach::Tilt { tilt_rad };
    }
    above_table(
        file,
        sphere_mm,
        room_mm,
        &row.machine_from_workpiece.transpose(),
        &tool,
        limits,
    )
}

/// Cosine beyond which a direction counts as the tool's own.
const HALF_SPACE: f64 = 0.99;
/// Rounding of degrees at the ends of the travel.
const ROUNDING_DEG: f64 = 1e-9;

/// Ball and nose against the table's top, where the file describes it.
fn above_table(
    file: &MachineFile,
    sphere_mm: &Vector3<f64>,
    room_mm: f64,
    workpiece_from_machine: &nalgebra::Matrix3<f64>,
    tool: &Vector3<f64>,
    limits: &ReachLimits,
) -> Reach {
    let (Some(table), Some(stylus)) = (&file.table, file.mounted_stylus()) else {
        return Reach::Reachable;
    };
    let tool = workpiece_from_machine * tool;
    // The rim of the hemisphere is lowest where it leans against the table's normal.
    let lean = tool.x.hypot(tool.y);
    let ball_mm = sphere_mm.z - room_mm * lean - file.ball_radius_mm() - table.top_z_mm;
    let rim_mm = sphere_mm.xy().norm() - room_mm;
    if rim_mm < table.radius_mm && ball_mm < limits.margin_mm {
        return Reach::Table { height_mm: ball_mm };
    }
    let nose = sphere_mm + tool * stylus.length_mm;
    let nose_mm = nose.z - (room_mm + table.nose_radius_mm) * lean - table.top_z_mm;
    let nearest_mm = nose.xy().norm() - table.nose_radius_mm - room_mm;
    if nearest_mm < table.radius_mm && nose_mm < limits.margin_mm {
        return Reach::Table { height_mm: nose_mm };
    }
    Reach::Reachable
}
