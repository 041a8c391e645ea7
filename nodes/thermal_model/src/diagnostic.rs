//! What the stage has to say besides its model; each is in the bag and on `/diagnostics`.

use metrology::Axis;
use metrology::number::number;

use crate::cycle::FaceRefusal;
use crate::load::LoadChange;
use crate::n_block::Term;
use crate::prediction::{Predictor, Score};
use crate::relaxation::Unidentifiable;

pub use metrology::Severity;

/// A condition worth reporting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each sentence names its fields with their units"
)]
pub enum Diagnostic {
    #[error("block \"{block_id}\" is not in the machine file")]
    UnknownBlock { block_id: String },
    #[error("block \"{block_id}\", face {axis}: {reason}")]
    FaceRefused {
        block_id: String,
        axis: Axis,
        reason: FaceRefusal,
    },
    #[error("block \"{block_id}\" was not measured in run {run}")]
    BlockMissing { block_id: String, run: u32 },
    #[error("cold reference taken: {n_faces} faces of {n_expected}")]
    ReferenceTaken { n_faces: usize, n_expected: usize },
    #[error(
        "blocks \"{first}\" and \"{second}\" at the ends of the diagonal differ by {height_mm} mm in height, 150 to 200 mm are wanted: the slope of Z is measured over it; set one of them higher or lower",
        height_mm = number(*height_mm)
    )]
    BlockHeights {
        first: String,
        second: String,
        height_mm: f64,
    },
    #[error("run {run}: blocks measured warm, but there is no cold reference")]
    NoReference { run: u32 },
    #[error("run {run}: no usable face")]
    NoFace { run: u32 },
    #[error("axis {axis}: a face is missing in this cycle, its previous drift is kept")]
    AxisKept { axis: Axis },
    #[error("axis {axis}: not updated for longer than a model is valid, dropped")]
    AxisDropped { axis: Axis },
    #[error(
        "axis {axis}: span {span_mm:.3} mm is below {least_span_mm:.3} mm, no slope; blocks disagree by {inconsistency_mm:.5} mm"
    )]
    SlopeUnidentifiable {
        axis: Axis,
        span_mm: f64,
        least_span_mm: f64,
        inconsistency_mm: f64,
    },
    #[error(
        "fitted {terms:?} to {n_faces} faces, residual {residual_rms_mm:.6} mm, lack-of-fit p {lack_of_fit_p:.4} on {degrees_of_freedom}; not estimable: {left_out:?}"
    )]
    Fitted {
        n_faces: usize,
        terms: Vec<Term>,
        left_out: Vec<Term>,
        degrees_of_freedom: usize,
        lack_of_fit_p: f64,
        residual_rms_mm: f64,
    },
    #[error("drift is not affine in position: lack-of-fit p {lack_of_fit_p:.2e}")]
    LackOfFit { lack_of_fit_p: f64 },
    #[error(
        "block \"{block_id}\", face {axis}: drift jumped by {change_mm:.5} mm, heat allows {limit_mm:.5} mm; kept back until measured again"
    )]
    Quarantined {
        block_id: String,
        axis: Axis,
        change_mm: f64,
        limit_mm: f64,
    },
    #[error("jump confirmed by a second measurement{}", .single_block.as_ref().map_or_else(String::new, |b| format!("; block \"{b}\" alone moved, rebased: {rebased}")))]
    JumpConfirmed {
        single_block: Option<String>,
        rebased: bool,
    },
    #[error("jump contradicted by the next measurement and dropped")]
    JumpContradicted,
    #[error("update overdue: tt {elapsed_s:.0} s, period {period_s:.0} s")]
    UpdateOverdue { elapsed_s: f64, period_s: f64 },
    #[error("clock went back by {by_s} s", by_s = number(*by_s))]
    ClockWentBack { by_s: f64 },
    #[error("load changed: {change:?}")]
    LoadChanged { change: LoadChange },
    #[error("residuals in µm: {score:?}; in use was {used:?}, from now {next:?}")]
    Scored {
        score: Score,
        used: Predictor,
        next: Predictor,
    },
    #[error(
        "axis {axis}: time constant {time_constant_s:.0} s, 95 % interval {lower_s:.0} to {upper_s:.0} s"
    )]
    TimeConstant {
        axis: Axis,
        time_constant_s: f64,
        lower_s: f64,
        upper_s: f64,
    },
    #[error("axis {axis}: no time constant: {reason}")]
    NoTimeConstant { axis: Axis, reason: Unidentifiable },
    #[error(
        "temperatures: left-out residual {left_out_rms_um:.3} µm against {hold_rms_um:.3} µm of holding over {n_increments} increments, proven: {proven}"
    )]
    TemperatureRegression {
        left_out_rms_um: f64,
        hold_rms_um: f64,
        n_increments: usize,
        proven: bool,
    },
    #[error("temperature sensor \"{sensor}\" is not in the machine file")]
    UnknownSensor { sensor: String },
    #[error("temperature sensor \"{sensor}\" gave no finite number")]
    SensorNotFinite { sensor: String },
    #[error("temperature sensor \"{sensor}\" is silent for {age_s:.0} s")]
    SensorStale { sensor: String, age_s: f64 },
    #[error("temperature sensor \"{sensor}\" speaks again")]
    SensorBack { sensor: String },
    #[error("fit refused: {reason}")]
    FitRefused {
        reason: metrology::least_squares::FitError,
    },
}

impl Diagnostic {
    /// How urgent it is.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::ReferenceTaken { .. }
            | Self::Fitted { .. }
            | Self::Scored { .. }
            | Self::TimeConstant { .. }
            | Self::NoTimeConstant { .. }
            | Self::TemperatureRegression { .. }
            | Self::SensorBack { .. }
            | Self::JumpContradicted
            | Self::LoadChanged { .. } => Severity::Info,
            Self::NoReference { .. }
            | Self::NoFace { .. }
            | Self::AxisDropped { .. }
            | Self::FitRefused { .. }
            | Self::Quarantined { .. } => Severity::Error,
            _ => Severity::Warn,
        }
    }

    /// The lasting condition to which it belongs: one of severity `Info` ends what others began.
    #[must_use]
    pub fn condition(&self) -> &'static str {
        match self {
            Self::SlopeUnidentifiable { .. } | Self::Fitted { .. } | Self::LackOfFit { .. } => {
                "fit"
            }
            Self::Quarantined { .. } | Self::JumpConfirmed { .. } | Self::JumpContradicted => {
                "block_jump"
            }
            Self::ClockWentBack { .. } => "clock",
            Self::BlockHeights { .. } => "block_heights",
            Self::LoadChanged { .. } => "load",
            Self::TimeConstant { .. }
            | Self::NoTimeConstant { .. }
            | Self::TemperatureRegression { .. } => "prediction",
            Self::UnknownSensor { .. }
            | Self::SensorNotFinite { .. }
            | Self::SensorStale { .. }
            | Self::SensorBack { .. } => "temperature_sensor",
            _ => "update",
        }
    }
}
