//! The members of a chain from the tool to the workpiece and their nominal motion.

use metrology::{Axis, PerAxis};
use nalgebra::{Rotation3, Unit, Vector3};

use crate::chain::Chain;
use crate::kinematics::{Kinematics, TableSense, direction_of};

/// One axis in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Member {
    pub(super) axis: Axis,
    /// Whether it stands between the workpiece and the bed.
    pub(super) carries_workpiece: bool,
}

/// The members from the tool to the workpiece.
pub(super) fn members(chain: &Chain) -> impl Iterator<Item = Member> + '_ {
    let with = |carries_workpiece| {
        move |&axis: &Axis| Member {
            axis,
            carries_workpiece,
        }
    };
    let tool_side = chain.tool_side().iter().rev().map(with(false));
    tool_side.chain(chain.workpiece_side().iter().rev().map(with(true)))
}

impl Member {
    /// Angle by which it turns the tip when its position is 1, rad per rad; 0 for a linear axis.
    pub(super) fn sense(self, table_sense: TableSense) -> f64 {
        match (self.axis.is_linear(), self.carries_workpiece, table_sense) {
            (true, ..) => 0.0,
            (false, true, TableSense::Table) => -1.0,
            (false, true, TableSense::Tool) | (false, false, _) => 1.0,
        }
    }

    /// Its turn at these positions.
    pub(super) fn turn(self, kinematics: &Kinematics, positions: &PerAxis<f64>) -> Rotation3<f64> {
        if self.axis.is_linear() {
            return Rotation3::identity();
        }
        let about = Unit::new_unchecked(direction_of(self.axis));
        let angle_rad = self.sense(kinematics.table_sense()) * positions[self.axis];
        Rotation3::from_axis_angle(&about, angle_rad)
    }

    /// Where it takes a point: nominal G of the module's equations (2) to (5), mm.
    pub(super) fn moved_mm(
        self,
        kinematics: &Kinematics,
        positions: &PerAxis<f64>,
        point_mm: &Vector3<f64>,
    ) -> Vector3<f64> {
        if self.axis.is_linear() {
            return point_mm + direction_of(self.axis) * positions[self.axis];
        }
        let origin_mm = kinematics.origin_mm(self.axis);
        origin_mm + self.turn(kinematics, positions) * (point_mm - origin_mm)
    }
}
