//! All geometric errors of a machine together: the exact position of the tip at a pose.
//!
//! The product of the module's equation (1) is applied to the tip from the tool's end, member by
//! member, so that no matrix is multiplied: each member moves one point (`turn`). The nominal tip is
//! moved beside it; their difference is the error.
//!
//! # Agreement
//! `prop_the_walk_is_the_product_of_bodies`, 14 chains, errors from 10 µm and 10 µrad up to 2 mm and 0.05 rad: 3.1e-12 mm.
//! `prop_the_first_order_is_off_by_the_second_order`: the sum of sensitivities times values is off by
//! 7.3e-9 mm for errors of 1 µm and 1 µrad, by a hundred times that for ten times those.

use metrology::drift::Extrapolate;
use metrology::sample::GeometryModel;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::Vector3;

use super::component::has_component;
use super::curve::{self, Lanes, Motions, lane};
use super::error::{PoseRefusal, VolumetricError};
use super::member::{Member, members};
use super::turn::{SinCos, sin_cos, turned, turned_about, turned_by};
use crate::chain::Chain;
use crate::kinematics::{Kinematics, direction_of};

/// The geometric errors of one machine, ready for use at every servo tick. Evaluating allocates nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumetricModel {
    /// From the tool to the workpiece.
    pub(super) links: Vec<Link>,
    locations: Vec<(ErrorComponent, f64)>,
    policy: Extrapolate,
    has_shifted_datum: bool,
    /// Whether there is an axis X, Y, Z.
    pub(super) has_linear: [bool; 3],
    /// Whether no rotary axis stands between the bed and a linear axis.
    pub(super) linear_on_bed: bool,
    /// Rows (0, 1, 2: about X, Y, Z) of the rotary axes that carry the workpiece, from the bed outwards.
    pub(super) table_rows: Vec<usize>,
}

/// One member with its errors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Link {
    pub(super) member: Member,
    motions: Motions,
    pub(super) joint: Joint,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Joint {
    Linear {
        nominal_direction: Vector3<f64>,
        /// True direction of motion.
        direction: Vector3<f64>,
    },
    Rotary {
        /// 0, 1 or 2: about X, Y or Z.
        row: usize,
        /// Angle of the tip per unit of the position.
        sense: f64,
        nominal_origin_mm: Vector3<f64>,
        /// A point of the true line, and its direction.
        origin_mm: Vector3<f64>,
        direction: Vector3<f64>,
        /// Zero position, turn of the tool relative to the workpiece.
        zero_rad: f64,
    },
}

/// Nominal and actual tip in the workpiece frame, mm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tips {
    pub(super) nominal_mm: Vector3<f64>,
    pub(super) actual_mm: Vector3<f64>,
    /// Sine and cosine of the nominal turn of the tip about X, Y and Z.
    pub(super) turn: [SinCos; 3],
}

impl VolumetricModel {
    /// The errors of one published model. Poses outside the recorded spans are refused until
    /// [`Self::with_extrapolate`] says otherwise.
    ///
    /// # Errors
    /// When the model is of another machine or a curve of it is not one.
    pub fn new(kinematics: &Kinematics, model: &GeometryModel) -> Result<Self, VolumetricError> {
        Self::merged(kinematics, &[model])
    }

    /// The errors of several published models of the same machine together, e.g. those of the linear and
    /// those of the rotary axes. Without any, the nominal machine.
    ///
    /// # Errors
    /// As [`Self::new`], and when two of them give the same component.
    pub fn merged(
        kinematics: &Kinematics,
        models: &[&GeometryModel],
    ) -> Result<Self, VolumetricError> {
        let chain = kinematics.chain();
        let mut motions = PerAxis::from_fn(|_| Motions::NONE);
        let mut locations: Vec<(ErrorComponent, f64)> = Vec::new();
        let mut seen = Vec::new();
        for model in models {
            check_chain(chain, &model.chain)?;
            for curve in &model.curves {
                let component = curve.component;
                check_component(chain, component)?;
                curve::check(curve)?;
                if seen.contains(&component) {
                    return Err(VolumetricError::Duplicate { component });
                }
                seen.push(component);
                match curve.coefficient.first() {
                    Some(&value) if component.is_location => locations.push((component, value)),
                    _ => motions[component.of].add(curve),
                }
            }
        }
        let links: Vec<_> = members(chain)
            .map(|member| Link {
                member,
                joint: joint(kinematics, member, &locations),
                motions: motions[member.axis].clone(),
            })
            .collect();
        Ok(Self {
            has_linear: Axis::LINEAR.map(|axis| chain.axes().contains(axis)),
            has_shifted_datum: links.iter().any(Link::shifts_datum),
            table_rows: links.iter().rev().filter_map(Link::table_row).collect(),
            links,
            locations,
            policy: Extrapolate::Refuse,
            linear_on_bed: linear_on_bed(chain),
        })
    }

    /// The same with another policy for positions outside the recorded spans.
    #[must_use]
    pub const fn with_extrapolate(mut self, policy: Extrapolate) -> Self {
        self.policy = policy;
        self
    }

    /// Value of a component at a position of its axis, mm or rad; `None` for an axis that the chain lacks.
    #[must_use]
    pub fn component_value(&self, component: ErrorComponent, position: f64) -> Option<f64> {
        if component.is_location {
            let found = self.locations.iter().find(|(c, _)| *c == component);
            return found.map(|(_, value)| *value);
        }
        let link = self.links.iter().find(|l| l.member.axis == component.of)?;
        Some(link.motions.at(position, self.policy)[lane(component.direction)])
    }

    /// Error of the tip (actual minus nominal, tool relative to workpiece) in the workpiece frame, mm.
    ///
    /// # Errors
    /// When a number is not finite, or a position is outside the recorded span and the policy refuses it.
    pub fn tip_error_mm(
        &self,
        positions: &PerAxis<f64>,
        tool_offset_mm: &Vector3<f64>,
    ) -> Result<Vector3<f64>, PoseRefusal> {
        self.check_pose(positions, tool_offset_mm)?;
        let tips = self.tips(positions, tool_offset_mm);
        Ok(tips.actual_mm - tips.nominal_mm)
    }

    /// Whether a pose has an answer.
    #[inline]
    pub(super) fn check_pose(
        &self,
        positions: &PerAxis<f64>,
        tool_offset_mm: &Vector3<f64>,
    ) -> Result<(), PoseRefusal> {
        // A sum that is finite has no summand that is not.
        let sum = self.links.iter().fold(tool_offset_mm.sum(), |sum, link| {
            sum + positions[link.member.axis]
        });
        if self.policy != Extrapolate::Refuse && sum.is_finite() {
            return Ok(());
        }
        self.look_at_pose(positions, tool_offset_mm)
    }

    /// [`Self::check_pose`], number by number.
    fn look_at_pose(
        &self,
        positions: &PerAxis<f64>,
        tool_offset_mm: &Vector3<f64>,
    ) -> Result<(), PoseRefusal> {
        for (axis, offset_mm) in Axis::LINEAR.into_iter().zip(tool_offset_mm) {
            if !offset_mm.is_finite() {
                return Err(PoseRefusal::ToolOffsetNotFinite { axis });
            }
        }
        for link in &self.links {
            let axis = link.member.axis;
            let position = positions[axis];
            if !position.is_finite() {
                return Err(PoseRefusal::PositionNotFinite { axis });
            }
            let (lower, upper) = link.motions.span();
            if self.policy == Extrapolate::Refuse && !(lower <= position && position <= upper) {
                return Err(PoseRefusal::OutOfSpan {
                    axis,
                    position,
                    lower,
                    upper,
                });
            }
        }
        Ok(())
    }

    /// Both tips at a pose that [`Self::check_pose`] lets pass.
    #[inline]
    pub(super) fn tips(&self, positions: &PerAxis<f64>, tool_offset_mm: &Vector3<f64>) -> Tips {
        let mut tips = Tips {
            nominal_mm: *tool_offset_mm,
            actual_mm: *tool_offset_mm,
            turn: [(0.0, 1.0); 3],
        };
        for link in &self.links {
            let position = positions[link.member.axis];
            link.move_on(position, &link.motions.at(position, self.policy), &mut tips);
        }
        if self.has_shifted_datum {
            self.take_up_zero_positions(positions, &mut tips);
        }
        tips
    }

    /// The workpiece datum with rotary axes at zero takes up the zero positions of the tables: each
    /// turn about its line is undone, from the workpiece outwards.
    fn take_up_zero_positions(&self, positions: &PerAxis<f64>, tips: &mut Tips) {
        let mut shift_mm = Vector3::zeros();
        for link in self
            .links
            .iter()
            .rev()
            .filter(|l| l.member.carries_workpiece)
        {
            match &link.joint {
                Joint::Linear { .. } => {
                    shift_mm += direction_of(link.member.axis) * positions[link.member.axis];
                }
                Joint::Rotary {
                    nominal_origin_mm,
                    zero_rad,
                    ..
                } => {
                    let line_mm = nominal_origin_mm + shift_mm;
                    let turn = direction_of(link.member.axis) * -zero_rad;
                    tips.actual_mm = line_mm + turned(&turn, &(tips.actual_mm - line_mm));
                }
            }
        }
    }
}

impl Link {
    pub(super) const fn is_rotary(&self) -> bool {
        matches!(self.joint, Joint::Rotary { .. })
    }

    /// The row of a rotary axis that carries the workpiece.
    fn table_row(&self) -> Option<usize> {
        let is_table = self.member.carries_workpiece && self.is_rotary();
        is_table.then(|| self.member.axis.index() % 3)
    }

    fn shifts_datum(&self) -> bool {
        matches!(self.joint, Joint::Rotary { zero_rad, .. } if zero_rad.abs() > 0.0)
            && self.member.carries_workpiece
    }

    /// Moves both tips through this member.
    #[inline(always)]
    fn move_on(&self, position: f64, motions: &Lanes, tips: &mut Tips) {
        let [ex, ey, ez, _, ea, eb, ec, _] = *motions;
        let (shift_mm, turn_rad) = (Vector3::new(ex, ey, ez), Vector3::new(ea, eb, ec));
        let actual_mm = tips.actual_mm;
        match &self.joint {
            Joint::Linear {
                nominal_direction,
                direction,
            } => {
                tips.nominal_mm += nominal_direction * position;
                let along_mm = direction * position;
                tips.actual_mm = if self.member.carries_workpiece {
                    shift_mm + turned(&turn_rad, &(actual_mm + along_mm))
                } else {
                    shift_mm + turned(&turn_rad, &actual_mm) + along_mm
                };
            }
            Joint::Rotary {
                row,
                sense,
                nominal_origin_mm,
                origin_mm,
                direction,
                zero_rad,
            } => {
                let angle_rad = sense * position;
                let nominal = sin_cos(angle_rad);
                tips.turn[*row] = nominal;
                let arm_mm = tips.nominal_mm - nominal_origin_mm;
                tips.nominal_mm = nominal_origin_mm + turned_about(*row, nominal, &arm_mm);
                let actual = if zero_rad.abs() > 0.0 {
                    sin_cos(angle_rad + zero_rad)
                } else {
                    nominal
                };
                let error_at = |point_mm: Vector3<f64>| {
                    nominal_origin_mm
                        + shift_mm
                        + turned(&turn_rad, &(point_mm - nominal_origin_mm))
                };
                let joint_at = |point_mm: Vector3<f64>| {
                    origin_mm + turned_by(direction, actual, &(point_mm - origin_mm))
                };
                tips.actual_mm = if self.member.carries_workpiece {
                    joint_at(error_at(actual_mm))
                } else {
                    error_at(joint_at(actual_mm))
                };
            }
        }
    }
}

/// True direction or line of a member.
fn joint(kinematics: &Kinematics, member: Member, locations: &[(ErrorComponent, f64)]) -> Joint {
    let axis = member.axis;
    let value = |direction| {
        let wanted = ErrorComponent::location(direction, axis);
        let found = locations.iter().find(|(component, _)| *component == wanted);
        found.map_or(0.0, |(_, value)| *value)
    };
    let shift_mm = Vector3::from(Axis::LINEAR.map(value));
    let mut tilt_rad = Vector3::from(Axis::ROTARY.map(value));
    if axis.is_linear() {
        return Joint::Linear {
            nominal_direction: direction_of(axis),
            direction: turned(&tilt_rad, &direction_of(axis)),
        };
    }
    tilt_rad[axis.index() % 3] = 0.0;
    let nominal_origin_mm = kinematics.origin_mm(axis);
    Joint::Rotary {
        row: axis.index() % 3,
        sense: member.sense(kinematics.table_sense()),
        nominal_origin_mm,
        origin_mm: nominal_origin_mm + shift_mm,
        direction: turned(&tilt_rad, &direction_of(axis)),
        zero_rad: value(axis),
    }
}

fn check_chain(chain: &Chain, of_model: &str) -> Result<(), VolumetricError> {
    let parsed: Chain = of_model
        .parse()
        .map_err(|error| VolumetricError::ChainUnreadable {
            chain: of_model.to_owned(),
            error,
        })?;
    if parsed == *chain {
        return Ok(());
    }
    Err(VolumetricError::ChainDiffers {
        found: parsed.to_string(),
        expected: chain.to_string(),
    })
}

fn check_component(chain: &Chain, component: ErrorComponent) -> Result<(), VolumetricError> {
    if has_component(chain, component) {
        return Ok(());
    }
    let chain_axes = chain.axes();
    let chain = chain.to_string();
    Err(if chain_axes.contains(component.of) {
        VolumetricError::NoSuchLocation { component, chain }
    } else {
        VolumetricError::NoSuchAxis { component, chain }
    })
}

fn linear_on_bed(chain: &Chain) -> bool {
    let outwards = [
        chain
            .workpiece_side()
            .iter()
            .rev()
            .copied()
            .collect::<Vec<_>>(),
        chain.tool_side().to_vec(),
    ];
    outwards.iter().all(|side| {
        let rest = side.iter().skip_while(|axis| axis.is_linear());
        rest.into_iter().all(|axis| !axis.is_linear())
    })
}
