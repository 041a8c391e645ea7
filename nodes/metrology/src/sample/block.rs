//! A reference block's corner, measured by three touches.

use crate::axis::PerAxis;
use crate::stamp::{Host, Stamp};

/// One face of a block: where it lies along its own normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacePosition {
    /// Position along the face's axis, mm, machine reading with compensation included.
    pub position_mm: f64,
    /// Standard uncertainty, mm.
    pub standard_uncertainty_mm: f64,
    /// When it was touched.
    pub at: Stamp<Host>,
}

/// Three faces of one block, each probed only along its own normal.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMeasurement {
    /// When the last face was touched.
    pub at: Stamp<Host>,
    /// Block name in the machine file.
    pub block_id: String,
    /// X, Y and Z faces; rotary entries are unused. `None`: that face was not measured.
    pub faces: PerAxis<Option<FacePosition>>,
    /// Whether this is the cold reference.
    pub cold: bool,
    /// The run (see `TestSegment`) in which it was measured.
    pub run: u32,
}
