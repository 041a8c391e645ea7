//! The conditions of the thermal model on `/diagnostics`.

use node_runtime::{Diagnostic, Level};
use thermal_model::diagnostic::Severity;
use thermal_model::{Diagnostic as Condition, Output};

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let level = match condition.severity() {
        Severity::Info => Level::Ok,
        Severity::Warn => Level::Warn,
        Severity::Error => Level::Error,
    };
    Some(Diagnostic::new(
        level,
        name(condition),
        condition.to_string(),
    ))
}

/// What it is about; a good end has the name of the condition that it ends.
fn name(condition: &Condition) -> String {
    match condition {
        Condition::UnknownBlock { block_id } => format!("unknown_block/{block_id}"),
        Condition::FaceRefused { block_id, axis, .. } => {
            format!("face_refused/{block_id}.{axis}")
        }
        Condition::BlockMissing { block_id, .. } => format!("block_missing/{block_id}"),
        Condition::ReferenceTaken { .. } | Condition::NoReference { .. } => "reference".to_owned(),
        Condition::NoFace { .. } => "no_face".to_owned(),
        Condition::AxisKept { axis } | Condition::AxisDropped { axis } => format!("axis/{axis}"),
        Condition::SlopeUnidentifiable { axis, .. } => format!("slope/{axis}"),
        Condition::Fitted { .. } | Condition::FitRefused { .. } => "fit".to_owned(),
        Condition::LackOfFit { .. } => "lack_of_fit".to_owned(),
        Condition::Quarantined { .. }
        | Condition::JumpConfirmed { .. }
        | Condition::JumpContradicted => "jump".to_owned(),
        Condition::UpdateOverdue { .. } => "update_overdue".to_owned(),
        Condition::ClockWentBack { .. } => "clock_went_back".to_owned(),
        Condition::LoadChanged { .. } => "load".to_owned(),
        Condition::Scored { .. } => "score".to_owned(),
        Condition::TimeConstant { axis, .. } | Condition::NoTimeConstant { axis, .. } => {
            format!("time_constant/{axis}")
        }
        Condition::TemperatureRegression { .. } => "temperature_regression".to_owned(),
        Condition::UnknownSensor { sensor }
        | Condition::SensorNotFinite { sensor }
        | Condition::SensorStale { sensor, .. } => format!("sensor/{sensor}"),
    }
}
