//! What the stage has to say besides its offsets; each is in the bag and on `/diagnostics`.

use machine::volumetric::VolumetricError;
use metrology::Axis;
use metrology::number::number;
use metrology::sample::CompensationState;

use crate::geometric::GeometrySource;
use crate::parts::PartRefusal;
use crate::positioning::refusal::PositioningRefusal;

pub use metrology::Severity;

/// A condition worth reporting; each is said when it begins, not at every tick.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(
    missing_docs,
    reason = "each sentence names its fields with their units"
)]
pub enum Diagnostic {
    #[error("axis {axis}: {from:?} to {to:?} at an offset of {offset_mm:.6} mm{}", .cause.map_or_else(String::new, |c| format!(": {c}")))]
    StateChanged {
        axis: Axis,
        from: CompensationState,
        to: CompensationState,
        offset_mm: f64,
        cause: Option<PartRefusal>,
    },
    #[error(
        "axis {axis}: wanted offset {wanted_mm:.6} mm exceeds {limit_mm} mm, the last one inside is kept", limit_mm = number(*limit_mm))]
    SizeExceeded {
        axis: Axis,
        wanted_mm: f64,
        limit_mm: f64,
    },
    #[error("axis {axis}: wanted offset is inside its limit again")]
    SizeKept { axis: Axis },
    #[error("axis {axis}: {cause}")]
    ModelRefused { axis: Axis, cause: PartRefusal },
    #[error(
        "thermal model {sequence} jumps by {change_mm:.6} mm on axis {axis}, heat allows {limit_mm:.6} mm; kept back"
    )]
    ModelQuarantined {
        sequence: u32,
        axis: Axis,
        change_mm: f64,
        limit_mm: f64,
    },
    #[error("thermal model {sequence} confirms the jump and is used")]
    ModelConfirmed { sequence: u32 },
    #[error(
        "thermal model {sequence} has a number on axis {axis} that is not finite or senseless; refused"
    )]
    ModelNotFinite { sequence: u32, axis: Axis },
    #[error("thermal model {sequence} awaits confirmation of a jump at the blocks")]
    ModelDoubtful { sequence: u32 },
    #[error("thermal model {sequence} is used without objection")]
    ModelAccepted { sequence: u32 },
    #[error("thermal model {sequence} expired {late_s} s ago and is not taken", late_s = number(*late_s))]
    ModelExpired { sequence: u32, late_s: f64 },
    #[error("thermal model {sequence} is {by_s} s older than the one in use and is not taken", by_s = number(*by_s))]
    ModelOlder { sequence: u32, by_s: f64 },
    #[error(
        "axis {axis}: drift used at {position_mm:.3} mm, so far outside the blocks' span {lower_mm:.3} to {upper_mm:.3} mm that the extrapolation outweighs the uncertainty at the block: expanded uncertainty {:.1} µm, up to {:.1} µm at the travel's corners",
        expanded_uncertainty_mm * 1e3,
        greatest_mm * 1e3
    )]
    BeyondSpan {
        axis: Axis,
        position_mm: f64,
        lower_mm: f64,
        upper_mm: f64,
        expanded_uncertainty_mm: f64,
        greatest_mm: f64,
    },
    #[error("axis {axis}: positions stayed inside the blocks' span")]
    WithinSpan { axis: Axis },
    #[error("{model} {sequence} is used")]
    GeometryAccepted {
        model: GeometrySource,
        sequence: u32,
    },
    #[error("{model} {sequence} confirms the change and is used")]
    GeometryConfirmed {
        model: GeometrySource,
        sequence: u32,
    },
    #[error(
        "{model} {sequence} changes the tip's error by {change_mm:.6} mm, {limit_mm} mm are allowed; kept back", limit_mm = number(*limit_mm))]
    GeometryQuarantined {
        model: GeometrySource,
        sequence: u32,
        change_mm: f64,
        limit_mm: f64,
    },
    #[error("{model} {sequence} is refused: {cause}")]
    GeometryRefused {
        model: GeometrySource,
        sequence: u32,
        cause: Box<VolumetricError>,
    },
    #[error("{model} {sequence} is not used: nothing is recorded along {axis} yet")]
    GeometryIncomplete {
        model: GeometrySource,
        sequence: u32,
        axis: Axis,
    },
    #[error("{model} {sequence} is not used: the parameters have no `geometry`")]
    GeometryUnused {
        model: GeometrySource,
        sequence: u32,
    },
    #[error("{cause}; not learned")]
    RunRefused { cause: PositioningRefusal },
    #[error("axis {axis}: {runs} of {needed} runs for a table")]
    RunsCollected { axis: Axis, runs: u32, needed: u32 },
    #[error("axis {axis}: table of {points} points learned from {runs} runs")]
    TableLearned {
        axis: Axis,
        points: usize,
        runs: u32,
    },
    #[error(
        "axis {axis}: the points lie whole leads of {lead_mm} mm apart and cannot see the screw's cyclic error", lead_mm = number(*lead_mm))]
    LeadHidden { axis: Axis, lead_mm: f64 },
    #[error("axis {axis}: the points see the cyclic error of a lead of {lead_mm} mm", lead_mm = number(*lead_mm))]
    LeadSeen { axis: Axis, lead_mm: f64 },
    #[error("axis {axis}: the scale says nothing")]
    ScaleMissing { axis: Axis },
    #[error("axis {axis}: the scale speaks again")]
    ScaleBack { axis: Axis },
    #[error(
        "axis {axis}: {change_mm:.6} mm measured beside what is known at {position_mm:.3} mm, above {limit_mm} mm nothing is believed", limit_mm = number(*limit_mm))]
    MeasurementDoubted {
        axis: Axis,
        position_mm: f64,
        change_mm: f64,
        limit_mm: f64,
    },
    #[error("axis {axis}: measurements are believed again")]
    MeasurementBelieved { axis: Axis },
    #[error("no axis state for {silence_s:.3} s")]
    StatesStale { silence_s: f64 },
    #[error("gap of {gap_s:.3} s between axis states, offsets stood meanwhile")]
    Gap { gap_s: f64 },
    #[error("controller clock went back by {by_s} s, one servo period is assumed", by_s = number(*by_s))]
    ClockWentBack { by_s: f64 },
    #[error("compensation enabled: {enabled}")]
    Enabled { enabled: bool },
    #[error("shutting down, offsets fade to zero")]
    ShuttingDown,
}

impl Diagnostic {
    /// How urgent it is.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::Enabled { .. }
            | Self::ShuttingDown
            | Self::SizeKept { .. }
            | Self::Gap { .. }
            | Self::ModelAccepted { .. }
            | Self::WithinSpan { .. }
            | Self::RunsCollected { .. }
            | Self::TableLearned { .. }
            | Self::LeadSeen { .. }
            | Self::ScaleBack { .. }
            | Self::MeasurementBelieved { .. }
            | Self::GeometryAccepted { .. }
            | Self::GeometryConfirmed { .. }
            | Self::GeometryIncomplete { .. }
            | Self::ModelConfirmed { .. } => Severity::Info,
            Self::StateChanged { to, cause, .. } => match to {
                CompensationState::Active => Severity::Info,
                // Switched off: as somebody wanted it.
                CompensationState::Off | CompensationState::Fading if cause.is_none() => {
                    Severity::Info
                }
                CompensationState::Off => Severity::Error,
                _ => Severity::Warn,
            },
            Self::ModelNotFinite { .. } | Self::GeometryRefused { .. } => Severity::Error,
            _ => Severity::Warn,
        }
    }

    /// The lasting condition to which it belongs: one of severity `Info` ends what others began.
    #[must_use]
    pub fn condition(&self) -> &'static str {
        const AXIS: [&str; 6] = ["axis_x", "axis_y", "axis_z", "axis_a", "axis_b", "axis_c"];
        const SIZE: [&str; 6] = ["size_x", "size_y", "size_z", "size_a", "size_b", "size_c"];
        const SCALE: [&str; 6] = [
            "scale_x", "scale_y", "scale_z", "scale_a", "scale_b", "scale_c",
        ];
        const LEAD: [&str; 6] = ["lead_x", "lead_y", "lead_z", "lead_a", "lead_b", "lead_c"];
        const SPAN: [&str; 6] = ["span_x", "span_y", "span_z", "span_a", "span_b", "span_c"];
        const MEASURED: [&str; 6] = [
            "measured_x",
            "measured_y",
            "measured_z",
            "measured_a",
            "measured_b",
            "measured_c",
        ];
        match self {
            Self::RunRefused { .. } | Self::RunsCollected { .. } | Self::TableLearned { .. } => {
                "positioning_test"
            }
            Self::LeadHidden { axis, .. } | Self::LeadSeen { axis, .. } => LEAD[axis.index()],
            Self::ScaleMissing { axis } | Self::ScaleBack { axis } => SCALE[axis.index()],
            Self::MeasurementDoubted { axis, .. } | Self::MeasurementBelieved { axis } => {
                MEASURED[axis.index()]
            }
            Self::StateChanged { axis, .. } | Self::ModelRefused { axis, .. } => AXIS[axis.index()],
            Self::SizeExceeded { axis, .. } | Self::SizeKept { axis } => SIZE[axis.index()],
            Self::BeyondSpan { axis, .. } | Self::WithinSpan { axis } => SPAN[axis.index()],
            Self::ModelQuarantined { .. }
            | Self::ModelExpired { .. }
            | Self::ModelOlder { .. }
            | Self::ModelConfirmed { .. }
            | Self::ModelNotFinite { .. }
            | Self::ModelDoubtful { .. }
            | Self::ModelAccepted { .. } => "model",
            Self::GeometryAccepted { model, .. }
            | Self::GeometryConfirmed { model, .. }
            | Self::GeometryQuarantined { model, .. }
            | Self::GeometryRefused { model, .. }
            | Self::GeometryIncomplete { model, .. }
            | Self::GeometryUnused { model, .. } => match model {
                GeometrySource::Linear => "geometry",
                GeometrySource::Rotary => "geometry_rotary",
            },
            Self::StatesStale { .. } | Self::Gap { .. } => "axis_states",
            Self::ClockWentBack { .. } => "controller_clock",
            Self::Enabled { .. } | Self::ShuttingDown => "switch",
        }
    }
}
