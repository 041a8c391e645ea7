//! The forward model of a machine tool, as simulator, compensation and diagnosis share it.
//!
//! `file` reads the machine file, which describes a machine as its maker would. `chain` is the order
//! of its axes from workpiece to tool; `kinematics` follows from it where ball and workpiece are,
//! `frames` where each body of the machine is, and
//! `orientation` which rotary positions point the probe a given way. `cycle` writes the programs
//! that touch blocks, planes, bores, bosses and spheres, `poses` plans at which rotary poses a sphere tells
//! most. `volumetric` is the geometric error of the tool tip anywhere in the working
//! volume, component by component and all together, and what has to be commanded to undo it.
//! `trajectory` writes the programs that a grid encoder, a laser or a scale measures; `program_frame` is how all of
//! them say that their coordinates are the machine's.
//!
//! Libraries of their own stand on it: `twin` has the effects and simulates a recorded session with any of them,
//! `control_tables` turns measured errors into the tables that other controls load.

pub mod chain;
pub mod cycle;
pub mod error;
pub mod file;
pub mod frames;
pub mod kinematics;
pub mod orientation;
pub mod poses;
pub mod program_frame;
pub mod program_machine;
pub mod trajectory;
pub mod volumetric;

pub use chain::{Chain, ChainError};
pub use error::{CycleError, MachineFileError, OrientationError};
pub use file::MachineFile;
pub use frames::FrameTree;
pub use kinematics::{Kinematics, TableSense};
pub use orientation::Orientation;
pub use poses::{PoseError, SphereDesign};
pub use trajectory::{Trajectory, TrajectoryError};
