//! Positioning deviations of one axis as they are published.

use crate::axis::Axis;
use crate::stamp::{Host, Stamp};

/// Mean deviation per point: scale minus motor encoder, from runs in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct PositioningTable {
    /// When it was last refreshed.
    pub at: Stamp<Host>,
    /// The axis.
    pub axis: Axis,
    /// Points by ascending position, mm or rad.
    pub position: Vec<f64>,
    /// Mean deviation at each point in runs towards greater positions, mm or rad.
    pub deviation_up: Vec<f64>,
    /// The same towards smaller positions; equal to `deviation_up` when both are taken together.
    pub deviation_down: Vec<f64>,
    /// Runs behind the table.
    pub n_runs: u32,
    /// Weight omega of a new measurement, 0 to 0.3.
    pub weight: f64,
    /// Counts refreshes since the node started.
    pub sequence: u32,
}
