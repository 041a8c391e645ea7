//! The frames of a machine: where each of its bodies is, as a tree below its bed.
//!
//! Every frame is right-handed. With all axes at zero each of them but those of plates and beams has the directions
//! of the linear axes (ISO 841), and so has the bed's always. The tree is:
//!
//! ```text
//!   base_link                  the bed; its origin is where the machine's zero lies with all axes at zero
//!     machine                  the machine coordinate system, in which axis positions are read
//!     x_slide ... a_rotary     what each axis moves, in the order of the chain, on both sides
//!       spindle_nose           on the last body of the tool side
//!         probe_tip            centre of the mounted stylus' ball
//!           grid_head/ID, reflector/ID
//!       workpiece              on the last body of the workpiece side
//!         table, block/ID, artefact/ID, grid/ID, beam/ID
//! ```
//!
//! The pose of a body in the one that carries it, and of the machine coordinate system in the bed:
//!
//! ```text
//!   parent_from_body = T(o_body - o_parent) M(s q),   M(linear) = T(s q e),  M(rotary) = R(e, s q)    (1)
//!   base_from_machine = T(-sum_{linear axes that move the workpiece} q e)                             (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | q | position of the axis | mm, rad |
//! | e | direction along or about which it moves, all axes at zero | 1 |
//! | s | -1 for a linear axis that moves the workpiece, for rotary ones as [`TableSense`] says, else 1 | 1 |
//! | o | origin of a body with all axes at zero: the machine's zero for slides, `rotary.origin_mm` for rotary axes | mm |
//!
//! A slide's frame is thus at the machine's zero and not at its casting, whose place no machine file tells. (2) moves with
//! the slides under the workpiece, since a position says where the ball is relative to the workpiece; it never turns.
//!
//! # Holds when
//! Nominal geometry, as in [`crate::kinematics`]: no error of the machine is in it.
//!
//! # Agreement
//! `prop_frames_compose_to_the_machines_kinematics`: below 1e-9 mm and 1e-12 rad.
//!
//! # References
//! \[1\] ISO 841:2001. \[2\] REP 103, REP 105 of ROS: units, handedness, `base_link`.

use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::chain::ChainError;
use crate::file::{ArtefactEntry, MachineFile};
use crate::kinematics::{Kinematics, TableSense, direction_of};

/// The bed.
pub const BASE: &str = "base_link";
/// The machine coordinate system.
pub const MACHINE: &str = "machine";
/// What is clamped; equals the machine coordinate system with all axes at zero.
pub const WORKPIECE: &str = "workpiece";
/// Top of the table at its middle.
pub const TABLE: &str = "table";
/// Where the stylus is mounted.
pub const SPINDLE_NOSE: &str = "spindle_nose";
/// Centre of the mounted stylus' ball.
pub const PROBE_TIP: &str = "probe_tip";

/// One axis' part in the motion of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Joint {
    axis: Axis,
    sense: f64,
}

/// A frame and how it moves in its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    name: String,
    parent: String,
    place: Isometry3<f64>,
    joints: Vec<Joint>,
}

/// All frames of a machine; a parent comes before its children.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTree {
    frames: Vec<Frame>,
}

impl Frame {
    /// Its name, without a machine's prefix.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The frame in which its pose is told.
    #[must_use]
    pub fn parent(&self) -> &str {
        &self.parent
    }

    /// The axes that move it in its parent; none: it is fixed there.
    #[must_use]
    pub fn axes(&self) -> AxisSet {
        self.joints.iter().map(|joint| joint.axis).collect()
    }

    /// Its pose in its parent at these positions (mm, rad), equations (1) and (2); mm.
    #[must_use]
    pub fn parent_from_frame(&self, positions: &PerAxis<f64>) -> Isometry3<f64> {
        self.joints.iter().fold(self.place, |pose, joint| {
            pose * motion(joint.axis, joint.sense * positions[joint.axis])
        })
    }
}

/// M of equation (1).
fn motion(axis: Axis, amount: f64) -> Isometry3<f64> {
    let direction = direction_of(axis);
    if axis.is_linear() {
        return Isometry3::from_parts(
            Translation3::from(direction * amount),
            UnitQuaternion::identity(),
        );
    }
    let turn = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(direction), amount);
    Isometry3::from_parts(Translation3::identity(), turn)
}

fn at(place_mm: Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(place_mm), UnitQuaternion::identity())
}

/// A place with the directions of `columns`, which are orthogonal unit vectors, right-handed.
fn turned(place_mm: Vector3<f64>, columns: [Vector3<f64>; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(place_mm),
        UnitQuaternion::from_basis_unchecked(&columns),
    )
}

/// Three directions of which the first is `forward`, REP 103's x.
fn along(forward: Vector3<f64>) -> [Vector3<f64>; 3] {
    let across = Vector3::from_fn(|row, _| f64::from(u8::from(row == forward.iamin())));
    let up = forward.cross(&across).normalize();
    [forward, up.cross(&forward), up]
}

impl FrameTree {
    /// Every frame whose place the machine file tells.
    ///
    /// # Errors
    /// When the chain cannot be read.
    pub fn new(file: &MachineFile) -> Result<Self, ChainError> {
        let kinematics = Kinematics::new(file)?;
        let chain = kinematics.chain();
        let table = match kinematics.table_sense() {
            TableSense::Table => 1.0,
            TableSense::Tool => -1.0,
        };
        let carrying = |axis: Axis| if axis.is_linear() { -1.0 } else { table };
        let mut tree = Self { frames: Vec::new() };
        let moving = chain.workpiece_side().iter().copied();
        let slides = moving.filter(|axis| axis.is_linear());
        let joints = slides.map(|axis| Joint { axis, sense: -1.0 }).collect();
        tree.push(MACHINE, BASE, Isometry3::identity(), joints);
        let tool = chain.tool_side().iter().map(|&axis| (axis, 1.0));
        let (last, origin_mm) = tree.bodies(&kinematics, tool);
        tree.tool(file, &last, &origin_mm);
        let workpiece = chain.workpiece_side().iter().rev();
        let workpiece = workpiece.map(|&axis| (axis, carrying(axis)));
        let (last, origin_mm) = tree.bodies(&kinematics, workpiece);
        tree.fix(WORKPIECE, &last, at(-origin_mm));
        tree.on_table(file);
        Ok(tree)
    }

    /// The frames, a parent before its children.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The axes that move anything.
    #[must_use]
    pub fn axes(&self) -> AxisSet {
        let joints = self.frames.iter().flat_map(|frame| &frame.joints);
        joints.map(|joint| joint.axis).collect()
    }

    fn push(&mut self, name: &str, parent: &str, place: Isometry3<f64>, joints: Vec<Joint>) {
        self.frames.push(Frame {
            name: name.to_owned(),
            parent: parent.to_owned(),
            place,
            joints,
        });
    }

    fn fix(&mut self, name: &str, parent: &str, place: Isometry3<f64>) {
        self.push(name, parent, place, Vec::new());
    }

    /// What the axes of one side move, from the bed on; name of the last body, and its origin with all axes at zero.
    fn bodies(
        &mut self,
        kinematics: &Kinematics,
        side: impl Iterator<Item = (Axis, f64)>,
    ) -> (String, Vector3<f64>) {
        let (mut parent, mut parent_mm) = (BASE.to_owned(), Vector3::zeros());
        for (axis, sense) in side {
            let (kind, origin_mm) = if axis.is_linear() {
                ("slide", Vector3::zeros())
            } else {
                ("rotary", kinematics.origin_mm(axis))
            };
            let name = format!("{}_{kind}", axis.letter().to_ascii_lowercase());
            let joints = vec![Joint { axis, sense }];
            self.push(&name, &parent, at(origin_mm - parent_mm), joints);
            (parent, parent_mm) = (name, origin_mm);
        }
        (parent, parent_mm)
    }

    fn tool(&mut self, file: &MachineFile, last: &str, origin_mm: &Vector3<f64>) {
        let length_mm = file.mounted_stylus().map_or(0.0, |stylus| stylus.length_mm);
        let up = Vector3::z() * length_mm;
        self.fix(SPINDLE_NOSE, last, at(up - origin_mm));
        self.fix(PROBE_TIP, SPINDLE_NOSE, at(-up));
    }

    /// Table, blocks, artefacts and instruments, with the parts of these that ride on the tool.
    fn on_table(&mut self, file: &MachineFile) {
        if let Some(table) = &file.table {
            self.fix(TABLE, WORKPIECE, at(Vector3::z() * table.top_z_mm));
        }
        for block in &file.blocks {
            let name = format!("block/{}", block.id);
            self.fix(&name, WORKPIECE, at(Vector3::from(block.corner_mm)));
        }
        for artefact in &file.artefacts {
            let (id, place_mm) = match artefact {
                ArtefactEntry::Sphere { id, centre_mm, .. }
                | ArtefactEntry::Bore { id, centre_mm, .. }
                | ArtefactEntry::Boss { id, centre_mm, .. } => (id, centre_mm),
                ArtefactEntry::Plane { id, point_mm, .. } => (id, point_mm),
            };
            let name = format!("artefact/{id}");
            self.fix(&name, WORKPIECE, at(Vector3::from(*place_mm)));
        }
        for placement in file.grid_encoder.iter().flat_map(|grid| &grid.placements) {
            let columns = placement.plane.axes().map(direction_of);
            let plate = turned(placement.centre_mm.into(), columns);
            let head = turned(placement.tool_offset_mm.into(), columns);
            self.fix(&format!("grid/{}", placement.id), WORKPIECE, plate);
            self.fix(&format!("grid_head/{}", placement.id), PROBE_TIP, head);
        }
        for beam in file
            .length_reference
            .iter()
            .flat_map(|length| &length.beams)
        {
            let columns = along(beam.direction());
            let offset_mm = Vector3::from(beam.tool_offset_mm);
            let begin = turned(Vector3::from(beam.from_mm) + offset_mm, columns);
            let reflector = turned(offset_mm, columns);
            self.fix(&format!("beam/{}", beam.id), WORKPIECE, begin);
            self.fix(&format!("reflector/{}", beam.id), PROBE_TIP, reflector);
        }
    }
}
