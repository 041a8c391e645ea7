//! The geometric part: minus the tip's error from the published geometry models.
//!
//! ```text
//!   offset = command_offset(q, t),   machine::volumetric                              (1)
//!   |e_new(q) - e_old(q)| > jump limit at a pose of the grid   =>  a jump             (2)
//! ```
//!
//! The errors of the linear axes (`geometry/model`) and those of the rotary axes (`geometry/rotary`) are
//! used together; whichever came. (1) is the same for all axes and computed once a state, at the
//! positions commanded by the program, rotary axes included. Linear axes are moved: the position of
//! the tip is compensated, the tool's orientation is not. The linear axes' positions are those of the
//! machine file's functional point; t = `tool_offset_mm` leads from it to the tip that works.
//!
//! Reversal error is none of it: a geometric model is a function of position alone, and what `grid_encoder` finds as lost motion is an unknown of
//! its fit that no message carries. It is compensated in the positioning part, by a table whose directions are `apart`.
//! Of a rotary axis it is not compensated at all.
//!
//! A model is kept back when it changes the tip's error by more than `jump_limit_um` anywhere on a grid of
//! the ends and middles of the axes' travel (2), until the next one, with another number, is
//! like it. The first model of its kind has nothing to be compared with; the limits of the axes hold for it
//! as for all.
//!
//! Whoever measures a geometry model while it is compensated finds what is left: record with
//! compensation off, or the models that follow replace each other by their remainders. EXX, EYY and EZZ
//! and a positioning table describe the same deviation where the grid sees what the scale sees: use one.

mod gate;

use machine::volumetric::PoseRefusal;
use machine::{Kinematics, MachineFile};
use metrology::drift::Extrapolate;
use metrology::parameter::check_parameters_below;
use metrology::sample::GeometryModel;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use gate::{GeometryGate, GeometryPassage, poses};

use crate::error::AxisCompensationError;

/// Limits of `geometry.tool_offset_mm`, mm.
pub(crate) const TOOL_OFFSET_MM: (f64, f64) = (-2000.0, 2000.0);
/// Limits of `geometry.jump_limit_um`, µm.
pub(crate) const JUMP_LIMIT_UM: (f64, f64) = (0.01, 5000.0);

/// Parameters of the geometric part; none of them has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GeometricConfig {
    /// From the machine file's functional point to the tip that works, X Y Z; without geometry no geometry model is
    /// used.
    #[schemars(inner(range(min = TOOL_OFFSET_MM.0, max = TOOL_OFFSET_MM.1)))]
    pub tool_offset_mm: [f64; 3],
    /// Greatest change of the tip's error between two geometry models that is not a jump.
    #[schemars(range(min = JUMP_LIMIT_UM.0, max = JUMP_LIMIT_UM.1))]
    pub jump_limit_um: f64,
}

/// Which of the published models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeometrySource {
    /// `geometry/model`: the linear axes.
    Linear,
    /// `geometry/rotary`: the rotary axes.
    Rotary,
}

impl std::fmt::Display for GeometrySource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Linear => "geometry model",
            Self::Rotary => "rotary geometry model",
        })
    }
}

/// The geometric part of one machine.
#[derive(Clone, Debug)]
pub struct Geometric {
    gate: GeometryGate,
    tool_offset_mm: Vector3<f64>,
    offset: Result<Option<PerAxis<f64>>, PoseRefusal>,
}

impl Geometric {
    /// For a machine, without a model yet.
    ///
    /// # Errors
    /// When the chain of the machine file cannot be read.
    pub fn new(
        config: &GeometricConfig,
        machine: &MachineFile,
        policy: Extrapolate,
    ) -> Result<Self, AxisCompensationError> {
        check_parameters_below("geometry.", config)?;
        let kinematics =
            Kinematics::new(machine).map_err(|source| AxisCompensationError::Chain { source })?;
        let tool_offset_mm = Vector3::from(config.tool_offset_mm);
        let jump_limit_mm = config.jump_limit_um * 1e-3;
        let poses = poses(machine);
        Ok(Self {
            gate: GeometryGate::new(kinematics, policy, jump_limit_mm, tool_offset_mm, poses),
            tool_offset_mm,
            offset: Ok(None),
        })
    }

    /// Judges a new model.
    pub fn offer(&mut self, source: GeometrySource, model: GeometryModel) -> GeometryPassage {
        self.gate.offer(source, model)
    }

    /// One state of the axes: (1). Allocates nothing.
    pub fn observe(&mut self, commanded: &PerAxis<f64>) {
        self.offset = self
            .gate
            .current()
            .map(|model| model.command_offset(commanded, &self.tool_offset_mm))
            .transpose();
    }

    /// Offset of an axis at the last state, mm; none while there is no model.
    ///
    /// # Errors
    /// When the model has no answer there.
    pub fn offset_mm(&self, axis: Axis) -> Result<Option<f64>, PoseRefusal> {
        self.offset.map(|offset| offset.map(|offset| offset[axis]))
    }
}
