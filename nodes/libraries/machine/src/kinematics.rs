//! Nominal transforms between the probe, the machine and the workpiece.
//!
//! The *machine frame* has the directions of the linear axes and reads what they read: the ball's
//! centre is at (X, Y, Z) when all rotary axes are at zero. The *workpiece frame* is fixed to the
//! workpiece and coincides with the machine frame when every axis is at zero; the *probe frame* is
//! fixed to the tool side's last member and has its origin at the ball's centre.
//!
//! ```text
//!   workpiece_from_probe = (bed_from_workpiece)^-1 bed_from_probe                    (1)
//!   bed_from_workpiece = prod_b..w J(axis, -q),  bed_from_probe = prod_b..t J(axis, q)
//!   J(linear, q) = translation q e,   J(rotary, q) = T(o) R(e, s q) T(-o)             (2)
//! ```
//!
//! For `[w C' A' Y' b X Z t]` with both origins at zero, (1) reduces to p_w = (Rx(A) Rz(C))^T p_m.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | q | positions of the axes | mm, rad |
//! | o | `rotary.origin_mm` of the machine file, all axes at zero | mm |
//! | s | +1 when a positive command turns this member right-handed | 1 |
//!
//! ISO 841 lets a positive command of a primed axis turn the *tool* right-handed about the
//! workpiece, so the table itself turns left-handed; many trunnion tables turn right-handed
//! themselves. [`TableSense`] says which.
//!
//! # Holds when
//! Nominal geometry: location errors of the rotary axes are not in it. Two rotary axes or fewer.
//!
//! # References
//! \[1\] ISO 841:2001, axis and motion nomenclature.

use metrology::{Axis, PerAxis};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::chain::{Chain, ChainError};
use crate::file::MachineFile;

/// Which member a positive command of a table's rotary axis turns right-handed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TableSense {
    /// The table itself.
    #[default]
    Table,
    /// The tool, seen from the workpiece (ISO 841).
    Tool,
}

/// Nominal kinematics of a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Kinematics {
    chain: Chain,
    origin_mm: PerAxis<[f64; 3]>,
    table_sense: TableSense,
}

impl Kinematics {
    /// From a machine file; its tables turn right-handed with a positive command.
    ///
    /// # Errors
    /// When the chain cannot be read.
    pub fn new(file: &MachineFile) -> Result<Self, ChainError> {
        let origin = |axis| {
            file.rotary
                .as_ref()
                .and_then(|rotary| rotary.origin_mm.get(&axis).copied())
                .unwrap_or_default()
        };
        Ok(Self {
            chain: file.chain.parse()?,
            origin_mm: PerAxis::from_fn(origin),
            table_sense: TableSense::Table,
        })
    }

    /// From a chain and a point on each rotary axis' line (machine frame, all axes at zero); tables
    /// turn right-handed with a positive command.
    #[must_use]
    pub const fn of_chain(chain: Chain, origin_mm: PerAxis<[f64; 3]>) -> Self {
        Self {
            chain,
            origin_mm,
            table_sense: TableSense::Table,
        }
    }

    /// The same machine with the other convention for its tables.
    #[must_use]
    pub fn with_table_sense(mut self, table_sense: TableSense) -> Self {
        self.table_sense = table_sense;
        self
    }

    /// The chain.
    #[must_use]
    pub const fn chain(&self) -> &Chain {
        &self.chain
    }

    /// A point on the line of a rotary axis, machine frame, all axes at zero, mm.
    #[must_use]
    pub fn origin_mm(&self, axis: Axis) -> Vector3<f64> {
        Vector3::from(self.origin_mm[axis])
    }

    /// Sense in which a positive command of a table's rotary axis turns the table.
    #[must_use]
    pub const fn table_sense(&self) -> TableSense {
        self.table_sense
    }

    /// +1 where a positive command of a rotary axis turns the tool right-handed, seen from the workpiece, otherwise -1.
    #[must_use]
    pub fn tool_sense(&self, axis: Axis) -> f64 {
        match self.table_sense {
            TableSense::Table if self.chain.workpiece_side().contains(&axis) => -1.0,
            TableSense::Table | TableSense::Tool => 1.0,
        }
    }

    /// Pose of the probe in the workpiece frame, equation (1); positions in mm and rad.
    #[must_use]
    pub fn workpiece_from_probe(&self, positions: &PerAxis<f64>) -> Isometry3<f64> {
        self.bed_from_workpiece(positions).inverse() * self.bed_from_probe(positions)
    }

    /// Turns a direction of the machine frame into one of the workpiece frame.
    #[must_use]
    pub fn direction_in_workpiece(
        &self,
        positions: &PerAxis<f64>,
        direction_in_machine: &Vector3<f64>,
    ) -> Vector3<f64> {
        self.bed_from_workpiece(positions)
            .rotation
            .inverse_transform_vector(direction_in_machine)
    }

    /// Turns a direction of the workpiece frame into one of the machine frame.
    #[must_use]
    pub fn direction_in_machine(
        &self,
        positions: &PerAxis<f64>,
        direction_in_workpiece: &Vector3<f64>,
    ) -> Vector3<f64> {
        self.bed_from_workpiece(positions)
            .rotation
            .transform_vector(direction_in_workpiece)
    }

    /// Ball centre in the workpiece frame, mm.
    #[must_use]
    pub fn ball_in_workpiece_mm(&self, positions: &PerAxis<f64>) -> Vector3<f64> {
        self.workpiece_from_probe(positions).translation.vector
    }

    /// Ball centre in the machine frame, mm: the linear positions, and what a turning head adds.
    #[must_use]
    pub fn ball_in_machine_mm(&self, positions: &PerAxis<f64>) -> Vector3<f64> {
        let head = self.bed_from_probe(positions).translation.vector;
        let mut ball_mm = head;
        for &axis in self.chain.workpiece_side() {
            if axis.is_linear() {
                ball_mm[axis.index()] += positions[axis];
            }
        }
        ball_mm
    }

    /// Surface point in the machine frame, mm: the ball centre moved by the effective radius along
    /// the approach.
    #[must_use]
    pub fn surface_in_machine_mm(
        &self,
        positions: &PerAxis<f64>,
        approach: &Vector3<f64>,
        ball_radius_mm: f64,
    ) -> Vector3<f64> {
        self.ball_in_machine_mm(positions) + approach * ball_radius_mm
    }

    /// Surface point in the workpiece frame, mm.
    #[must_use]
    pub fn surface_in_workpiece_mm(
        &self,
        positions: &PerAxis<f64>,
        approach: &Vector3<f64>,
        ball_radius_mm: f64,
    ) -> Vector3<f64> {
        self.ball_in_workpiece_mm(positions)
            + self.direction_in_workpiece(positions, approach) * ball_radius_mm
    }

    /// Unit vector of the probe axis (from the ball to the spindle) in the workpiece frame.
    #[must_use]
    pub fn probe_axis_in_workpiece(&self, positions: &PerAxis<f64>) -> Vector3<f64> {
        self.workpiece_from_probe(positions)
            .rotation
            .transform_vector(&Vector3::z())
    }

    fn bed_from_workpiece(&self, positions: &PerAxis<f64>) -> Isometry3<f64> {
        let sense = match self.table_sense {
            TableSense::Table => 1.0,
            TableSense::Tool => -1.0,
        };
        let side = self.chain.workpiece_side().iter().rev();
        side.fold(Isometry3::identity(), |pose, &axis| {
            // A primed linear axis moves the workpiece against its positive direction.
            let sense = if axis.is_linear() { -1.0 } else { sense };
            pose * self.joint(axis, sense * positions[axis])
        })
    }

    fn bed_from_probe(&self, positions: &PerAxis<f64>) -> Isometry3<f64> {
        let side = self.chain.tool_side().iter();
        side.fold(Isometry3::identity(), |pose, &axis| {
            pose * self.joint(axis, positions[axis])
        })
    }

    /// Motion of one joint, equation (2).
    fn joint(&self, axis: Axis, position: f64) -> Isometry3<f64> {
        let direction = direction_of(axis);
        if axis.is_linear() {
            return Isometry3::from_parts(
                Translation3::from(direction * position),
                UnitQuaternion::identity(),
            );
        }
        let turn = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(direction), position);
        let origin_mm = Vector3::from(self.origin_mm[axis]);
        let shift_mm = origin_mm - turn.transform_vector(&origin_mm);
        Isometry3::from_parts(Translation3::from(shift_mm), turn)
    }
}

/// Direction along or about which an axis moves, machine frame, rotary axes at zero.
#[must_use]
pub fn direction_of(axis: Axis) -> Vector3<f64> {
    match axis {
        Axis::X | Axis::A => Vector3::x(),
        Axis::Y | Axis::B => Vector3::y(),
        Axis::Z | Axis::C => Vector3::z(),
    }
}
