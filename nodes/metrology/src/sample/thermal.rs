//! The thermal drift model as it is published.

use crate::axis::PerAxis;
use crate::stamp::{Host, Stamp};
use nalgebra::{Matrix2, Vector3};

/// Drift of one axis: `d(p) = k0 + slope (p - p0)`, plus the cross terms of more than two blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisDrift {
    /// Reference position, mm.
    pub p0_mm: f64,
    /// Drift at `p0_mm`, mm.
    pub k0_mm: f64,
    /// Change of drift with position along the axis itself, mm/mm.
    pub slope_mm_per_mm: f64,
    /// Covariance of (k0, slope): mm², mm, 1.
    pub covariance: Matrix2<f64>,
    /// Change of this axis' drift with the *other* coordinates (mm/mm), about `cross_origin_mm`;
    /// the own coordinate's entry is zero. All zero for two blocks.
    pub cross_slope_mm_per_mm: Vector3<f64>,
    /// Origin of the cross terms, machine frame, mm.
    pub cross_origin_mm: Vector3<f64>,
    /// Least and greatest block position along the axis, mm.
    pub span_mm: (f64, f64),
    /// Whether the offset could be estimated.
    pub offset_identifiable: bool,
    /// Whether the slope could be estimated.
    pub slope_identifiable: bool,
    /// Rate of the drift at `p0_mm`, mm/s, used to extrapolate between updates; zero where no time constant is known.
    pub rate_mm_s: f64,
    /// Rate of the slope, 1/s, used likewise: a screw's growth changes the slope, not the offset.
    pub slope_rate_per_s: f64,
    /// Time constant with which both rates decay, s; infinite where unknown.
    pub time_constant_s: f64,
}

/// The thermal model of a machine: drift of the readings since the cold reference.
#[derive(Clone, Debug, PartialEq)]
pub struct ThermalModel {
    /// When it was fitted; extrapolation starts here.
    pub at: Stamp<Host>,
    /// Per linear axis; `None` where the blocks said nothing.
    pub axes: PerAxis<Option<AxisDrift>>,
    /// First instant at which it may be used.
    pub valid_from: Stamp<Host>,
    /// Last instant at which it may be used.
    pub valid_until: Stamp<Host>,
    /// Number of blocks behind it.
    pub n_blocks: u32,
    /// p value of the lack-of-fit test; NaN with two blocks.
    pub lack_of_fit_p: f64,
    /// Whether a jump was seen that awaits confirmation by a second measurement.
    pub quarantined: bool,
    /// Counts models since the node started.
    pub sequence: u32,
}

/// Why new block measurements are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateReason {
    /// tt >= ct.
    Period,
    /// The predicted drift since the last update passed its limit.
    PredictedDrift,
    /// Spindle or feed load changed.
    LoadChange,
    /// A quarantined jump needs a second measurement.
    Confirmation,
}

/// Asks for a block cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateRequest {
    /// When the condition came true.
    pub at: Stamp<Host>,
    /// Which condition.
    pub reason: UpdateReason,
    /// Time since the last update (tt), s.
    pub elapsed_s: f64,
}
