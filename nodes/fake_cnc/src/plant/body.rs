//! Where the tool really is against the workpiece: chain, error motions and warm structure together.
//!
//! ```text
//!   joint j:  M_j(q_j) = nominal motion along its true line, float F_j(q_j, t), error motion E_j(q_j)  (1)
//!   workpiece_from_tool = (B M_w1 .. M_wm)^-1 (M_t1 .. H .. M_tn)                              (2)
//! ```
//!
//! `H`, the warm column and head, stands before the tool side's first rotary axis (at its end where
//! there is none); `B` is the warm bed. The heat of the screws is already in the slides' positions
//! that come in.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use machine::MachineFile;
use machine::file::AxisEntry;
use metrology::{Axis, PerAxis};
use nalgebra::{Rotation3, Vector3};

use super::chain::{Chain, Joint, Rigid, nominal_direction, shift};
use super::error::{PlantError, require_finite, require_not_negative};
use super::error_motion::ErrorMotion;
use super::file::{
    GeometryEntry, LinearErrorEntry, OilFilmEntry, RotaryErrorEntry, VibrationEntry,
};
use super::guide_form::GuideForm;
use super::oil_film::OilFilm;
use super::structure::Structure;
use super::vibration::Vibration;

/// One joint with its true line.
#[derive(Clone, Debug)]
struct TrueJoint {
    joint: Joint,
    nominal_origin_mm: Vector3<f64>,
    origin_mm: Vector3<f64>,
    direction: Vector3<f64>,
    lead_error: f64,
    errors: ErrorMotion,
    film: Option<OilFilm>,
}

/// The chain with its true geometry.
#[derive(Clone, Debug)]
pub(super) struct Body {
    workpiece_side: Vec<TrueJoint>,
    tool_side: Vec<TrueJoint>,
    /// How many joints of the tool side stand before column and head.
    before_head: usize,
    head_moves_in_z: bool,
    table_moves_in_y: bool,
    vibration: Option<Vibration>,
}

impl Body {
    pub(super) fn new(
        machine: &MachineFile,
        geometry: &GeometryEntry,
        seed: u64,
    ) -> Result<Self, PlantError> {
        let chain = Chain::parse(&machine.chain)?;
        for joint in chain.joints() {
            if !machine.axes.contains_key(&joint.axis) {
                return Err(PlantError::AxisMissing {
                    place: "axes",
                    axis: joint.axis,
                });
            }
        }
        for &axis in machine.axes.keys() {
            if !chain.joints().any(|joint| joint.axis == axis) {
                return Err(PlantError::AxisMissing {
                    place: "chain",
                    axis,
                });
            }
        }
        let build = |joints: &[Joint]| {
            joints
                .iter()
                .map(|joint| TrueJoint::new(*joint, machine, geometry, seed))
                .collect::<Result<Vec<_>, _>>()
        };
        let before_head = chain
            .tool_side
            .iter()
            .take_while(|joint| joint.axis.is_linear())
            .count();
        Ok(Self {
            workpiece_side: build(&chain.workpiece_side)?,
            tool_side: build(&chain.tool_side)?,
            before_head,
            table_moves_in_y: chain
                .workpiece_side
                .iter()
                .any(|joint| joint.axis == Axis::Y),
            head_moves_in_z: chain.tool_side.iter().any(|joint| joint.axis == Axis::Z),
            vibration: None,
        })
    }

    /// Puts oil under the slides.
    pub(super) fn floating(
        mut self,
        machine: &MachineFile,
        films: &BTreeMap<Axis, OilFilmEntry>,
        seed: u64,
    ) -> Result<Self, PlantError> {
        for (&axis, entry) in films {
            let (Some(linear), Some(joint)) = (machine.linear(axis), self.joint_mut(axis)) else {
                return Err(PlantError::AxisUnknown {
                    place: "oil_film",
                    axis,
                });
            };
            let travel_mm = linear.travel_mm[1] - linear.travel_mm[0];
            joint.film = Some(OilFilm::draw(seed, axis, travel_mm, entry)?);
        }
        Ok(self)
    }

    /// Lets the tool shake.
    pub(super) fn shaking(
        mut self,
        entry: Option<&VibrationEntry>,
        seed: u64,
    ) -> Result<Self, PlantError> {
        self.vibration = entry.map(|entry| Vibration::new(entry, seed)).transpose()?;
        Ok(self)
    }

    fn joint_mut(&mut self, axis: Axis) -> Option<&mut TrueJoint> {
        self.joints_mut().find(|joint| joint.joint.axis == axis)
    }

    fn joints_mut(&mut self) -> impl Iterator<Item = &mut TrueJoint> {
        self.tool_side.iter_mut().chain(&mut self.workpiece_side)
    }

    /// Lets time pass under the slides.
    pub(super) fn pass(&mut self, period_s: f64) {
        for film in self.joints_mut().filter_map(|joint| joint.film.as_mut()) {
            film.pass(period_s);
        }
        if let Some(vibration) = &mut self.vibration {
            vibration.pass(period_s);
        }
    }

    /// Tool tip in the workpiece frame of a perfect cold machine, mm.
    pub(super) fn nominal_tip_mm(&self, position: &PerAxis<f64>) -> Vector3<f64> {
        let walk = |joints: &[TrueJoint]| {
            joints.iter().fold(Rigid::identity(), |frame, joint| {
                let axis = joint.joint.axis;
                let direction = nominal_direction(axis);
                frame
                    * joint
                        .joint
                        .motion(position[axis], &direction, &joint.nominal_origin_mm)
            })
        };
        let tip = walk(&self.tool_side) * nalgebra::Point3::origin();
        walk(&self.workpiece_side)
            .inverse_transform_point(&tip)
            .coords
    }

    /// Error of the slide along its own axis, as a scale beside it would see, mm.
    pub(super) fn along_error_mm(&self, axis: Axis, q_mm: f64) -> f64 {
        self.tool_side
            .iter()
            .chain(&self.workpiece_side)
            .find(|joint| joint.joint.axis == axis)
            .map_or(0.0, |joint| {
                // A table that lags behind its place leaves the tool ahead of the workpiece.
                let sign = if joint.joint.on_workpiece_side {
                    -1.0
                } else {
                    1.0
                };
                let floats_mm = joint
                    .film
                    .as_ref()
                    .map_or(0.0, |film| film.component_mm(axis.index(), q_mm));
                let own_mm = joint.errors.component(axis.index(), q_mm) + floats_mm;
                q_mm * joint.lead_error + sign * own_mm
            })
    }

    /// (2): tool against workpiece with the slides at `slide`.
    pub(super) fn workpiece_from_tool(&self, slide: &PerAxis<f64>, structure: &Structure) -> Rigid {
        let walk = |frame: Rigid, joints: &[TrueJoint]| {
            joints.iter().fold(frame, |frame, joint| {
                frame * joint.motion(slide[joint.joint.axis])
            })
        };
        let head_z_mm = if self.head_moves_in_z {
            slide[Axis::Z]
        } else {
            0.0
        };
        let (before, after) = self.tool_side.split_at(self.before_head);
        let head = walk(Rigid::identity(), before) * structure.tool_side(head_z_mm);
        let tool = walk(head, after);
        let table_y_mm = if self.table_moves_in_y {
            slide[Axis::Y]
        } else {
            0.0
        };
        let table = walk(structure.workpiece_side(table_y_mm), &self.workpiece_side);
        let mut shaken = table.inverse() * tool;
        if let Some(vibration) = &self.vibration {
            shaken.translation.vector += vibration.at_mm();
        }
        shaken
    }
}

impl TrueJoint {
    fn new(
        joint: Joint,
        machine: &MachineFile,
        geometry: &GeometryEntry,
        seed: u64,
    ) -> Result<Self, PlantError> {
        let axis = joint.axis;
        match machine.axes.get(&axis) {
            Some(AxisEntry::Linear(linear)) => {
                let entry = geometry.linear.get(&axis).ok_or(PlantError::AxisMissing {
                    place: "geometry.linear",
                    axis,
                })?;
                Self::linear(joint, entry, geometry, linear.travel_mm, seed)
            }
            _ => {
                let entry = geometry.rotary.get(&axis).ok_or(PlantError::AxisMissing {
                    place: "geometry.rotary",
                    axis,
                })?;
                let origin_mm = machine
                    .rotary
                    .as_ref()
                    .and_then(|rotary| rotary.origin_mm.get(&axis))
                    .ok_or(PlantError::AxisMissing {
                        place: "rotary.origin_mm",
                        axis,
                    })?;
                Self::rotary(joint, entry, Vector3::from(*origin_mm), seed)
            }
        }
    }

    fn linear(
        joint: Joint,
        entry: &LinearErrorEntry,
        geometry: &GeometryEntry,
        travel_mm: [f64; 2],
        seed: u64,
    ) -> Result<Self, PlantError> {
        let axis = joint.axis;
        let at = |key: &str| format!("geometry.linear.{axis}.{key}");
        require_not_negative(at("positioning_um"), entry.positioning_um)?;
        require_not_negative(at("straightness_um"), entry.straightness_um)?;
        require_not_negative(at("angular_urad"), entry.angular_urad)?;
        require_finite(at("lead_um_per_m"), entry.lead_um_per_m)?;
        for value in entry.carriage_mm {
            require_finite(at("carriage_mm"), value)?;
        }
        let squareness = &geometry.squareness_urad;
        let lean = match axis {
            Axis::Y => Vector3::new(squareness.y_to_x, 0.0, 0.0),
            Axis::Z => Vector3::new(squareness.z_to_x, squareness.z_to_y, 0.0),
            _ => Vector3::zeros(),
        };
        for value in lean.iter() {
            require_finite("geometry.squareness_urad", *value)?;
        }
        let mut deviation = [entry.straightness_um / 1e3; 6];
        deviation[axis.index()] = entry.positioning_um / 1e3;
        deviation[3..].fill(entry.angular_urad / 1e6);
        let centre_mm = Vector3::from(entry.carriage_mm);
        let span_mm = travel_mm[1] - travel_mm[0];
        let forms =
            entry.form.iter().enumerate().map(|(index, form)| {
                GuideForm::new(&at(&format!("form[{index}]")), form, travel_mm)
            });
        let forms = forms.collect::<Result<_, _>>()?;
        Ok(Self {
            joint,
            nominal_origin_mm: Vector3::zeros(),
            origin_mm: Vector3::zeros(),
            direction: nominal_direction(axis) + lean / 1e6,
            lead_error: entry.lead_um_per_m / 1e6,
            errors: ErrorMotion::draw(seed, axis, PI / span_mm, &deviation, centre_mm)
                .with_forms(forms),
            film: None,
        })
    }

    fn rotary(
        joint: Joint,
        entry: &RotaryErrorEntry,
        nominal_origin_mm: Vector3<f64>,
        seed: u64,
    ) -> Result<Self, PlantError> {
        let axis = joint.axis;
        let at = |key: &str| format!("geometry.rotary.{axis}.{key}");
        require_not_negative(at("run_out_um"), entry.run_out_um)?;
        require_not_negative(at("wobble_urad"), entry.wobble_urad)?;
        require_not_negative(at("positioning_urad"), entry.positioning_urad)?;
        for (key, values) in [
            ("location_um", entry.location_um),
            ("tilt_urad", entry.tilt_urad),
        ] {
            for value in values {
                require_finite(at(key), value)?;
            }
        }
        let mut deviation = [entry.run_out_um / 1e3; 6];
        deviation[3..].fill(entry.wobble_urad / 1e6);
        deviation[axis.index()] = entry.positioning_urad / 1e6;
        let tilt = Rotation3::new(Vector3::from(entry.tilt_urad) / 1e6);
        let origin_mm = nominal_origin_mm + Vector3::from(entry.location_um) / 1e3;
        Ok(Self {
            joint,
            nominal_origin_mm,
            origin_mm,
            direction: tilt * nominal_direction(axis),
            lead_error: 0.0,
            errors: ErrorMotion::draw(seed, axis, 1.0, &deviation, origin_mm),
            film: None,
        })
    }

    /// (1).
    fn motion(&self, q: f64) -> Rigid {
        let along = q * (1.0 + self.lead_error);
        let guided = self.joint.motion(along, &self.direction, &self.origin_mm);
        match &self.film {
            Some(film) => guided * shift(film.shift_mm(q)) * self.errors.rigid(q),
            None => guided * self.errors.rigid(q),
        }
    }
}

#[cfg(test)]
mod tests;
