//! A reference block's corner, measured by three touches.

use crate::axis::PerAxis;
use crate::stamp::{Host, Stamp};

/// One face of a block: where it lies along its own normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacePosition {
    /// Position along the face's axis, mm, machine reading with compensation included.
    pub position_mm: f64,
    /// Standard uncertainty, mm, the latency's share included.
    pub standard_uncertainty_mm: f64,
    /// Mean instant of its touches.
    pub at: Stamp<Host>,
    /// The latency that was taken out of its touches.
    pub latency: LatencyShare,
}

impl FacePosition {
    /// Standard uncertainty without what it shares with other faces by the latency, mm.
    #[must_use]
    pub fn independent_uncertainty_mm(&self) -> f64 {
        let total_mm2 = self.standard_uncertainty_mm.powi(2);
        (total_mm2 - self.latency.standard_uncertainty_mm().powi(2))
            .max(0.0)
            .sqrt()
    }
}

/// How a position depends on the latency that was taken out of it: an error of that latency is common
/// to all positions corrected by it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LatencyShare {
    /// The latency, s.
    pub latency_s: f64,
    /// Its standard uncertainty, s.
    pub standard_uncertainty_s: f64,
    /// Change of the position with the latency, mm/s: minus the feed along the axis.
    pub sensitivity_mm_s: f64,
}

impl LatencyShare {
    /// Its standard uncertainty in the position, mm.
    #[must_use]
    pub fn standard_uncertainty_mm(&self) -> f64 {
        self.sensitivity_mm_s.abs() * self.standard_uncertainty_s
    }
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
