//! The machine once more, by another road: every body's pose at the bed, with 4x4 matrices.
//!
//! A body that carries the workpiece moves against its axis, and its errors are those of the tool
//! relative to the workpiece with the sign turned: its error matrix is the inverse of E.

use machine::{Chain, Kinematics, TableSense};
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{Matrix4, Vector3, Vector4};

/// Values of components at one pose, mm and rad.
pub type Values = Vec<(ErrorComponent, f64)>;

fn unit(axis: Axis) -> Vector3<f64> {
    let mut e = Vector3::zeros();
    e[axis.index() % 3] = 1.0;
    e
}

fn shift(v: Vector3<f64>) -> Matrix4<f64> {
    Matrix4::new_translation(&v)
}

/// The six numbers of an axis as one matrix about a point.
fn displacement(values: &Values, of: Axis, is_location: bool, about: Vector3<f64>) -> Matrix4<f64> {
    let mut six = [0.0; 6];
    for (component, value) in values {
        if component.of == of && component.is_location == is_location {
            six[component.direction.index()] += value;
        }
    }
    if is_location {
        six[of.index()] = 0.0;
    }
    let moved = Vector3::new(six[0], six[1], six[2]);
    let turned = Vector3::new(six[3], six[4], six[5]);
    shift(about + moved) * Matrix4::new_rotation(turned) * shift(-about)
}

fn zero_position(values: &Values, axis: Axis) -> f64 {
    let wanted = ErrorComponent::location(axis, axis);
    values
        .iter()
        .filter(|(c, _)| *c == wanted)
        .map(|(_, v)| v)
        .sum()
}

pub struct Bodies<'a> {
    pub kinematics: &'a Kinematics,
    pub values: Values,
}

impl Bodies<'_> {
    fn chain(&self) -> &Chain {
        self.kinematics.chain()
    }

    /// Pose of one body on the body that carries it.
    fn pose(&self, axis: Axis, position: f64, carries_workpiece: bool) -> Matrix4<f64> {
        let origin = self.kinematics.origin_mm(axis);
        let side = if carries_workpiece { -1.0 } else { 1.0 };
        if axis.is_linear() {
            let error = displacement(&self.values, axis, false, Vector3::zeros());
            let mut tilt = Vector3::zeros();
            for (component, value) in &self.values {
                if component.of == axis && component.is_location {
                    tilt += unit(component.direction) * *value;
                }
            }
            let along = Matrix4::new_rotation(tilt).transform_vector(&unit(axis));
            let moved = shift(along * (side * position));
            return if carries_workpiece {
                moved * error.try_inverse().unwrap()
            } else {
                moved * error
            };
        }
        let error = displacement(&self.values, axis, false, origin);
        let line = displacement(&self.values, axis, true, origin);
        let off = side * zero_position(&self.values, axis);
        let sense = match (carries_workpiece, self.kinematics.table_sense()) {
            (true, TableSense::Tool) => -1.0,
            _ => 1.0,
        };
        let turned = shift(origin)
            * Matrix4::new_rotation(unit(axis) * (sense * position + off))
            * shift(-origin);
        let turned = line * turned * line.try_inverse().unwrap();
        if carries_workpiece {
            error.try_inverse().unwrap() * turned
        } else {
            error * turned
        }
    }

    fn bed_from_workpiece(&self, positions: &PerAxis<f64>) -> Matrix4<f64> {
        let side = self.chain().workpiece_side().iter().rev();
        side.fold(Matrix4::identity(), |pose, &axis| {
            pose * self.pose(axis, positions[axis], true)
        })
    }

    /// What the zero positions of the tables do to the workpiece where the rotary axes are at zero.
    fn datum(&self, positions: &PerAxis<f64>) -> Matrix4<f64> {
        let mut at_zero = *positions;
        for axis in Axis::ROTARY {
            at_zero[axis] = 0.0;
        }
        let zero_positions = self.values.iter().filter(|(c, _)| {
            c.is_location && c.direction == c.of && self.chain().workpiece_side().contains(&c.of)
        });
        let shifted = Bodies {
            kinematics: self.kinematics,
            values: zero_positions.copied().collect(),
        };
        let nominal = Bodies {
            kinematics: self.kinematics,
            values: Vec::new(),
        };
        nominal.bed_from_workpiece(&at_zero).try_inverse().unwrap()
            * shifted.bed_from_workpiece(&at_zero)
    }

    /// Tip in the workpiece frame, mm.
    pub fn tip(&self, positions: &PerAxis<f64>, tool_offset: &Vector3<f64>) -> Vector3<f64> {
        let side = self.chain().tool_side().iter();
        let bed_from_tool = side.fold(Matrix4::identity(), |pose: Matrix4<f64>, &axis| {
            pose * self.pose(axis, positions[axis], false)
        });
        let tip = Vector4::new(tool_offset.x, tool_offset.y, tool_offset.z, 1.0);
        let workpiece_from_bed = self.bed_from_workpiece(positions).try_inverse().unwrap();
        (self.datum(positions) * workpiece_from_bed * bed_from_tool * tip).xyz()
    }
}
