//! The thermal drift model as it is published.

use crate::axis::PerAxis;
use crate::stamp::{Host, Stamp};
use nalgebra::{Matrix4, Vector3};

/// Drift of one axis: `d(r) = k0 + slope (p - p0)`, plus the cross terms of more than two blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisDrift {
    /// Reference position, mm.
    pub p0_mm: f64,
    /// Drift at `p0_mm`, mm.
    pub k0_mm: f64,
    /// Change of drift with position along the axis itself, mm/mm.
    pub slope_mm_per_mm: f64,
    /// Covariance of (k0, change with X, with Y, with Z): mm², mm, 1. The own coordinate's entry is the
    /// slope's. Zero rows: supposed to be zero, not estimated. Where the slope is not identifiable its
    /// variance is the mean square of what the blocks allow, infinite where they allow anything.
    pub covariance: Matrix4<f64>,
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
    /// How the drift goes on between updates, by the faces of X, Y and Z: rotations and shears couple
    /// the axes. `None`: those faces show no time constant.
    pub growth: [Option<DriftGrowth>; 3],
    /// When the last of the axis' faces behind it was touched; a model renewed without new touches
    /// keeps it.
    pub measured_at: Stamp<Host>,
}

/// How a drift grows after the model's instant with one time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftGrowth {
    /// Rate at the model's instant where all levers are zero, mm/s.
    pub rate_mm_s: f64,
    /// Rate of the change with X, Y and Z, 1/s; levers as for the drift itself.
    pub gradient_rate_per_s: Vector3<f64>,
    /// Time constant with which both rates decay, s; infinite: they do not.
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

impl ThermalModel {
    /// When the last face behind it was touched; `None` without an axis.
    #[must_use]
    pub fn measured_at(&self) -> Option<Stamp<Host>> {
        self.axes.0.iter().flatten().map(|d| d.measured_at).max()
    }
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
