//! The probe's conditions on `/diagnostics`.

use node_runtime::{Diagnostic, Level};
use probe::{Diagnostic as Condition, Output};

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let (level, name) = match condition {
        Condition::ClockWentBack { .. } => (Level::Error, "clock_went_back".to_owned()),
        Condition::PositionNotFinite { axis, .. } => {
            (Level::Error, format!("position_not_finite/{axis}"))
        }
        Condition::TriggersLost { .. } => (Level::Error, "triggers_lost".to_owned()),
        Condition::ToldBefore { .. } => (Level::Warn, "told_before".to_owned()),
        Condition::TooMany { .. } => (Level::Error, "too_many".to_owned()),
        Condition::CorrectedByFeed { .. } => (Level::Warn, "corrected_by_feed".to_owned()),
        Condition::LatencyRefused { .. } => (Level::Error, "latency_refused".to_owned()),
        Condition::LatencyOlder { .. } => (Level::Warn, "latency_older".to_owned()),
        Condition::FaceMissing { block, axis, .. } => {
            (Level::Error, format!("face_missing/{block}.{axis}"))
        }
        Condition::FaceNotAlongNormal { block, axis, .. } => (
            Level::Error,
            format!("face_not_along_normal/{block}.{axis}"),
        ),
        Condition::ShapeNotEvaluated { feature, .. } => {
            (Level::Error, format!("shape_not_evaluated/{feature}"))
        }
        Condition::MixedPoses { feature, .. } => (Level::Error, format!("mixed_poses/{feature}")),
        Condition::UnknownFeature { .. } => (Level::Error, "unknown_feature".to_owned()),
        Condition::UnknownStylus { .. } => (Level::Error, "unknown_stylus".to_owned()),
        Condition::RunNotEnded { .. } => (Level::Warn, "run_not_ended".to_owned()),
        Condition::RunNotBegun { .. } => (Level::Warn, "run_not_begun".to_owned()),
    };
    Some(Diagnostic::new(level, name, condition.to_string()))
}
