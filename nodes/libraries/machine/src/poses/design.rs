//! How a sphere's centre, as it is read at a rotary pose, moves with each unknown.

use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{Matrix3, Vector3};

use super::{PoseError, rotary};
use crate::file::{ArtefactEntry, MachineFile};
use crate::kinematics::Kinematics;
use crate::volumetric::{components_of, sensitivity};

/// The model of readings of a sphere at rotary poses.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereDesign {
    kinematics: Kinematics,
    rotary: Vec<Axis>,
    components: Vec<ErrorComponent>,
}

/// What one pose says.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseRow {
    /// Positions of all axes with the ball nominally at the sphere's centre, mm and rad.
    pub positions: PerAxis<f64>,
    /// Where the centre is nominally read, machine frame, mm.
    pub centre_mm: Vector3<f64>,
    /// R of equation (2): change of the reading per change of the sphere's place.
    pub machine_from_workpiece: Matrix3<f64>,
}

impl SphereDesign {
    /// For a machine file; the unknowns are the location errors of its rotary axes.
    ///
    /// # Errors
    /// When the chain cannot be read, lacks axes, or a rotary axis moves a linear one.
    pub fn new(file: &MachineFile) -> Result<Self, PoseError> {
        let kinematics = Kinematics::new(file).map_err(|error| PoseError::Chain { error })?;
        let chain = kinematics.chain();
        let axes = chain.axes();
        let turning: Vec<Axis> = rotary(axes).collect();
        let linear = Axis::LINEAR.iter().all(|axis| axes.contains(*axis));
        if !linear || turning.is_empty() || turning.len() > 2 {
            return Err(PoseError::Axes {
                chain: chain.to_string(),
            });
        }
        // From the bed outwards no linear axis may follow a rotary one.
        let outwards = [
            chain.workpiece_side().iter().rev().copied().collect(),
            chain.tool_side().to_vec(),
        ];
        for side in outwards {
            let side: Vec<Axis> = side;
            let turned = side.iter().skip_while(|axis| axis.is_linear());
            if let Some(&axis) = turned
                .copied()
                .collect::<Vec<_>>()
                .iter()
                .find(|axis| axis.is_linear())
            {
                return Err(PoseError::LinearOnRotary {
                    chain: chain.to_string(),
                    axis,
                });
            }
        }
        let components = components_of(chain)
            .into_iter()
            .filter(|component| component.is_location && !component.of.is_linear())
            .collect();
        Ok(Self {
            rotary: turning,
            components,
            kinematics,
        })
    }

    /// Nominal kinematics.
    #[must_use]
    pub const fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// The rotary axes, A B C.
    #[must_use]
    pub fn rotary_axes(&self) -> &[Axis] {
        &self.rotary
    }

    /// The location errors of the rotary axes.
    #[must_use]
    pub fn components(&self) -> &[ErrorComponent] {
        &self.components
    }

    /// The reading of a sphere at `sphere_mm` (workpiece frame) at a rotary pose (rad).
    #[must_use]
    pub fn row(&self, sphere_mm: &Vector3<f64>, pose_rad: &PerAxis<f64>) -> PoseRow {
        let mut positions = self.turned(pose_rad);
        let at_zero_mm = self.kinematics.ball_in_workpiece_mm(&positions);
        let head_mm = self.kinematics.ball_in_machine_mm(&positions);
        let machine_from_workpiece = Matrix3::from_columns(&[
            self.kinematics
                .direction_in_workpiece(&positions, &Vector3::x()),
            self.kinematics
                .direction_in_workpiece(&positions, &Vector3::y()),
            self.kinematics
                .direction_in_workpiece(&positions, &Vector3::z()),
        ])
        .transpose();
        let slides_mm = machine_from_workpiece * (sphere_mm - at_zero_mm);
        for axis in Axis::LINEAR {
            positions[axis] = slides_mm[axis.index()];
        }
        PoseRow {
            positions,
            centre_mm: head_mm + slides_mm,
            machine_from_workpiece,
        }
    }

    /// Change of the reading at a pose per unit of an error component, mm per mm or rad: the last term
    /// of equation (2).
    #[must_use]
    pub fn effect(&self, row: &PoseRow, component: ErrorComponent) -> Vector3<f64> {
        let in_workpiece = sensitivity(
            &self.kinematics,
            &row.positions,
            &Vector3::zeros(),
            component,
        );
        -(row.machine_from_workpiece * in_workpiece)
    }

    /// Unit vector from the ball to the spindle at a pose, machine frame.
    #[must_use]
    pub fn tool_in_machine(&self, pose_rad: &PerAxis<f64>) -> Vector3<f64> {
        let positions = self.turned(pose_rad);
        let in_workpiece = self.kinematics.probe_axis_in_workpiece(&positions);
        let to_workpiece = |direction: Vector3<f64>| {
            self.kinematics
                .direction_in_workpiece(&positions, &direction)
        };
        Vector3::new(
            to_workpiece(Vector3::x()).dot(&in_workpiece),
            to_workpiece(Vector3::y()).dot(&in_workpiece),
            to_workpiece(Vector3::z()).dot(&in_workpiece),
        )
    }

    /// Place by which the ball is off the linear positions at a pose, mm: what a head's turn adds.
    #[must_use]
    pub fn ball_from_slides_mm(&self, pose_rad: &PerAxis<f64>) -> Vector3<f64> {
        self.kinematics.ball_in_machine_mm(&self.turned(pose_rad))
    }

    /// Only the rotary positions that the machine has; the linear ones zero.
    fn turned(&self, pose_rad: &PerAxis<f64>) -> PerAxis<f64> {
        PerAxis::from_fn(|axis| {
            if self.rotary.contains(&axis) {
                pose_rad[axis]
            } else {
                0.0
            }
        })
    }
}

/// Nominal centre (mm) and radius (mm) of a sphere of the machine file.
pub(crate) fn sphere_of(file: &MachineFile, id: &str) -> Result<(Vector3<f64>, f64), PoseError> {
    file.artefacts
        .iter()
        .find_map(|entry| match entry {
            ArtefactEntry::Sphere {
                id: name,
                centre_mm,
                radius_mm,
            } if name == id => Some((Vector3::from(*centre_mm), *radius_mm)),
            _ => None,
        })
        .ok_or_else(|| PoseError::UnknownSphere {
            sphere: id.to_owned(),
        })
}
